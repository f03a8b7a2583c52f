#include "second_order_surface.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "order.h"
#include "patch.h"

enum { NEAREST = 6 };               /* solved sites that an interpolated one takes */
static const double EPSILON = 1e-9; /* m/N: nothing beside a tool's compliance, some 1e-3 and more */
static const double HELD = 0.5;     /* share of the tool on fixed vertices, above which it has no answer */
static const double FACING = 0.3;   /* cosine between normals below which sites are around an edge */

/* The rows of tools, three each. */
struct tools {
    struct nonlinear_rows rows;
    size_t *start, room;
    uint32_t *vertex;
    double *weight, *direction;
};

static void tools_free(struct tools *t)
{
    free(t->start);
    free(t->vertex);
    free(t->weight);
    free(t->direction);
}

static bool tools_add(struct tools *t, const struct patch *patch)
{
    size_t entries = t->start[t->rows.count];
    if (entries + 3 * patch->count > t->room) {
        size_t room = 2 * (entries + 3 * patch->count);
        void *larger = realloc(t->vertex, room * sizeof *t->vertex);
        if (!larger)
            return false;
        t->vertex = larger;
        larger = realloc(t->weight, room * sizeof *t->weight);
        if (!larger)
            return false;
        t->weight = larger;
        t->room = room;
    }
    for (size_t a = 0; a < 3; a++) {
        memcpy(t->vertex + entries, patch->vertex, patch->count * sizeof *patch->vertex);
        memcpy(t->weight + entries, patch->weight, patch->count * sizeof *patch->weight);
        entries += patch->count;
        t->direction[3 * t->rows.count + a] = 1;
        t->start[++t->rows.count] = entries;
    }
    return true;
}

/* The tool around each vertex that it is not held at; site[v] its number, or UINT32_MAX. */
static int place_tools(const struct model *model, const struct mesh *mesh, const struct surface *surface,
                       double radius_m, const bool *wanted, struct tools *t, uint32_t *site, struct failure *why)
{
    const bool *fixed = model_fixed_vertices(model);
    size_t most = surface->vertex_count;
    *t = (struct tools){.start = calloc(3 * most + 1, sizeof *t->start),
                        .direction = calloc(9 * most + 1, sizeof *t->direction)};
    if (!t->start || !t->direction)
        return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu tools", most);
    memset(site, 0xFF, most * sizeof *site);
    for (size_t i = 0; i < 3 * surface->triangle_count; i++) {
        uint32_t v = surface->triangles[i];
        if (site[v] != UINT32_MAX || !wanted[v] || fixed[v])
            continue;
        double at[3] = {0}, held = 0;
        struct patch patch;
        at[i % 3] = 1;
        int status = patch_create(mesh, surface, (uint32_t)(i / 3), at, radius_m, &patch, why);
        if (status)
            return status;
        for (size_t k = 0; k < patch.count; k++)
            held += fixed[patch.vertex[k]] ? patch.weight[k] : 0;
        bool good = true;
        if (held <= HELD) {
            site[v] = (uint32_t)(t->rows.count / 3);
            good = tools_add(t, &patch);
        }
        patch_free(&patch);
        if (!good)
            return failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for the tools");
    }
    t->rows = (struct nonlinear_rows){t->rows.count, t->start, t->vertex, t->weight, t->direction};
    if (t->rows.count == 0)
        return failure_set(why, STATUS_SCENE_SELECTION, mesh->path, "fix fewer vertices, or take a smaller tool",
                           "a tool of %g m finds no place that is free to move", radius_m);
    return STATUS_OK;
}

/* The `sites` vertices that cover the free surface best. */
static int choose(const struct model *model, const struct mesh *mesh, const struct surface *surface, size_t sites,
                  bool *wanted, struct failure *why)
{
    const bool *fixed = model_fixed_vertices(model);
    size_t n = surface->vertex_count, count = 0;
    uint32_t *vertex = malloc((n + 1) * sizeof *vertex);
    double *x = malloc((3 * n + 1) * sizeof *x);
    struct order order = {0};
    int status = STATUS_OK;
    if (!vertex || !x)
        status = failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu vertices", n);
    for (size_t v = 0; v < n && !status; v++)
        if (!fixed[v]) {
            memcpy(x + 3 * count, mesh->nodes + 3 * (size_t)surface->node[v], 3 * sizeof *x);
            vertex[count++] = (uint32_t)v;
        }
    bool all = !sites || sites >= count;
    if (!status && !all)
        status = order_maximin(count, x, &order, why);
    for (size_t k = 0; k < (all ? count : sites) && !status; k++)
        wanted[vertex[all ? k : order.at[k]]] = true;
    order_free(&order);
    free(vertex);
    free(x);
    return status;
}

struct near {
    uint32_t vertex;
    double distance2;
};

