/* The surface compliance against plain solves, column by column; both against the condition number. */
#include "model_state.h"
#include "specimen.h"

static double largest(double a, double b)
{
    return a > b ? a : b;
}

/* Columns of G by plain solves against compliance_build, and their own symmetry. Errors in units of the largest G_ii. */
static void compare_with_solves(struct specimen *s, size_t columns_wanted, double *difference, double *asymmetry)
{
    struct failure why;
    struct compliance c;
    must(compliance_build(s->model, true, &c, &why), &why);
    size_t n = model_unknowns(s->model), ld = 3 * c.rows, stride = ld / columns_wanted + 1, count = 0;
    size_t *column = room(ld * sizeof *column);
    uint32_t *vertex = room(c.rows * sizeof *vertex);
    for (size_t v = 0; v < s->surface.vertex_count; v++)
        if (c.row_of[v] != UINT32_MAX)
            vertex[c.row_of[v]] = (uint32_t)v;
    for (size_t j = 0; j < ld; j += stride)
        column[count++] = j;
    double *f = room(n * count * sizeof *f), *u = room(n * count * sizeof *u), top = 0, median = 0;
    for (size_t k = 0; k < count; k++)
        model_load(s->model, vertex[column[k] / 3], (int)(column[k] % 3), 1, f + k * n);
    must(model_solve(s->model, count, f, u, &why), &why);
    *difference = *asymmetry = 0;
    for (size_t k = 0; k < count; k++)
        for (size_t i = 0; i < ld; i++) {
            size_t j = column[k];
            double solved = model_displacement(s->model, vertex[i / 3], (int)(i % 3), u + k * n);
            double built = i > j ? c.G[i + j * ld] : c.G[j + i * ld];
            top = largest(top, i == j ? solved : 0);
            *difference = largest(*difference, fabs(solved - built));
        }
    for (size_t k = 0; k < count; k++)
        for (size_t l = 0; l < k; l++) {
            size_t i = column[k], j = column[l];
            *asymmetry =
                largest(*asymmetry, fabs(model_displacement(s->model, vertex[j / 3], (int)(j % 3), u + k * n) -
                                         model_displacement(s->model, vertex[i / 3], (int)(i % 3), u + l * n)));
        }
    for (size_t r = 0; r < c.rows; r++) /* rank of the stated median: as many below as above */
        median += c.G[3 * r * (ld + 1)] + c.G[(3 * r + 1) * (ld + 1)] + c.G[(3 * r + 2) * (ld + 1)] >
                  3 * c.median_diagonal_m_N;
    assert_true(fabs(median - (double)c.rows / 2) <= 1);
    *difference /= top;
    *asymmetry /= top;
    free(column);
    free(vertex);
    free(f);
    free(u);
    compliance_free(&c);
}

/* Condition number of K from below: 30 power iterations for the largest eigenvalue of K and of its inverse. */
static double condition(struct specimen *s, uint64_t *seed)
{
    size_t n = model_unknowns(s->model);
    double *x = room(n * sizeof *x), *y = room(n * sizeof *y), product = 1;
    struct failure why;
    for (int inverse = 0; inverse < 2; inverse++) {
        double norm = 0;
        for (size_t i = 0; i < n; i++)
            x[i] = draw(seed) - 0.5;
        for (int k = 0; k < 30; k++) {
            if (inverse)
                must(model_solve(s->model, 1, x, y, &why), &why);
            else
                model_multiply(s->model, x, y);
            norm = 0;
            for (size_t i = 0; i < n; i++)
                norm += y[i] * y[i];
            norm = sqrt(norm);
            for (size_t i = 0; i < n; i++)
                x[i] = y[i] / norm;
        }
        product *= norm;
    }
    free(x);
    free(y);
    return product;
}

/* Both ways may lose cond(K) x 2^-53 of the largest G_ii (they agree to 1e-14 .. 6e-13 as measured). Reciprocity of the
 * solves is asked for to 1e-12. */
static void check_agreement(struct specimen *s, const char *name, size_t columns, uint64_t *seed)
{
    double difference, asymmetry, cond = condition(s, seed);
    compare_with_solves(s, columns, &difference, &asymmetry);
    print_message("# %s, %s: elimination against solves %.1e (cond(K) %.1e), reciprocity of the solves %.1e\n", name,
                  model_discretisation(s->model), difference, cond, asymmetry);
    assert_true(difference < cond * 1.1e-16);
    assert_true(asymmetry < 1e-12);
}

static void elimination_agrees_with_plain_solves_and_both_are_reciprocal(void **state)
{
    (void)state;
    uint64_t seed = 17;
    struct specimen s;
    for (int order = 0; order < 2; order++) {
        specimen_irregular(&s, 0.45, order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR, &seed);
        check_agreement(&s, "block", 200, &seed);
        specimen_free(&s);
        static const char *const names[] = {"liver_smooth_412_1336.msh", "cylinder_8x30x6.msh"};
        for (size_t k = 0; k < 2; k++) {
            if (!specimen_data(&s, names[k], 0.45))
                continue;
            s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
            specimen_model(&s);
            check_agreement(&s, names[k], 60, &seed);
            specimen_free(&s);
        }
    }
}

