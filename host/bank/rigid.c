#include "rigid.h"

#include <lapacke.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

static const double LEVER_MIN = 1e-6; /* of the piece's radius */

/* Union-find with path halving; the loop is bounded by the depth of the forest. */
static uint32_t root(uint32_t *parent, uint32_t n)
{
    while (parent[n] != n) {
        parent[n] = parent[parent[n]];
        n = parent[n];
    }
    return n;
}

struct piece {
    size_t nodes;
    double centre[3], radius;
    double gram[36]; /* sum over supports of the outer product of their rows; column-major, symmetric */
};

struct sentence {
    char text[300];
    size_t used;
    int parts;
};

__attribute__((format(printf, 2, 3))) static void say(struct sentence *out, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int n = vsnprintf(out->text + out->used, sizeof out->text - out->used, format, arguments);
    va_end(arguments);
    if (n > 0)
        out->used = out->used + (size_t)n < sizeof out->text ? out->used + (size_t)n : sizeof out->text - 1;
}

/* "z", or "(0.6, 0.8, 0)". */
static void say_direction(struct sentence *out, const double d[3])
{
    for (int a = 0; a < 3; a++)
        if (fabs(d[a]) > 1 - 1e-9) {
            say(out, "%c", 'x' + a);
            return;
        }
    double c[3], sign = 1;
    for (int a = 2; a >= 0; a--) {
        c[a] = fabs(d[a]) < 1e-9 ? 0 : d[a];
        sign = c[a] != 0 ? copysign(1, c[a]) : sign; /* of the first component that is not zero */
    }
    for (int a = 0; a < 3; a++)
        c[a] = c[a] != 0 ? sign * c[a] : 0;
    say(out, "(%.3g, %.3g, %.3g)", c[0], c[1], c[2]);
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Turn an orthonormal basis of a subspace of space into one that holds every coordinate axis that lies in the subspace,
 * so that the report reads "along z" and not an arbitrary mixture. */
static void prefer_axes(int dimension, double basis[3][3])
{
    double chosen[3][3];
    int count = 0;
    double candidate[6][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    memcpy(candidate[3], basis, (size_t)dimension * sizeof basis[0]);
    for (int i = 0; i < 3 + dimension && count < dimension; i++) {
        double v[3], inside = 0;
        memcpy(v, candidate[i], sizeof v);
        for (int k = 0; k < dimension; k++)
            inside += dot(v, basis[k]) * dot(v, basis[k]);
        if (inside < 1 - 1e-9)
            continue;
        for (int k = 0; k < count; k++) {
            double along = dot(v, chosen[k]);
            for (int a = 0; a < 3; a++)
                v[a] -= along * chosen[k][a];
        }
        double length = sqrt(dot(v, v));
        if (length < 1e-3)
            continue;
        for (int a = 0; a < 3; a++)
            chosen[count][a] = v[a] / length;
        count++;
    }
    if (count == dimension)
        memcpy(basis, chosen, (size_t)dimension * sizeof basis[0]);
}

/* Rotation about w with translation t of the centre (a screw): its axis, and its pitch when it has one. */
static void say_rotation(struct sentence *out, const struct piece *piece, const double w[3], const double t[3])
{
    double point[3] = {w[1] * t[2] - w[2] * t[1], w[2] * t[0] - w[0] * t[2], w[0] * t[1] - w[1] * t[0]};
    for (int a = 0; a < 3; a++) {
        point[a] = piece->centre[a] + piece->radius * point[a];
        if (fabs(point[a]) < 1e-9 * piece->radius)
            point[a] = 0;
    }
    double pitch = dot(w, t) * piece->radius;
    say(out, "%srotation about the ", out->parts++ ? ", " : "");
    say_direction(out, w);
    say(out, " axis through (%.4g, %.4g, %.4g) m", point[0], point[1], point[2]);
    if (fabs(pitch) > LEVER_MIN * piece->radius)
        say(out, " with %.3g m along it per radian", pitch);
}

/* Describe the `k`-dimensional space of free motions: null[6*i..] = translation of the centre, rotation times radius.
 */
static bool describe(const struct piece *piece, int k, const double *null, struct sentence *out)
{
    double rotation[18], singular[3], U[9], V[36], spare[6];
    for (int i = 0; i < k; i++)
        memcpy(rotation + 3 * i, null + 6 * i + 3, 3 * sizeof(double));
    if (LAPACKE_dgesvd(LAPACK_COL_MAJOR, 'A', 'A', 3, k, rotation, 3, singular, U, 3, V, k, spare) != 0)
        return false;
    int rank = 0;
    while (rank < 3 && rank < k && singular[rank] > LEVER_MIN)
        rank++;

    double basis[3][3];
    for (int i = rank; i < k && i < rank + 3; i++) /* pure translations: combinations without rotation */
        for (int a = 0; a < 3; a++) {
            basis[i - rank][a] = 0;
            for (int m = 0; m < k; m++)
                basis[i - rank][a] += V[i + k * m] * null[6 * m + a];
        }
    int translations = k - rank < 3 ? k - rank : 3;
    prefer_axes(translations, basis);
    for (int i = 0; i < translations; i++) {
        say(out, "%stranslation along ", out->parts++ ? ", " : "");
        say_direction(out, basis[i]);
    }

    memcpy(basis, U, (size_t)rank * sizeof basis[0]);
    prefer_axes(rank, basis);
    for (int i = 0; i < rank; i++) { /* the combination of least norm that rotates about basis[i] */
        double t[3] = {0, 0, 0};
        for (int s = 0; s < rank; s++) {
            double part = dot(basis[i], U + 3 * s) / singular[s];
            for (int m = 0; m < k; m++)
                for (int a = 0; a < 3; a++)
                    t[a] += part * V[s + k * m] * null[6 * m + a];
        }
        say_rotation(out, piece, basis[i], t);
    }
    return true;
}

static int judge(const struct piece *piece, size_t number, size_t pieces, const char *place, struct failure *why)
{
    double modes[36], value[6];
    memcpy(modes, piece->gram, sizeof modes);
    if (LAPACKE_dsyev(LAPACK_COL_MAJOR, 'V', 'L', 6, modes, 6, value) != 0)
        return failure_set(why, STATUS_MEMORY, place, NULL, "the supports could not be judged");
    int k = 0;
    while (k < 6 && !(value[k] > LEVER_MIN * LEVER_MIN * value[5]))
        k++;
    if (k == 0)
        return STATUS_OK;
    struct sentence out = {"", 0, 0};
    if (pieces > 1)
        say(&out, "piece %zu of %zu (%zu nodes around (%.3g, %.3g, %.3g) m)", number, pieces, piece->nodes,
            piece->centre[0], piece->centre[1], piece->centre[2]);
    else
        say(&out, "the body");
    if (k == 6)
        say(&out, " is held by nothing: all three translations and all three rotations are free");
    else {
        say(&out, " can still move: ");
        if (!describe(piece, k, modes, &out))
            say(&out, "%d rigid motions", k);
    }
    return failure_set(why, STATUS_MODEL_FREE_MOTION, place,
                       "fix three nodes that are not in line, or the components that hold these motions", "%s",
                       out.text);
}

static void measure(const struct mesh *mesh, const uint32_t *piece_of, size_t count, struct piece *piece)
{
    for (size_t n = 0; n < mesh->node_count; n++) {
        piece[piece_of[n]].nodes++;
        for (int a = 0; a < 3; a++)
            piece[piece_of[n]].centre[a] += mesh->nodes[3 * n + a];
    }
    for (size_t p = 0; p < count; p++)
        for (int a = 0; a < 3; a++)
            piece[p].centre[a] /= (double)piece[p].nodes;
    for (size_t n = 0; n < mesh->node_count; n++) {
        struct piece *own = &piece[piece_of[n]];
        double r[3];
        for (int a = 0; a < 3; a++)
            r[a] = mesh->nodes[3 * n + a] - own->centre[a];
        own->radius = fmax(own->radius, sqrt(dot(r, r)));
    }
}

int rigid_check(const struct mesh *mesh, size_t count, const struct support *support, const char *place,
                struct failure *why)
{
    uint32_t *parent = malloc((mesh->node_count + 1) * sizeof *parent);
    uint32_t *piece_of = malloc((mesh->node_count + 1) * sizeof *piece_of);
    struct piece *piece = NULL;
    int status = STATUS_OK;
    if (!parent || !piece_of)
        goto memory;
    for (size_t n = 0; n < mesh->node_count; n++)
        parent[n] = (uint32_t)n;
    for (size_t t = 0; t < mesh->tetrahedron_count; t++)
        for (int k = 1; k < 4; k++) {
            uint32_t a = root(parent, mesh->tetrahedra[4 * t]), b = root(parent, mesh->tetrahedra[4 * t + (size_t)k]);
            parent[a > b ? a : b] = a > b ? b : a; /* the smallest node is the root: pieces come in node order */
        }
    size_t pieces = 0;
    for (size_t n = 0; n < mesh->node_count; n++) {
        uint32_t r = root(parent, (uint32_t)n);
        piece_of[n] = r == n ? (uint32_t)pieces++ : piece_of[r];
    }
    piece = calloc(pieces + 1, sizeof *piece);
    if (!piece)
        goto memory;
    measure(mesh, piece_of, pieces, piece);
    for (size_t s = 0; s < count; s++) {
        struct piece *own = &piece[piece_of[support[s].node]];
        const double *d = support[s].direction;
        double r[3], row[6];
        for (int a = 0; a < 3; a++) {
            r[a] = own->radius > 0 ? (mesh->nodes[3 * (size_t)support[s].node + a] - own->centre[a]) / own->radius : 0;
            row[a] = d[a];
        }
        for (int a = 0; a < 3; a++) /* d . (w x r) = w . (r x d) */
            row[3 + a] = r[(a + 1) % 3] * d[(a + 2) % 3] - r[(a + 2) % 3] * d[(a + 1) % 3];
        for (int a = 0; a < 6; a++)
            for (int b = 0; b < 6; b++)
                own->gram[a + 6 * b] += row[a] * row[b];
    }
    for (size_t p = 0; p < pieces && status == STATUS_OK; p++)
        status = judge(&piece[p], p + 1, pieces, place, why);
    goto done;
memory:
    status =
        failure_set(why, STATUS_MEMORY, place, NULL, "no memory to judge the supports of %zu nodes", mesh->node_count);
done:
    free(parent);
    free(piece_of);
    free(piece);
    return status;
}
