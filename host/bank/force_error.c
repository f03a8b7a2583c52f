#include "force_error.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_PATCH = 10, MAX_TRIALS = 1000 };

static double uniform(uint64_t *state) /* splitmix64, to [0, 1) */
{
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

struct patch {
    size_t count;
    uint32_t vertex[3 * MAX_PATCH];
    double weight[3 * MAX_PATCH], direction[3 * MAX_PATCH], depth_m[MAX_PATCH];
};

static double distance2(const struct bank_view *bank, uint32_t t, const double *x)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double centre = 0;
        for (int i = 0; i < 3; i++)
            centre += (double)bank->positions[3 * bank->triangles[t].vertex[i] + k] / 3;
        sum += (centre - x[k]) * (centre - x[k]);
    }
    return sum;
}

static bool free_triangle(const struct bank_view *bank, uint32_t t)
{
    const uint16_t *v = bank->triangles[t].vertex;
    return bank->row_of[v[0]] != BANK_NONE && bank->row_of[v[1]] != BANK_NONE && bank->row_of[v[2]] != BANK_NONE;
}

/* The `wanted` free triangles nearest to a random one; one contact at a random place on each. */
static void draw(const struct bank_view *bank, size_t wanted, uint64_t *state, struct patch *patch)
{
    uint32_t near[MAX_PATCH], start = (uint32_t)(uniform(state) * bank->triangle_count);
    double distance[MAX_PATCH], centre[3] = {0};
    for (uint32_t k = 0; k < bank->triangle_count && !free_triangle(bank, start); k++)
        start = (start + 1) % bank->triangle_count;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            centre[k] += (double)bank->positions[3 * bank->triangles[start].vertex[i] + k] / 3;
    size_t found = 0;
    for (uint32_t t = 0; t < bank->triangle_count; t++) {
        double d = distance2(bank, t, centre);
        if (!free_triangle(bank, t) || (found == wanted && d >= distance[found - 1]))
            continue;
        size_t k = found < wanted ? found++ : wanted - 1;
        for (; k > 0 && distance[k - 1] > d; k--) {
            near[k] = near[k - 1];
            distance[k] = distance[k - 1];
        }
        near[k] = t;
        distance[k] = d;
    }
    patch->count = found;
    for (size_t c = 0; c < found; c++) {
        double a = uniform(state), b = uniform(state), length = 0;
        if (a + b > 1) {
            a = 1 - a;
            b = 1 - b;
        }
        double w[3] = {1 - a - b, a, b}, n[3] = {0};
        for (int i = 0; i < 3; i++) {
            patch->vertex[3 * c + i] = bank->triangles[near[c]].vertex[i];
            patch->weight[3 * c + i] = w[i];
            for (int k = 0; k < 3; k++)
                n[k] += w[i] * (double)bank->normals[3 * patch->vertex[3 * c + i] + k];
        }
        for (int k = 0; k < 3; k++)
            length += n[k] * n[k];
        for (int k = 0; k < 3; k++)
            patch->direction[3 * c + k] = -n[k] / sqrt(length);
        patch->depth_m[c] = 1e-3 * (1 + 0.2 * uniform(state));
    }
}

/* n . (sum w w G) n between two contacts of the patch. */
static double coupling(const struct bank_view *bank, const struct patch *p, size_t c, size_t d)
{
    double sum = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            float block[9];
            bank_view_compliance(bank, bank->row_of[p->vertex[3 * c + i]], bank->row_of[p->vertex[3 * d + j]], block);
            for (int e = 0; e < 9; e++)
                sum += p->weight[3 * c + i] * p->weight[3 * d + j] * p->direction[3 * c + e / 3] *
                       p->direction[3 * d + e % 3] * (double)block[e];
        }
    return sum;
}

static int compare(const struct bank_view *bank, struct body *body, const struct patch *patch, double *error,
                   struct failure *why)
{
    size_t m = patch->count;
    double epsilon = (double)bank->contact->regularisation_m_N, A[MAX_PATCH * MAX_PATCH], p[MAX_PATCH],
           direct[MAX_PATCH];
    int status = model_constrained(body->model, m, patch->vertex, patch->weight, patch->direction, epsilon,
                                   patch->depth_m, direct, NULL, why);
    if (status)
        return status;
    for (size_t c = 0; c < m; c++)
        for (size_t d = 0; d < m; d++)
            A[m * c + d] = coupling(bank, patch, c, d) + (c == d ? epsilon : 0);
    memcpy(p, patch->depth_m, m * sizeof *p);
    if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', (int)m, 1, A, (int)m, p, (int)m) != 0)
        return failure_set(why, STATUS_CHECK_FAILED, NULL, NULL,
                           "a contact system of the bank is not positive definite");
    double difference = 0, size = 0;
    for (size_t c = 0; c < m; c++) {
        difference += (p[c] - direct[c]) * (p[c] - direct[c]);
        size += direct[c] * direct[c];
    }
    *error = sqrt(difference / size);
    return STATUS_OK;
}

static int rising(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int force_error_measure(const struct bank_view *bank, struct body *body, size_t trials, uint64_t seed,
                        struct progress *bar, struct force_error *error, struct failure *why)
{
    static const size_t patch_size[4] = {1, 3, 6, MAX_PATCH};
    double found[MAX_TRIALS];
    bool any = false;
    *error = (struct force_error){0};
    for (uint32_t t = 0; t < bank->triangle_count && !any; t++)
        any = free_triangle(bank, t);
    if (!any)
        return failure_set(why, STATUS_SCENE_SELECTION, NULL, "fix fewer nodes",
                           "every surface triangle has a fixed vertex");
    if (trials > MAX_TRIALS)
        trials = MAX_TRIALS;
    for (size_t k = 0; k < trials; k++) {
        struct patch patch;
        if (interrupted())
            return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted while measuring the force error");
        draw(bank, patch_size[k % 4], &seed, &patch);
        int status = compare(bank, body, &patch, &found[k], why);
        if (status)
            return status;
        if (bar)
            progress_show(bar, (double)(k + 1) / (double)trials);
    }
    qsort(found, trials, sizeof found[0], rising);
    error->trials = trials;
    error->max = trials ? found[trials - 1] : 0;
    error->p95 = trials ? found[(size_t)ceil(0.95 * (double)trials) - 1] : 0;
    return STATUS_OK;
}