static void check_rollers(enum element_order order)
{
    struct failure why;
    struct compliance c;
    struct specimen s;
    specimen_block(&s, 4, 3, 3, 0.2, 0.15, 0.15);
    specimen_material(&s, "all", 4000, 0.3);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "x");
    specimen_fix(&s, box(0, 0, 0, 1, 0, 1), "y");
    specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "z");
    s.scene.order = order;
    specimen_model(&s);
    must(compliance_build(s.model, true, &c, &why), &why);
    /* only the corner is fixed in all three; every other vertex has a row */
    assert_int_equal(c.rows, s.surface.vertex_count - 1);
    size_t ld = 3 * c.rows, zeros = 0;
    for (size_t v = 0; v < s.surface.vertex_count; v++) {
        assert_int_equal(c.row_of[v] == UINT32_MAX, model_fixed_vertices(s.model)[v]);
        for (size_t a = 0; a < 3 && c.row_of[v] != UINT32_MAX; a++) {
            size_t j = 3 * c.row_of[v] + a;
            if (model_unknown(s.model, s.surface.node[v], (int)a) >= 0) {
                assert_true(c.G[j + j * ld] > 0);
                continue;
            }
            zeros++;
            for (size_t i = 0; i < ld; i++)
                assert_true((i > j ? c.G[i + j * ld] : c.G[j + i * ld]) == 0);
        }
    }
    assert_int_equal(zeros, 20 + 20 + 16 - 3); /* nodes of the three faces, less the corner's components */
    uint64_t seed = 5;
    check_agreement(&s, "rollers", 1000, &seed);
    compliance_free(&c);
    specimen_free(&s);
}

static void partly_fixed_vertices_keep_a_row_with_zeros_where_they_are_fixed(void **state)
{
    (void)state;
    check_rollers(ELEMENT_LINEAR);
    check_rollers(ELEMENT_QUADRATIC);
}

/* No node of the mesh lies inside; of the quadratic elements some do, of others none. */
static void body_without_interior_nodes_is_reduced(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        struct specimen s;
        uint64_t seed = 6;
        specimen_block(&s, 6, 1, 1, 0.3, 0.05, 0.05);
        specimen_material(&s, "all", 4000, 0.45);
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
        s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        specimen_model(&s);
        check_agreement(&s, "slender bar", 1000, &seed);
        specimen_free(&s);
    }
}

/* Backward error |K u - f| / (|K| |u| + |f|) of a stable solve stays at rounding however bad the condition is. */
static double backward_error(struct specimen *s, uint64_t *seed)
{
    size_t n = model_unknowns(s->model);
    double *f = room(n * sizeof *f), *u = room(n * sizeof *u), *Ku = room(n * sizeof *Ku), *e = room(n * sizeof *e);
    struct failure why;
    double f_max = 0, u_max = 0, residual = 0, K_max = 0;
    for (size_t i = 0; i < n; i++)
        f[i] = draw(seed) - 0.5;
    must(model_solve(s->model, 1, f, u, &why), &why);
    model_multiply(s->model, u, Ku);
    for (size_t i = 0; i < n; i++) {
        f_max = largest(f_max, fabs(f[i]));
        u_max = largest(u_max, fabs(u[i]));
        residual = largest(residual, fabs(Ku[i] - f[i]));
    }
    const int32_t *start = s->model->K->p, *row = s->model->K->i;
    const double *K = s->model->K->x;
    for (size_t j = 0; j < n; j++)
        for (int32_t i = start[j]; i < start[j + 1]; i++) {
            e[j] += fabs(K[i]);
            e[row[i]] += (size_t)row[i] != j ? fabs(K[i]) : 0;
        }
    for (size_t j = 0; j < n; j++)
        K_max = largest(K_max, e[j]);
    free(f);
    free(u);
    free(Ku);
    free(e);
    return residual / (K_max * u_max + f_max);
}

/* The residual stays at rounding whatever the condition; the compliance itself moves by cond(K) x 2^-53 at most about. */
static void check_hard(struct specimen *s, const char *name, uint64_t *seed)
{
    double difference, asymmetry;
    specimen_model(s);
    double residual = backward_error(s, seed), cond = condition(s, seed);
    compare_with_solves(s, 60, &difference, &asymmetry);
    print_message("# %s, %s, nu = 0.4999: cond(K) %.1e, backward error %.1e, elimination against solves %.1e\n", name,
                  model_discretisation(s->model), cond, residual, difference);
    assert_true(residual < 1e-14); /* a row of the factor adds up some hundred roundings of 1.1e-16 */
    assert_true(difference < cond * 1.1e-16);
    specimen_free(s);
}

static void near_incompressible_bodies_with_slivers_are_solved_to_a_small_residual(void **state)
{
    (void)state;
    uint64_t seed = 3;
    struct specimen s;
    for (int order = 0; order < 2; order++) {
        specimen_block(&s, 5, 5, 5, 0.2, 0.2, 0.2);
        /* squash one layer of cells to a thousandth: dihedral angles down to 0.06 degrees */
        for (size_t n = 0; n < s.mesh.node_count; n++)
            if (fabs(s.mesh.nodes[3 * n + 2] - 0.12) < 1e-9)
                s.mesh.nodes[3 * n + 2] = 0.08 + 4e-5;
        specimen_material(&s, "all", 4000, 0.4999);
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
        s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        check_hard(&s, "squashed block", &seed);
        static const char *const names[] = {"Ossicles.vtu", "Armadillo_Tetra_4406.vtu", "liver_smooth_412_1336.msh"};
        for (size_t k = 0; k < 3; k++)
            if (specimen_data(&s, names[k], 0.4999)) {
                s.scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
                check_hard(&s, names[k], &seed);
            }
    }
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(elimination_agrees_with_plain_solves_and_both_are_reciprocal),
        cmocka_unit_test(partly_fixed_vertices_keep_a_row_with_zeros_where_they_are_fixed),
        cmocka_unit_test(body_without_interior_nodes_is_reduced),
        cmocka_unit_test(near_incompressible_bodies_with_slivers_are_solved_to_a_small_residual),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
