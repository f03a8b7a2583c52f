#include "scene_neo_hookean.h"

#include <math.h>
#include <stdlib.h>

#include "bank.h"
#include "scene_keys.h"
#include "second_order_surface.h"

_Static_assert((int)SECOND_ORDER_TERMS == (int)BANK_CUBIC_TERMS, "one order of the monomials");

void scene_neo_hookean_parse(struct tree *t, void *map, struct scene *scene)
{
    struct scene_neo_hookean *s = &scene->effects.neo_hookean;
    if (!tree_map(t, map, "neo_hookean", KEYS("sites", "radius")))
        return;
    tree_node sites = tree_find(t, map, "sites"), radius = tree_find(t, map, "radius");
    double count = SCENE_DEFAULT_SITES;
    tree_quantity(t, sites, "sites", DIMENSION_NUMBER, &count);
    bool good = count >= SCENE_MIN_SITES && count <= BANK_MAX_VERTICES && count == floor(count);
    tree_require(t, sites, good, "sites = %g: a whole number from %d to %d is needed", count, SCENE_MIN_SITES,
                 BANK_MAX_VERTICES);
    s->sites = good ? (unsigned)count : SCENE_DEFAULT_SITES;
    scene_bounded(t, radius, "radius", DIMENSION_LENGTH, SCENE_MIN_LENGTH_m, SCENE_MAX_TIP_RADIUS_m, " m",
                  &s->radius_m);
}

void scene_neo_hookean_print(FILE *out, const struct scene *scene)
{
    char radius[QUANTITY_TEXT];
    quantity_print(scene->effects.neo_hookean.radius_m, DIMENSION_LENGTH, radius);
    fprintf(out, "{sites: %u", scene->effects.neo_hookean.sites);
    if (scene->effects.neo_hookean.radius_m > 0)
        fprintf(out, ", radius: %s", radius);
    fputc('}', out);
}

int scene_neo_hookean_section(const struct scene *scene, struct body *body, struct effect_section *section,
                              struct failure *why)
{
    struct second_order_surface found;
    const struct scene_neo_hookean *s = &scene->effects.neo_hookean;
    double radius = s->radius_m > 0 ? s->radius_m : scene->instrument[0].tip_radius_m;
    int status =
        second_order_surface_find(body->model, &body->mesh, &body->surface, radius, s->sites, true, &found, why);
    if (status)
        return status;
    size_t length = sizeof(struct bank_neo_hookean) + found.vertices * sizeof(struct bank_cubic);
    struct bank_neo_hookean *b = calloc(1, length);
    if (!b) {
        second_order_surface_free(&found);
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect neo_hookean");
    }
    b->radius_m = (float)radius;
    for (size_t v = 0; v < found.vertices; v++) {
        double largest = 0;
        for (int k = 0; k < SECOND_ORDER_TERMS; k++)
            largest = fmax(largest, fabs(found.cubic[v][k]));
        b->vertex[v] =
            (struct bank_cubic){.unit_m_N2 = (float)(largest / INT16_MAX), .range_J = (float)found.range_J[v]};
        for (int k = 0; k < SECOND_ORDER_TERMS && largest > 0; k++)
            b->vertex[v].cubic[k] = (int16_t)lround(found.cubic[v][k] / largest * INT16_MAX);
    }
    *section = (struct effect_section){.bytes = b, .length = length, .count = found.vertices};
    second_order_surface_free(&found);
    return STATUS_OK;
}
