/* A rigid frictionless sphere of radius R pressed by d into a large block, against Hertz' half-space:
 *   F = 4/3 E/(1 - nu^2) sqrt(R) d^1.5,   contact radius a = sqrt(R d).
 * A quarter of the block is meshed (rollers on the two planes of symmetry), graded towards the contact. Contact is
 * unilateral: for surface nodes under the sphere, w = C p >= gap, p >= 0, p (w - gap) = 0, with C the compliance of their
 * normal displacements from model_constrained; solved here by an active set on dense Cholesky factors. */
#include "specimen.h"

#include <gsl/gsl_linalg.h>

static const double RADIUS = 0.1, CONTACT = 0.01; /* m; a / R = 0.1 */
static const double E_PA = 4000, NU = 0.3;
static const double SIDE = 100; /* of the quarter block, in contact radii */

/* x = side sinh(k xi) / sinh(k): cells grow from 0.04 side / cells at the contact. */
static double graded(double xi)
{
    const double k = 5.6;
    return SIDE * CONTACT * sinh(k * xi) / sinh(k);
}

struct contact_set {
    size_t count;
    double *C, *gap, *p;
};

/* Primal-dual active set: ends when the set repeats itself, which is the solution; the bound of 100 rounds
 * is far above the handful it takes. */
static size_t solve_unilateral(struct contact_set *s)
{
    size_t n = s->count, rounds = 0, *index = room(n * sizeof *index);
    bool *active = room(n * sizeof *active), changed = true;
    for (size_t i = 0; i < n; i++)
        active[i] = s->gap[i] > 0;
    while (changed) {
        assert_true(++rounds < 100);
        size_t m = 0;
        for (size_t i = 0; i < n; i++)
            if (active[i])
                index[m++] = i;
        gsl_matrix *A = gsl_matrix_alloc(m, m);
        gsl_vector *b = gsl_vector_alloc(m);
        for (size_t i = 0; i < m; i++) {
            gsl_vector_set(b, i, s->gap[index[i]]);
            for (size_t j = 0; j < m; j++)
                gsl_matrix_set(A, i, j, s->C[index[i] * n + index[j]]);
        }
        gsl_linalg_cholesky_decomp1(A);
        gsl_linalg_cholesky_svx(A, b);
        memset(s->p, 0, n * sizeof *s->p);
        for (size_t i = 0; i < m; i++)
            s->p[index[i]] = gsl_vector_get(b, i);
        gsl_matrix_free(A);
        gsl_vector_free(b);
        changed = false;
        for (size_t i = 0; i < n; i++) {
            double w = 0;
            for (size_t j = 0; j < n; j++)
                w += s->C[i * n + j] * s->p[j];
            bool next = active[i] ? s->p[i] > 0 : w < s->gap[i];
            changed = changed || next != active[i];
            active[i] = next;
        }
    }
    free(index);
    free(active);
    return rounds;
}