/* The solved sites nearest to v, farther ones that face another way not at all. */
static size_t nearest(const struct mesh *mesh, const struct surface *surface, const uint32_t *site, size_t v,
                      struct near near[NEAREST])
{
    const double *x = mesh->nodes + 3 * (size_t)surface->node[v], *n = surface->normals + 3 * v;
    size_t count = 0;
    for (size_t w = 0; w < surface->vertex_count; w++) {
        const double *y = mesh->nodes + 3 * (size_t)surface->node[w], *m = surface->normals + 3 * w;
        double facing = n[0] * m[0] + n[1] * m[1] + n[2] * m[2], d2 = 0;
        if (site[w] == UINT32_MAX || facing < FACING)
            continue;
        for (int a = 0; a < 3; a++)
            d2 += (x[a] - y[a]) * (x[a] - y[a]);
        d2 /= facing * facing;
        if (count == NEAREST && d2 >= near[NEAREST - 1].distance2)
            continue;
        size_t k = count < NEAREST ? count++ : NEAREST - 1;
        for (; k > 0 && near[k - 1].distance2 > d2; k--)
            near[k] = near[k - 1];
        near[k] = (struct near){(uint32_t)w, d2};
    }
    return count;
}

static void interpolate(const struct mesh *mesh, const struct surface *surface, const uint32_t *site, size_t v,
                        struct second_order_surface *found)
{
    struct near near[NEAREST];
    size_t count = nearest(mesh, surface, site, v, near);
    double sum = 0;
    found->range_J[v] = 0;
    for (size_t k = 0; k < count; k++) {
        double weight = 1 / near[k].distance2;
        for (int i = 0; i < SECOND_ORDER_TERMS; i++)
            found->cubic[v][i] += weight * found->cubic[near[k].vertex][i];
        found->range_J[v] += weight * found->range_J[near[k].vertex];
        sum += weight;
    }
    for (int i = 0; i < SECOND_ORDER_TERMS && sum > 0; i++)
        found->cubic[v][i] /= sum;
    found->range_J[v] = sum > 0 ? found->range_J[v] / sum : 0;
}

/* T as a form of the linear force: of C f, C = A^-1. */
static void by_force(const struct second_order *solved, double cubic[SECOND_ORDER_TERMS])
{
    double C[9];
    memcpy(C, solved->A, sizeof C);
    if (LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', 3, C, 3) || LAPACKE_dpotri(LAPACK_ROW_MAJOR, 'L', 3, C, 3))
        memset(C, 0, sizeof C); /* cannot be: A is the inverse of a positive definite matrix */
    for (int a = 0; a < 3; a++)
        for (int b = a + 1; b < 3; b++)
            C[3 * a + b] = C[3 * b + a];
    second_order_map(solved, C, cubic);
}

static int spread(const struct model *model, const struct mesh *mesh, const struct surface *surface, const bool *wanted,
                  const uint32_t *site, const struct second_order *solved, struct second_order_surface *found,
                  struct failure *why)
{
    const bool *fixed = model_fixed_vertices(model);
    double largest = 0;
    for (size_t v = 0; v < found->vertices; v++)
        if (site[v] != UINT32_MAX) {
            by_force(&solved[site[v]], found->cubic[v]);
            found->range_J[v] = fmin(second_order_range_J(&solved[site[v]]), (double)BANK_MAX_RANGE_J);
            largest = fmax(largest, found->range_J[v]);
        }
    for (size_t v = 0; v < found->vertices; v++)
        if (!wanted[v] && !fixed[v]) {
            if (interrupted())
                return failure_set(why, STATUS_INTERRUPTED, NULL, NULL, "interrupted between the solved sites");
            interpolate(mesh, surface, site, v, found);
        }
    for (size_t v = 0; v < found->vertices; v++)
        if (!(found->range_J[v] > 0))
            found->range_J[v] = largest;
    return STATUS_OK;
}

int second_order_surface_find(struct model *model, const struct mesh *mesh, const struct surface *surface,
                              double radius_m, size_t sites, bool quiet, struct second_order_surface *found,
                              struct failure *why)
{
    size_t n = surface->vertex_count;
    struct tools tools = {0};
    struct second_order *solved = NULL;
    bool *wanted = calloc(n + 1, sizeof *wanted);
    uint32_t *site = malloc((n + 1) * sizeof *site);
    *found = (struct second_order_surface){
        .vertices = n, .cubic = calloc(n + 1, sizeof *found->cubic), .range_J = calloc(n + 1, sizeof *found->range_J)};
    int status = STATUS_OK;
    if (!wanted || !site || !found->cubic || !found->range_J)
        status = failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu vertices", n);
    if (!status)
        status = choose(model, mesh, surface, sites, wanted, why);
    if (!status)
        status = place_tools(model, mesh, surface, radius_m, wanted, &tools, site, why);
    found->solved = tools.rows.count / 3;
    if (!status && !(solved = malloc(found->solved * sizeof *solved)))
        status = failure_set(why, STATUS_MEMORY, mesh->path, NULL, "no memory for %zu tools", found->solved);
    if (!status)
        status = second_order_find(model, found->solved, &tools.rows, EPSILON, solved, quiet, why);
    if (!status)
        status = spread(model, mesh, surface, wanted, site, solved, found, why);
    tools_free(&tools);
    free(solved);
    free(wanted);
    free(site);
    if (status)
        second_order_surface_free(found);
    return status;
}

void second_order_surface_free(struct second_order_surface *found)
{
    free(found->cubic);
    free(found->range_J);
    *found = (struct second_order_surface){0};
}
