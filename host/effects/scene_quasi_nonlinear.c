#include "scene_quasi_nonlinear.h"

#include <math.h>
#include <stdlib.h>

#include "scene_keys.h"

_Static_assert((int)BANK_CURVE_DEGREE == (int)CYLINDER_FIT_DEGREE_MAX, "the bank holds every curve that is fitted");

/* `{range: 2 N, coefficients: [2, 0.4]}` */
static void curve(struct tree *t, tree_node map, const char *name, enum dimension dimension, struct monotone *c)
{
    if (!tree_map(t, map, name, KEYS("range", "coefficients")))
        return;
    *c = (struct monotone){0};
    scene_bounded(t, tree_need(t, map, name, "range"), "range", dimension, 1e-9, (double)BANK_MAX_CURVE, "", &c->range);
    tree_node list = tree_need(t, map, name, "coefficients");
    size_t count = tree_list(t, list, "coefficients", CYLINDER_FIT_DEGREE_MAX);
    tree_require(t, list, count > 0, "coefficients is empty");
    for (size_t k = 0; k < count && !t->status; k++) {
        c->coefficient[k + 1] = 0;
        scene_bounded(t, tree_item(t, list, k), "a coefficient", DIMENSION_NUMBER, -(double)BANK_MAX_CURVE,
                      (double)BANK_MAX_CURVE, "", &c->coefficient[k + 1]);
    }
    c->degree = (int)count;
    double turn = t->status ? -1 : monotone_turn(c);
    tree_require(t, map, turn < 0, "%s is not monotone: it turns at %.4g of %.4g", name, turn, c->range);
}

/* The linear answer of the sample: of the body's first isotropic material, unless it is given. */
static void sample(struct tree *t, tree_node map, const struct scene *scene, struct sample *s)
{
    static const char effect[] = "quasi_nonlinear";
    scene_bounded(t, tree_need(t, map, effect, "height"), "height", DIMENSION_LENGTH, SCENE_MIN_LENGTH_m, 1, " m",
                  &s->height_m);
    scene_bounded(t, tree_need(t, map, effect, "radius"), "radius", DIMENSION_LENGTH, SCENE_MIN_LENGTH_m, 1, " m",
                  &s->radius_m);
    for (size_t m = 0; m < scene->material_count && !(s->E_Pa > 0); m++)
        if (scene->material[m].symmetry == SYMMETRY_ISOTROPIC) {
            s->E_Pa = scene->material[m].E_Pa;
            s->nu = scene->material[m].nu;
        }
    tree_node E = tree_find(t, map, "E"), nu = tree_find(t, map, "nu");
    scene_bounded(t, E, "E", DIMENSION_PRESSURE, 1, 1e12, " Pa", &s->E_Pa);
    scene_bounded(t, nu, "nu", DIMENSION_NUMBER, 0.01, 0.4999, "", &s->nu);
    tree_require(t, map, s->E_Pa > 0, "the body has no isotropic material: give E and nu of the sample");
}

static void fit(struct tree *t, tree_node map, tree_node table, const struct scene *scene,
                struct scene_quasi_nonlinear *q)
{
    double degree = SCENE_DEFAULT_CURVE_DEGREE;
    tree_node wanted = tree_find(t, map, "degree");
    scene_file(t, table, q->fit_path, sizeof q->fit_path);
    sample(t, map, scene, &q->sample);
    tree_quantity(t, wanted, "degree", DIMENSION_NUMBER, &degree);
    tree_require(t, wanted, degree >= 1 && degree <= CYLINDER_FIT_DEGREE_MAX && degree == floor(degree),
                 "degree = %g: a whole number from 1 to %d is needed", degree, CYLINDER_FIT_DEGREE_MAX);
    if (t->status)
        return;
    q->degree = (unsigned)degree;
    t->status = cylinder_fit_file(q->fit_path, &q->sample, (int)q->degree, &q->fit, t->why);
}

void scene_quasi_nonlinear_parse(struct tree *t, void *map, struct scene *scene)
{
    struct scene_quasi_nonlinear *q = &scene->effects.quasi_nonlinear;
    *q = (struct scene_quasi_nonlinear){.share = 1};
    if (!tree_map(t, map, "quasi_nonlinear", KEYS("fit", "height", "radius", "E", "nu", "degree", "Q", "P", "share")))
        return;
    tree_node table = tree_find(t, map, "fit"), Q = tree_find(t, map, "Q"), P = tree_find(t, map, "P");
    if (!table == !Q) {
        tree_fail(t, map, STATUS_SCENE_VALUE, "give one of them",
                  "quasi_nonlinear needs either a table to fit, or the curve Q");
        return;
    }
    if (table)
        fit(t, map, table, scene, q);
    else
        curve(t, Q, "Q", DIMENSION_FORCE, &q->fit.Q);
    tree_require(t, P ? P : map, !table || !P, "P is fitted to the table, too: give one of them");
    if (P && !table) {
        curve(t, P, "P", DIMENSION_LENGTH, &q->fit.P);
        q->fit.has_across = true;
    }
    scene_bounded(t, tree_find(t, map, "share"), "share", DIMENSION_NUMBER, 1e-6, 1e6, "", &q->share);
}

static void print_curve(FILE *out, const char *name, enum dimension dimension, const struct monotone *c)
{
    char text[QUANTITY_TEXT];
    quantity_print(c->range, dimension, text);
    fprintf(out, "%s: {range: %s, coefficients: [", name, text);
    for (int k = 1; k <= c->degree; k++) {
        quantity_print(c->coefficient[k], DIMENSION_NUMBER, text);
        fprintf(out, "%s%s", k > 1 ? ", " : "", text);
    }
    fputs("]}", out);
}

void scene_quasi_nonlinear_print(FILE *out, const struct scene *scene)
{
    const struct scene_quasi_nonlinear *q = &scene->effects.quasi_nonlinear;
    char share[QUANTITY_TEXT];
    fputc('{', out);
    print_curve(out, "Q", DIMENSION_FORCE, &q->fit.Q);
    if (q->fit.has_across) {
        fputs(", ", out);
        print_curve(out, "P", DIMENSION_LENGTH, &q->fit.P);
    }
    quantity_print(q->share, DIMENSION_NUMBER, share);
    fprintf(out, ", share: %s}", share);
}

static void fill(const struct monotone *c, struct bank_curve *b)
{
    b->range = (float)c->range;
    for (int k = 1; k <= c->degree; k++)
        b->coefficient[k - 1] = (float)c->coefficient[k];
}

int scene_quasi_nonlinear_section(const struct scene *scene, struct body *body, struct effect_section *section,
                                  struct failure *why)
{
    (void)body;
    const struct scene_quasi_nonlinear *q = &scene->effects.quasi_nonlinear;
    struct bank_quasi_nonlinear *b = calloc(1, sizeof *b);
    if (!b)
        return failure_set(why, STATUS_MEMORY, scene->path, NULL, "no memory for the effect quasi_nonlinear");
    b->has_across = q->fit.has_across;
    b->sample_per_tool = (float)q->share;
    fill(&q->fit.Q, &b->Q);
    if (b->has_across)
        fill(&q->fit.P, &b->P);
    *section = (struct effect_section){.bytes = b, .length = sizeof *b, .count = 1};
    return STATUS_OK;
}
