#include "scene_friction.h"

#include <math.h>
#include <stdlib.h>

#include "scene.h"
#include "tree.h"

void scene_friction_parse(struct tree *t, void *map, struct scene *scene)
{
    struct scene_friction *f = &scene->effects.friction;
    if (!tree_map(t, map, "friction", (const char *const[]){"mu", "sweeps", NULL}))
        return;
    tree_node mu = tree_need(t, map, "friction", "mu"), sweeps = tree_find(t, map, "sweeps");
    tree_quantity(t, mu, "mu", DIMENSION_NUMBER, &f->mu);
    tree_require(t, mu, f->mu > 0 && f->mu <= (double)BANK_MAX_FRICTION,
                 "mu = %.9g: it must be above 0 and at most %g; without friction leave the effect out", f->mu,
                 (double)BANK_MAX_FRICTION);
    double count = SCENE_DEFAULT_SWEEPS;
    tree_quantity(t, sweeps, "sweeps", DIMENSION_NUMBER, &count);
    bool good = count >= 1 && count <= BANK_MAX_SWEEPS && count == floor(count);
    tree_require(t, sweeps, good, "sweeps = %g: a whole number from 1 to %d is needed", count, BANK_MAX_SWEEPS);
    f->sweeps = good ? (unsigned)count : SCENE_DEFAULT_SWEEPS;
}

void scene_friction_print(FILE *out, const struct scene *scene)
{
    char mu[QUANTITY_TEXT];
    quantity_print(scene->effects.friction.mu, DIMENSION_NUMBER, mu);
    fprintf(out, "{mu: %s, sweeps: %u}", mu, scene->effects.friction.sweeps);
}

int scene_friction_section(const struct scene *scene, struct body *body, struct effect_section *section,
                           struct failure *why)
{
    (void)body;
    struct bank_friction *b = malloc(sizeof *b);
    if (!b)
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect friction");
    *b = (struct bank_friction){.mu = (float)scene->effects.friction.mu, .sweeps = scene->effects.friction.sweeps};
    *section = (struct effect_section){.bytes = b, .length = sizeof *b, .count = 1};
    return STATUS_OK;
}