/* Force over Hertz' minus one, on a mesh with `cells` cells along each side. */
static double hertz_error(size_t cells, double *cells_in_contact)
{
    struct specimen s;
    struct failure why;
    specimen_block(&s, cells, cells, cells, 1, 1, 1);
    for (size_t n = 0; n < s.mesh.node_count; n++) {
        double *x = s.mesh.nodes + 3 * n;
        x[0] = graded(x[0]);
        x[1] = graded(x[1]);
        x[2] = -graded(1 - x[2]);
    }
    const double side = SIDE * CONTACT;
    specimen_material(&s, "all", E_PA, NU);
    specimen_fix(&s, box(0, 0, -side, 0, side, 0), "x");
    specimen_fix(&s, box(0, 0, -side, side, 0, 0), "y");
    specimen_fix(&s, box(side, 0, -side, side, side, 0), "xyz");
    specimen_fix(&s, box(0, side, -side, side, side, 0), "xyz");
    specimen_fix(&s, box(0, 0, -side, side, side, -side), "xyz");
    specimen_model(&s);

    double depth = CONTACT * CONTACT / RADIUS, force = 0;
    struct contact_set contact = {0};
    uint32_t *vertex = room(3 * s.surface.vertex_count * sizeof *vertex);
    double *weight = room(3 * s.surface.vertex_count * sizeof *weight);
    double *direction = room(3 * s.surface.vertex_count * sizeof *direction);
    contact.gap = room(s.surface.vertex_count * sizeof *contact.gap);
    for (size_t v = 0; v < s.surface.vertex_count; v++) {
        const double *x = s.mesh.nodes + 3 * (size_t)s.surface.node[v];
        double r2 = x[0] * x[0] + x[1] * x[1];
        if (fabs(x[2]) > 1e-12 || r2 > 2.25 * CONTACT * CONTACT) /* contact ends at a; the sphere overlaps to 1.41 a */
            continue;
        for (size_t k = 0; k < 3; k++)
            vertex[3 * contact.count + k] = (uint32_t)v;
        weight[3 * contact.count] = 1;
        direction[3 * contact.count + 2] = -1;
        contact.gap[contact.count++] = depth - (RADIUS - sqrt(RADIUS * RADIUS - r2));
    }
    contact.C = room(contact.count * contact.count * sizeof *contact.C);
    contact.p = room(contact.count * sizeof *contact.p);
    must(model_constrained(s.model, contact.count, vertex, weight, direction, 0, NULL, NULL, contact.C, &why), &why);
    size_t rounds = solve_unilateral(&contact), touching = 0;
    for (size_t i = 0; i < contact.count; i++) {
        force += 4 * contact.p[i]; /* four quarters */
        touching += contact.p[i] > 0;
    }
    double hertz = 4.0 / 3 * E_PA / (1 - NU * NU) * sqrt(RADIUS) * depth * sqrt(depth), error = force / hertz - 1;
    *cells_in_contact = CONTACT / graded(1 / (double)cells);
    print_message(
        "# %2zu^3 cells (%6zu tetrahedra), a = %.2f cells, %3zu nodes touch after %zu rounds: F = %.5f N, Hertz %.5f N,"
        " error %+.2f %%\n",
        cells, s.mesh.tetrahedron_count, *cells_in_contact, touching, rounds, force, hertz, 100 * error);
    free(vertex);
    free(weight);
    free(direction);
    free(contact.gap);
    free(contact.C);
    free(contact.p);
    specimen_free(&s);
    return error;
}

/* The error has three parts, each known beforehand:
 * - linear elements are too stiff by c h^2 in energy, hence in force: halving the cells leaves a quarter;
 * - the walls of the block, fixed at SIDE contact radii where the half-space would move by 4/(3 pi SIDE) of d: the approach
 *   that counts is larger by that part, the force by 1.5 times it: + 0.64 %;
 * - the edge of contact is known to half a cell; the force is stationary in the contact radius, so this costs about
 *   (h / 2a)^2: 0.8 % at 5.7 cells per radius, 3.2 % at 2.8. It scatters and has no sign. */
static void sphere_on_a_block_converges_to_hertz(void **state)
{
    (void)state;
    static const size_t cells[] = {8, 12, 16, 24, 32};
    enum { COARSE = 1, FINE = 3 };
    size_t count = getenv("TROCAR_LONG") ? 5 : 4;
    double error[5], per_radius[5], edge[5];
    for (size_t k = 0; k < count; k++) {
        error[k] = hertz_error(cells[k], &per_radius[k]);
        edge[k] = 0.25 / (per_radius[k] * per_radius[k]);
        assert_true(k == 0 || fabs(error[k]) < fabs(error[k - 1]));
    }
    const double walls = 1.5 * 4 / (3 * 3.14159265358979 * SIDE);
    double bound = fabs(error[COARSE]) / 4 + walls + edge[COARSE] / 4 + edge[FINE];
    double limit = (4 * error[FINE] - error[COARSE]) / 3, scatter = (4 * edge[FINE] + edge[COARSE]) / 3;
    print_message(
        "# finest of the short form: %.2f %%, bound from the trend %.2f %%; extrapolated to no mesh error %+.2f %%, "
        "expected %+.2f +- %.2f %%\n",
        100 * error[FINE], 100 * bound, 100 * limit, 100 * walls, 100 * scatter);
    assert_true(fabs(error[FINE]) < bound);
    assert_true(fabs(limit - walls) < scatter);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {cmocka_unit_test(sphere_on_a_block_converges_to_hertz)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
