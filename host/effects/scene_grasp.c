#include "scene_grasp.h"

#include <math.h>
#include <stdlib.h>

#include "scene.h"
#include "tree.h"

void scene_grasp_parse(struct tree *t, void *map, struct scene *scene)
{
    struct scene_grasp *g = &scene->effects.grasp;
    *g = (struct scene_grasp){.closes = 0.6, .opens = 0.4, .slip_N = 2, .sweeps = SCENE_DEFAULT_SWEEPS};
    if (!tree_empty(t, map) &&
        !tree_map(t, map, "grasp", (const char *const[]){"closes", "opens", "slip", "sweeps", NULL}))
        return;
    if (tree_empty(t, map))
        return;
    tree_node closes = tree_find(t, map, "closes"), opens = tree_find(t, map, "opens"),
              slip = tree_find(t, map, "slip");
    tree_quantity(t, closes, "closes", DIMENSION_SHARE, &g->closes);
    tree_quantity(t, opens, "opens", DIMENSION_SHARE, &g->opens);
    tree_require(t, map, g->opens >= 0 && g->closes <= 1 && g->closes - g->opens >= 0.05,
                 "the jaws open at %.3g %% and close at %.3g %%: from 0 to 100 %% is possible, 5 %% apart at least",
                 100 * g->opens, 100 * g->closes);
    tree_quantity(t, slip, "slip", DIMENSION_FORCE, &g->slip_N);
    tree_require(t, slip, g->slip_N > 0 && g->slip_N <= 1000, "slip = %g N: it must be above 0 and at most 1000 N",
                 g->slip_N);
    double count = g->sweeps;
    tree_node sweeps = tree_find(t, map, "sweeps");
    tree_quantity(t, sweeps, "sweeps", DIMENSION_NUMBER, &count);
    bool good = count >= 1 && count <= BANK_MAX_SWEEPS && count == floor(count);
    tree_require(t, sweeps, good, "sweeps = %g: a whole number from 1 to %d is needed", count, BANK_MAX_SWEEPS);
    g->sweeps = good ? (unsigned)count : SCENE_DEFAULT_SWEEPS;
}

void scene_grasp_print(FILE *out, const struct scene *scene)
{
    const struct scene_grasp *g = &scene->effects.grasp;
    char closes[QUANTITY_TEXT], opens[QUANTITY_TEXT], slip[QUANTITY_TEXT];
    quantity_print(g->closes, DIMENSION_SHARE, closes);
    quantity_print(g->opens, DIMENSION_SHARE, opens);
    quantity_print(g->slip_N, DIMENSION_FORCE, slip);
    fprintf(out, "{closes: %s, opens: %s, slip: %s, sweeps: %u}", closes, opens, slip, g->sweeps);
}

int scene_grasp_section(const struct scene *scene, struct body *body, struct effect_section *section,
                        struct failure *why)
{
    (void)body;
    const struct scene_grasp *g = &scene->effects.grasp;
    struct bank_grasp *b = malloc(sizeof *b);
    if (!b)
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect grasp");
    *b = (struct bank_grasp){.close_count = (uint32_t)ceil(g->closes * BANK_MAX_GRIP),
                             .open_count = (uint32_t)floor(g->opens * BANK_MAX_GRIP),
                             .slip_N = (float)g->slip_N,
                             .sweeps = g->sweeps};
    *section = (struct effect_section){.bytes = b, .length = sizeof *b, .count = 1};
    return STATUS_OK;
}
