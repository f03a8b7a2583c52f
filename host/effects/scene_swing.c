#include "scene_swing.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

#include "bank.h"
#include "modes.h"
#include "tick.h"
#include "tree.h"

_Static_assert((int)MODES_MAX == (int)BANK_MAX_MODES, "as many modes as the bank holds");

/* A mode must take at least this many ticks for a radian, or its own time is none that a hand could feel: 50 Hz. */
static const double FASTEST_rad_s = 2 * 3.14159265358979323846 * 50;

void scene_swing_parse(struct tree *t, void *map, struct scene *scene)
{
    struct scene_swing *s = &scene->effects.swing;
    if (!tree_map(t, map, "swing", (const char *const[]){"modes", "damping", NULL}))
        return;
    tree_node modes = tree_find(t, map, "modes"), damping = tree_find(t, map, "damping");
    double count = SCENE_DEFAULT_MODES;
    s->damping = SCENE_DEFAULT_SWING_DAMPING;
    tree_quantity(t, modes, "modes", DIMENSION_NUMBER, &count);
    bool good = count >= 1 && count <= BANK_MAX_MODES && count == floor(count);
    tree_require(t, modes, good, "modes = %g: a whole number from 1 to %d is needed", count, BANK_MAX_MODES);
    s->modes = good ? (unsigned)count : SCENE_DEFAULT_MODES;
    tree_quantity(t, damping, "damping", DIMENSION_RATIO, &s->damping);
    tree_require(t, damping, s->damping > 0 && s->damping <= 1,
                 "damping = %.9g of critical: it must be above 0 and at most 1", s->damping);
}

void scene_swing_print(FILE *out, const struct scene *scene)
{
    char damping[QUANTITY_TEXT];
    quantity_print(scene->effects.swing.damping, DIMENSION_RATIO, damping);
    fprintf(out, "{modes: %u, damping: %s}", scene->effects.swing.modes, damping);
}

/* z'' + 2 zeta omega z' + omega^2 (z - g) = 0 over one tick with g constant, in closed form, as what is added to z and z' /
 * omega. */
static void advance(double omega_rad_s, double zeta, struct bank_mode *mode)
{
    double theta = omega_rad_s / TICK_RATE_HZ, root = sqrt(fmax(1 - zeta * zeta, 1e-12));
    double fade = exp(-zeta * theta), c = cos(root * theta), s = sin(root * theta) / root;
    mode->drive = (float)(1 - fade * (c + zeta * s));
    mode->glide = mode->pull = (float)(fade * s);
    mode->drag = (float)(1 - fade * (c - zeta * s));
}

/* The linear map of space that is nearest to the mode on the surface, in the mean over its area. */
static int fit(const struct body *body, const double *share, float affine[12], struct failure *why)
{
    const struct surface *surface = &body->surface;
    double normal[16] = {0}, right[12] = {0};
    for (size_t v = 0; v < surface->vertex_count; v++) {
        const double *x = body->mesh.nodes + 3 * (size_t)surface->node[v];
        double row[4] = {x[0], x[1], x[2], 1};
        for (int i = 0; i < 4; i++) {
            for (int j = 0; j < 4; j++)
                normal[4 * i + j] += surface->areas[v] * row[i] * row[j];
            for (int a = 0; a < 3; a++)
                right[4 * a + i] += surface->areas[v] * row[i] * share[3 * v + (size_t)a];
        }
    }
    for (int i = 0; i < 4; i++)
        normal[5 * i] *= 1 + 1e-10; /* a flat surface has no map across itself: any does */
    if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', 4, 3, normal, 4, right, 4) != 0)
        return failure_set(why, STATUS_MODEL_FACTOR, body->scene.path, NULL, "no map could be fitted to a mode");
    for (int i = 0; i < 12; i++)
        affine[i] = (float)right[i];
    return STATUS_OK;
}

static int fill(const struct scene *scene, const struct body *body, const struct modes *modes,
                struct effect_section *section, struct failure *why)
{
    size_t vertices = body->surface.vertex_count;
    section->count = modes->count;
    section->length = sizeof(struct bank_swing) + modes->count * 3 * vertices * sizeof(float);
    struct bank_swing *b = section->bytes = calloc(1, section->length);
    if (!b)
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect swing");
    float *shape = (float *)(b + 1);
    b->modes = (uint32_t)modes->count;
    for (size_t i = 0; i < modes->count * 3 * vertices; i++)
        shape[i] = (float)modes->share[i];
    for (size_t k = 0; k < modes->count; k++) {
        if (modes->omega_rad_s[k] > FASTEST_rad_s)
            return failure_set(why, STATUS_SCENE_VALUE, scene->path, "ask for fewer modes",
                               "swing: mode %zu of the body vibrates at %.3g Hz; beyond %.3g Hz nothing swings", k + 1,
                               modes->omega_rad_s[k] / 6.283185307179586, FASTEST_rad_s / 6.283185307179586);
        advance(modes->omega_rad_s[k], scene->effects.swing.damping, &b->mode[k]);
        int status = fit(body, modes->share + k * 3 * vertices, b->mode[k].affine, why);
        if (status)
            return status;
    }
    return STATUS_OK;
}

int scene_swing_section(const struct scene *scene, struct body *body, struct effect_section *section,
                        struct failure *why)
{
    struct modes modes;
    int status = modes_find(body->model, scene->effects.swing.modes, &modes, why);
    if (!status)
        status = fill(scene, body, &modes, section, why);
    modes_free(&modes);
    return status;
}
