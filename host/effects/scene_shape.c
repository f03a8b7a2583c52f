#include "scene_shape.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bank.h"
#include "scene_keys.h"
#include "shape_seeds.h"

static const double PI = 3.14159265358979323846;
static const double SMALLEST_RADIUS_m = 1e-4;

unsigned scene_shape_samples(const struct scene_shape *shape)
{
    return shape->shaft.samples + (shape->jaws ? 2 * shape->jaw.samples : 0);
}

static bool has_shape(const struct scene_shape *shape, const struct scene_instrument *instrument)
{
    return !*shape->instrument || !strcmp(shape->instrument, instrument->name);
}

/* Between neighbours, or beyond the only one, in radii. */
static double gap(const struct scene_capsule *c, bool open_end)
{
    double gaps = open_end ? c->samples : c->samples - 1.0;
    return c->length_m / fmax(gaps, 0.5) / c->radius_m;
}

void scene_shape_spread(struct scene_shape *shape, unsigned samples)
{
    bool pair = shape->jaws && samples > 1;
    shape->shaft.samples = !pair || samples > 2;
    shape->jaw.samples = pair;
    while (scene_shape_samples(shape) < samples) {
        bool jaws = shape->jaws && gap(&shape->jaw, true) > gap(&shape->shaft, false);
        if (jaws && scene_shape_samples(shape) + 2 <= samples)
            shape->jaw.samples++;
        else
            shape->shaft.samples++;
    }
}

void scene_shape_sample(struct scene *scene, unsigned samples)
{
    struct scene_shape *s = &scene->effects.shape;
    scene_shape_spread(s, samples);
    for (size_t i = 0; i < scene->instrument_count; i++)
        if (has_shape(s, &scene->instrument[i]))
            scene->instrument[i].tip_points = scene_shape_samples(s);
}

static void capsule(struct tree *t, tree_node map, const char *name, const char *const *keys, struct scene_capsule *c)
{
    if (tree_empty(t, map) || !tree_map(t, map, name, keys))
        return;
    tree_node samples = tree_find(t, map, "samples");
    double count = c->samples;
    scene_bounded(t, tree_find(t, map, "radius"), "radius", DIMENSION_LENGTH, SMALLEST_RADIUS_m, SCENE_MAX_TIP_RADIUS_m,
                  " m", &c->radius_m);
    scene_bounded(t, tree_find(t, map, "length"), "length", DIMENSION_LENGTH, SCENE_MIN_LENGTH_m, SCENE_MAX_LENGTH_m,
                  " m", &c->length_m);
    tree_quantity(t, samples, "samples", DIMENSION_NUMBER, &count);
    bool good = count >= 1 && count <= BANK_MAX_TOOL_POINTS && count == floor(count);
    tree_require(t, samples, good, "samples = %g: a whole number from 1 to %d is needed", count, BANK_MAX_TOOL_POINTS);
    if (good)
        c->samples = (unsigned)count;
}

/* From the tip to the end of the rearmost sphere. */
static double reach(const struct scene_shape *s)
{
    return (s->jaws ? s->jaw.length_m + s->jaw.radius_m : s->shaft.radius_m) + s->shaft.length_m + s->shaft.radius_m;
}

/* What the shape takes from its instruments: their points and tips. */
static void apply(struct tree *t, tree_node map, struct scene *scene)
{
    const struct scene_shape *s = &scene->effects.shape;
    unsigned points = 0;
    bool found = false;
    for (size_t i = 0; i < scene->instrument_count; i++) {
        struct scene_instrument *instrument = &scene->instrument[i];
        if (has_shape(s, instrument)) {
            found = true;
            instrument->tip_points = scene_shape_samples(s);
            instrument->tip_radius_m = s->jaws ? s->jaw.radius_m : s->shaft.radius_m;
            tree_require(t, map, reach(s) <= instrument->length_min_m + 1e-9,
                         "the shape is %.4g m long and the tip of '%s' comes as near to the trocar as %.4g m: it would "
                         "stand out behind",
                         reach(s), instrument->name, instrument->length_min_m);
        }
        points += instrument->tip_points;
    }
    tree_require(t, map, found, "no instrument is named '%s'", s->instrument);
    tree_require(t, map, points <= BANK_MAX_TOOL_POINTS,
                 "%u samples and points of the instruments: %d are possible in all", points, BANK_MAX_TOOL_POINTS);
}

void scene_shape_parse(struct tree *t, void *map, struct scene *scene)
{
    struct scene_shape *s = &scene->effects.shape;
    *s = (struct scene_shape){.shaft = {.radius_m = 2.5e-3, .length_m = 60e-3, .samples = 4},
                              .jaw = {.radius_m = 1.25e-3, .length_m = 20e-3, .samples = 3},
                              .opening_rad = PI / 3};
    if (!tree_empty(t, map) && !tree_map(t, map, "shape", KEYS("shaft", "jaws", "instrument")))
        return;
    if (!tree_empty(t, map)) {
        tree_node jaws = tree_find(t, map, "jaws"), instrument = tree_find(t, map, "instrument");
        tree_name(t, instrument, "instrument", s->instrument, sizeof s->instrument);
        capsule(t, tree_find(t, map, "shaft"), "shaft", KEYS("radius", "length", "samples"), &s->shaft);
        capsule(t, jaws, "jaws", KEYS("radius", "length", "opening", "samples"), &s->jaw);
        s->jaws = jaws != NULL;
        if (!tree_empty(t, jaws))
            scene_bounded(t, tree_find(t, jaws, "opening"), "opening", DIMENSION_ANGLE, 0, PI, " rad", &s->opening_rad);
    }
    if (!t->status)
        apply(t, map, scene);
}

static void print_capsule(FILE *out, const char *name, const struct scene_capsule *c)
{
    char radius[QUANTITY_TEXT], length[QUANTITY_TEXT];
    quantity_print(c->radius_m, DIMENSION_LENGTH, radius);
    quantity_print(c->length_m, DIMENSION_LENGTH, length);
    fprintf(out, "%s: {radius: %s, length: %s, samples: %u", name, radius, length, c->samples);
}

void scene_shape_print(FILE *out, const struct scene *scene)
{
    const struct scene_shape *s = &scene->effects.shape;
    char opening[QUANTITY_TEXT];
    print_capsule(out, "{shaft", &s->shaft);
    fputc('}', out);
    if (s->jaws) {
        quantity_print(s->opening_rad, DIMENSION_ANGLE, opening);
        print_capsule(out, ", jaws", &s->jaw);
        fprintf(out, ", opening: %s}", opening);
    }
    if (*s->instrument)
        fprintf(out, ", instrument: \"%s\"", s->instrument);
    fputc('}', out);
}

/* The closed jaws touch along the shaft's axis and end at the tip; the shaft begins at their hinges, else at the tip. */
static void place(const struct scene_shape *s, struct bank_sphere *sphere)
{
    double hinge_m = s->jaws ? -(s->jaw.length_m + s->jaw.radius_m) : -s->shaft.radius_m;
    for (int side = -1; side <= 1 && s->jaws; side += 2)
        for (unsigned k = 0; k < s->jaw.samples; k++)
            *sphere++ = (struct bank_sphere){.centre_m = {(float)(side * s->jaw.radius_m), 0, (float)hinge_m},
                                             .radius_m = (float)s->jaw.radius_m,
                                             .along_m = (float)(s->jaw.length_m * (1 - (double)k / s->jaw.samples)),
                                             .side = (float)side};
    for (unsigned k = 0; k < s->shaft.samples; k++) {
        double behind_m = k > 0 ? s->shaft.length_m * k / (s->shaft.samples - 1) : 0;
        *sphere++ =
            (struct bank_sphere){.centre_m = {0, 0, (float)(hinge_m - behind_m)}, .radius_m = (float)s->shaft.radius_m};
    }
}

void scene_shape_spheres(const struct scene *scene, struct bank_shape *shape)
{
    const struct scene_shape *s = &scene->effects.shape;
    struct bank_sphere *sphere = shape->sphere;
    shape->band_m = (float)fmax(s->shaft.radius_m, s->jaws ? s->jaw.radius_m : 0);
    for (size_t i = 0; i < scene->instrument_count; i++) {
        struct bank_tool tool;
        struct failure none;
        if (sphere + scene->instrument[i].tip_points > shape->sphere + BANK_MAX_TOOL_POINTS)
            return; /* apply() refuses such a scene */
        if (has_shape(s, &scene->instrument[i])) {
            shape->opening_rad[i] = s->jaws ? (float)(s->opening_rad / 2) : 0;
            place(s, sphere);
        } else if (!scene_tool(&scene->instrument[i], &tool, &none)) {
            for (uint32_t p = 0; p < tool.point_count; p++)
                memcpy(sphere[p].centre_m, tool.point_m[p], sizeof tool.point_m[p]);
        }
        sphere += scene->instrument[i].tip_points;
    }
}

int scene_shape_section(const struct scene *scene, struct body *body, struct effect_section *section,
                        struct failure *why)
{
    struct bank_shape shape = {0};
    const struct surface *surface = &body->surface;
    uint16_t *seed = NULL;
    scene_shape_spheres(scene, &shape);
    double *positions = malloc(3 * surface->vertex_count * sizeof *positions);
    if (!positions)
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect shape");
    for (size_t v = 0; v < surface->vertex_count; v++)
        memcpy(positions + 3 * v, body->mesh.nodes + 3 * (size_t)surface->node[v], 3 * sizeof *positions);
    int status =
        shape_seeds(surface->vertex_count, positions, surface->triangle_count, surface->triangles, &shape, &seed, why);
    free(positions);
    size_t cells = (size_t)shape.cells[0] * shape.cells[1] * shape.cells[2], seeds = 2 * cells * sizeof *seed;
    unsigned char *bytes = status ? NULL : malloc(sizeof shape + seeds);
    if (!status && !bytes)
        status = failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect shape");
    if (!status) {
        memcpy(bytes, &shape, sizeof shape);
        memcpy(bytes + sizeof shape, seed, seeds);
        *section = (struct effect_section){.bytes = bytes, .length = sizeof shape + seeds, .count = cells};
    }
    free(seed);
    return status;
}
