/* A small synthetic bank in memory for tests that need one without a finite-element build: an icosphere around the
 * origin whose compliance is a regularised Kelvin solution (a Gram kernel, so every contact system is positive
 * definite), sheared per vertex so that blocks are not symmetric and a forgotten transpose shows. The grid is made by
 * brute force.
 *
 *   size_t length;
 *   unsigned char *bytes = bank_fixture(NULL, &length);      aligned to 64, free() it
 *   bank_view_open(&view, bytes, length) == STATUS_OK
 *
 * To plant faults: bank_fixture_section finds a section's entry, bank_fixture_seal recomputes every checksum. */
#ifndef TROCAR_BANK_FIXTURE_H
#define TROCAR_BANK_FIXTURE_H

#include <malloc.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bank_format.h"
#include "crc.h"
#include "effects/image.h"
#include "shape_seeds.h"

struct bank_fixture_options {
    unsigned subdivisions; /* 0..4: 12, 42, 162, 642, 2562 vertices */
    double radius_m;
    double fixed_share; /* vertices lower than this share of the height are fixed; 0: none */
    double young_Pa;    /* of the kernel */
    double grain_m;     /* regularisation length of the kernel: the radius over which a point load is spread */
    double shear;       /* 0: symmetric blocks */
    unsigned instruments, tip_points;
    double tip_radius_m;
    double friction_mu; /* 0: the bank does not name friction */
    unsigned friction_sweeps;
    double grasp_slip_N;            /* 0: the bank does not name grasping */
    const struct bank_swing *swing; /* with its shapes behind it; NULL: the bank does not name it */
    const struct bank_shape *shape; /* its spheres, openings and band; NULL: the bank does not name it */
    double flatten;                 /* the sphere's height in radii; 0: 1 */
    const struct bank_rigid *rigid; /* with its obstacles behind it; NULL: the bank does not name it */
    const struct bank_tool *tool;   /* the instruments, if not those of fixture_tool */
    unsigned branches;              /* 0: the bank does not name viscoelastic */
    struct bank_branch branch[BANK_MAX_BRANCHES];
    const struct bank_cubic *cubic;            /* per vertex; NULL: the bank does not name neo_hookean */
    const struct bank_quasi_nonlinear *curves; /* NULL: the bank does not name quasi_nonlinear */
};

static const struct bank_fixture_options bank_fixture_default = {.subdivisions = 2,
                                                                 .radius_m = 0.05,
                                                                 .fixed_share = 0.15,
                                                                 .young_Pa = 4000,
                                                                 .grain_m = 0.01,
                                                                 .shear = 0.05,
                                                                 .instruments = 1,
                                                                 .tip_points = 7,
                                                                 .tip_radius_m = 0.005,
                                                                 .friction_sweeps = 10};

struct fixture_surface {
    unsigned vertices, triangles;
    double (*x)[3]; /* unit sphere */
    unsigned (*t)[3];
};

static inline unsigned fixture_vertex(struct fixture_surface *s, double x, double y, double z)
{
    double r = sqrt(x * x + y * y + z * z);
    for (unsigned v = 0; v < s->vertices; v++)
        if (fabs(s->x[v][0] - x / r) + fabs(s->x[v][1] - y / r) + fabs(s->x[v][2] - z / r) < 1e-9)
            return v;
    s->x[s->vertices][0] = x / r;
    s->x[s->vertices][1] = y / r;
    s->x[s->vertices][2] = z / r;
    return s->vertices++;
}

static inline unsigned fixture_middle(struct fixture_surface *s, unsigned a, unsigned b)
{
    return fixture_vertex(s, s->x[a][0] + s->x[b][0], s->x[a][1] + s->x[b][1], s->x[a][2] + s->x[b][2]);
}

static inline void fixture_icosphere(struct fixture_surface *s, unsigned subdivisions)
{
    static const unsigned face[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                         {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                         {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                         {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    unsigned most = 20u << (2 * subdivisions);
    double g = (1 + sqrt(5)) / 2;
    double corner[12][3] = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                            {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    *s = (struct fixture_surface){.x = calloc(most, sizeof *s->x), .t = calloc(most, sizeof *s->t)};
    for (int v = 0; v < 12; v++)
        fixture_vertex(s, corner[v][0], corner[v][1], corner[v][2]);
    memcpy(s->t, face, sizeof face);
    s->triangles = 20;
    for (unsigned level = 0; level < subdivisions; level++) {
        unsigned count = s->triangles;
        for (unsigned f = 0; f < count; f++) {
            unsigned a = s->t[f][0], b = s->t[f][1], c = s->t[f][2];
            unsigned ab = fixture_middle(s, a, b), bc = fixture_middle(s, b, c), ca = fixture_middle(s, c, a);
            unsigned child[4][3] = {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}};
            memcpy(s->t[f], child[0], sizeof child[0]);
            memcpy(s->t[s->triangles], child[1], 3 * sizeof child[0]);
            s->triangles += 3;
        }
    }
}

/* Block (i,j) of the kernel; see Goes and James, Regularized Kelvinlets (2017), eq. 6: Fourier transform positive. */
static inline void fixture_kernel(const struct bank_fixture_options *o, const double *x, const double *y,
                                  double g[3][3])
{
    double nu = 0.45, mu = o->young_Pa / (2 * (1 + nu)), a = 1 / (4 * 3.14159265358979 * mu), b = a / (4 * (1 - nu));
    double d[3] = {o->radius_m * (x[0] - y[0]), o->radius_m * (x[1] - y[1]), o->radius_m * (x[2] - y[2])};
    double e2 = o->grain_m * o->grain_m, r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + e2);
    double k[3][3], m[2][3][3];
    for (int p = 0; p < 3; p++)
        for (int q = 0; q < 3; q++) {
            k[p][q] = b * d[p] * d[q] / (r * r * r) + (p == q) * ((a - b) / r + a * e2 / (2 * r * r * r));
            m[0][p][q] = m[1][p][q] = p == q;
        }
    for (int side = 0; side < 2; side++) { /* M_i = I + shear [x_i]x: a congruence keeps positive definiteness */
        const double *n = side ? y : x;
        m[side][0][1] -= o->shear * n[2], m[side][1][0] += o->shear * n[2];
        m[side][0][2] += o->shear * n[1], m[side][2][0] -= o->shear * n[1];
        m[side][1][2] -= o->shear * n[0], m[side][2][1] += o->shear * n[0];
    }
    for (int p = 0; p < 3; p++)
        for (int q = 0; q < 3; q++) {
            g[p][q] = 0;
            for (int u = 0; u < 3; u++)
                for (int v = 0; v < 3; v++)
                    g[p][q] += m[0][p][u] * k[u][v] * m[1][q][v];
        }
}

static inline struct bank_tool fixture_tool(const struct bank_fixture_options *o, unsigned index)
{
    struct bank_tool t = {.trocar_m = {index * 0.02f, 0, (float)o->radius_m + 0.12f},
                          .rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1}, /* Z down, into the body */
                          .gravity_N = 0.5f,
                          .gravity_arm_m = 0.05f,
                          .gravity_direction = {0, 0, -1},
                          .tip_radius_m = (float)o->tip_radius_m,
                          .point_count = o->tip_points};
    for (int k = 0; k < 2; k++)
        t.axis[k] = (struct bank_axis){.per_count = 1.2e-4f,
                                       .zero = 0,
                                       .count_zero = 8192,
                                       .count_modulus = 16384,
                                       .minimum = -0.5235988f,
                                       .maximum = 0.5235988f,
                                       .speed_limit = 30,
                                       .effort_limit = 2};
    t.axis[2] = (struct bank_axis){.per_count = 2.3e-5f,
                                   .zero = 0.115f,
                                   .count_zero = 8192,
                                   .count_modulus = 16384,
                                   .minimum = 0.05f,
                                   .maximum = 0.2f,
                                   .speed_limit = 12,
                                   .effort_limit = 8.9f};
    for (unsigned p = 1; p < o->tip_points; p++) { /* the pole of the tip, then a ring around it */
        double angle = 2 * 3.14159265358979 * (p - 1) / (o->tip_points - 1);
        t.point_m[p][0] = (float)(o->tip_radius_m * 0.8 * cos(angle));
        t.point_m[p][1] = (float)(o->tip_radius_m * 0.8 * sin(angle));
        t.point_m[p][2] = (float)(o->tip_radius_m * 0.6);
    }
    t.point_m[0][2] = (float)o->tip_radius_m;
    return t;
}

/* One section before it is placed. */
struct fixture_part {
    uint32_t tag, flags, version, count, length;
    void *data;
};

/* Recompute the checksums of every section whose bytes lie inside the file, of the table and of the header. */
static inline void bank_fixture_seal(unsigned char *bytes, size_t length)
{
    struct bank_header *h = (struct bank_header *)bytes;
    struct bank_section *table = (struct bank_section *)(h + 1);
    size_t most = (length - sizeof *h) / sizeof *table, count = h->section_count < most ? h->section_count : most;
    for (size_t k = 0; k < count; k++) {
        uint64_t room = ((uint64_t)table[k].length + 15) / 16 * 16;
        if (table[k].offset + room <= length)
            table[k].crc = crc32_update(0, bytes + table[k].offset, room);
    }
    h->table_crc = crc32_update(0, table, count * sizeof *table);
    h->header_crc = crc32_update(0, h, sizeof *h - 4);
}

static inline struct bank_section *bank_fixture_section(unsigned char *bytes, uint32_t tag)
{
    struct bank_header *h = (struct bank_header *)bytes;
    struct bank_section *table = (struct bank_section *)(h + 1);
    for (uint32_t k = 0; k < h->section_count; k++)
        if (table[k].tag == tag)
            return &table[k];
    return NULL;
}

/* Aligned memory of exactly `length` bytes, so that a sanitizer sees a read of the next. */
static inline unsigned char *bank_fixture_memory(size_t length)
{
    unsigned char *bytes = memalign(64, length ? length : 1);
    if (!bytes)
        abort();
    memset(bytes, 0, length);
    return bytes;
}

/* Sections one after the other, sealed. */
static inline unsigned char *bank_fixture_join(const struct fixture_part *part, unsigned count, size_t *length)
{
    size_t total = sizeof(struct bank_header) + count * sizeof(struct bank_section), at = total;
    for (unsigned k = 0; k < count; k++)
        total += (part[k].length + 15) / 16 * 16;
    unsigned char *bytes = bank_fixture_memory(total);
    struct bank_header *h = (struct bank_header *)bytes;
    *h = (struct bank_header){.magic = BANK_MAGIC,
                              .format_version = BANK_FORMAT_VERSION,
                              .header_bytes = sizeof *h,
                              .total_bytes = (uint32_t)total,
                              .section_count = count,
                              .image_abi = 1};
    struct bank_section *table = (struct bank_section *)(h + 1);
    for (unsigned k = 0; k < count; k++) {
        table[k] = (struct bank_section){.tag = part[k].tag,
                                         .version = (uint16_t)part[k].version,
                                         .flags = (uint16_t)part[k].flags,
                                         .offset = (uint32_t)at,
                                         .length = part[k].length,
                                         .count = part[k].count};
        memcpy(bytes + at, part[k].data, part[k].length);
        at += (part[k].length + 15) / 16 * 16;
    }
    bank_fixture_seal(bytes, total);
    *length = total;
    return bytes;
}

/* Cells of twice the mean edge; a triangle is listed wherever its enlarged box reaches. */
static inline struct fixture_part fixture_grid(const float (*x)[3], const struct bank_triangle *t, unsigned triangles,
                                               double radius_m)
{
    double cell = 2 * sqrt(4 * 12.566 * radius_m * radius_m / (triangles * sqrt(3.0)));
    unsigned n = (unsigned)ceil(2.02 * radius_m / cell), cells = n * n * n, most = 255 * cells;
    unsigned char *data =
        calloc(1, sizeof(struct bank_grid) + 4 * (cells / 32 + 1) + 2 * (cells + 1) + 2 * (size_t)most);
    struct bank_grid *g = (struct bank_grid *)data;
    uint32_t *base = (uint32_t *)(g + 1), entries = 0, first;
    uint16_t *start = (uint16_t *)(base + cells / 32 + 1), *entry = start + cells + 1;
    *g = (struct bank_grid){.cell_m = (float)cell, .cells = {(uint16_t)n, (uint16_t)n, (uint16_t)n}};
    for (int k = 0; k < 3; k++)
        g->origin_m[k] = (float)(-0.5 * n * cell);
    for (unsigned c = 0; c < cells; c++) {
        unsigned index[3] = {c % n, c / n % n, c / n / n};
        if (c % 32 == 0)
            base[c / 32] = entries;
        first = entries;
        start[c] = (uint16_t)(entries - base[c / 32]);
        for (unsigned f = 0; f < triangles; f++) {
            bool meets = true;
            for (int k = 0; k < 3; k++) {
                double a = x[t[f].vertex[0]][k], b = x[t[f].vertex[1]][k], d = x[t[f].vertex[2]][k];
                double low = g->origin_m[k] + (index[k] - 1e-3) * cell, high = low + 1.002 * cell;
                meets = meets && fmax(a, fmax(b, d)) >= low && fmin(a, fmin(b, d)) <= high;
            }
            if (meets)
                entry[entries++] = (uint16_t)f;
        }
        if (entries - first > g->max_in_cell)
            g->max_in_cell = (uint16_t)(entries - first);
    }
    if (cells % 32 == 0)
        base[cells / 32] = entries;
    start[cells] = (uint16_t)(entries - base[cells / 32]);
    g->entries = entries;
    return (struct fixture_part){BANK_GRID,
                                 BANK_REQUIRED,
                                 2,
                                 cells,
                                 (uint32_t)(sizeof *g + 4 * (cells / 32 + 1) + 2 * (cells + 1) + 2 * (size_t)entries),
                                 data};
}

static inline struct fixture_part fixture_compliance(const struct bank_fixture_options *o, double (*x)[3],
                                                     const uint16_t *row_of, unsigned vertices, unsigned rows)
{
    size_t blocks = (size_t)rows * (rows + 1) / 2;
    float *half = malloc(blocks * 9 * sizeof *half);
    for (unsigned v = 0; v < vertices; v++)
        for (unsigned w = 0; w < vertices; w++) {
            double g[3][3];
            if (row_of[v] == BANK_NONE || row_of[w] == BANK_NONE || row_of[w] > row_of[v])
                continue;
            fixture_kernel(o, x[v], x[w], g);
            for (int k = 0; k < 9; k++)
                half[9 * ((size_t)row_of[v] * (row_of[v] + 1u) / 2 + row_of[w]) + k] = (float)g[k / 3][k % 3];
        }
    return (struct fixture_part){BANK_GHLF, BANK_REQUIRED, 1, rows, (uint32_t)(blocks * 36), half};
}

static inline struct fixture_part fixture_shape(const struct bank_shape *given, const float (*x)[3], unsigned vertices,
                                                const unsigned (*t)[3], unsigned triangles)
{
    struct bank_shape shape = *given;
    struct failure why;
    uint16_t *seed;
    double *positions = malloc(3 * sizeof *positions * vertices);
    for (unsigned i = 0; i < 3 * vertices; i++)
        positions[i] = (double)x[i / 3][i % 3];
    if (shape_seeds(vertices, positions, triangles, &t[0][0], &shape, &seed, &why))
        abort();
    uint32_t cells = (uint32_t)shape.cells[0] * shape.cells[1] * shape.cells[2];
    unsigned char *bytes = malloc(sizeof shape + 4 * (size_t)cells);
    memcpy(bytes, &shape, sizeof shape);
    memcpy(bytes + sizeof shape, seed, 4 * (size_t)cells);
    free(positions), free(seed);
    return (struct fixture_part){BANK_SHAP, BANK_REQUIRED, 1, cells, (uint32_t)sizeof shape + 4 * cells, bytes};
}

/* `options` NULL: bank_fixture_default. The rows are numbered in reverse vertex order, so that row and vertex differ.
 */
static inline unsigned char *bank_fixture(const struct bank_fixture_options *options, size_t *length)
{
    const struct bank_fixture_options *o = options ? options : &bank_fixture_default;
    struct fixture_surface s;
    fixture_icosphere(&s, o->subdivisions);
    unsigned n = s.vertices, m = s.triangles, rows = 0;
    float(*x)[3] = calloc(n, sizeof *x), (*normal)[3] = calloc(n, sizeof *normal);
    uint16_t *row_of = malloc(n * sizeof *row_of);
    for (unsigned v = n; v-- > 0;) {
        row_of[v] = s.x[v][2] < 2 * o->fixed_share - 1 ? BANK_NONE : (uint16_t)rows++;
        for (int k = 0; k < 3; k++) {
            x[v][k] = (float)(o->radius_m * s.x[v][k]);
            normal[v][k] = (float)s.x[v][k];
        }
        if (o->flatten > 0) { /* of an ellipsoid */
            double z = s.x[v][2] / o->flatten, size = sqrt(1 - s.x[v][2] * s.x[v][2] + z * z);
            x[v][2] *= (float)o->flatten;
            for (int k = 0; k < 3; k++)
                normal[v][k] = (float)((k < 2 ? s.x[v][k] : z) / size);
        }
    }
    struct bank_triangle *t = calloc(m, sizeof *t);
    for (unsigned f = 0; f < m; f++)
        for (int k = 0; k < 3; k++)
            t[f].vertex[k] = (uint16_t)s.t[f][k];
    for (unsigned f = 0; f < m; f++)
        for (unsigned g = 0; g < m; g++)
            for (int k = 0; k < 9; k++)
                if (t[f].vertex[(k + 1) % 3] == t[g].vertex[(k / 3 + 2) % 3] &&
                    t[f].vertex[(k + 2) % 3] == t[g].vertex[(k / 3 + 1) % 3])
                    t[f].neighbour[k % 3] = (uint16_t)g;
    struct fixture_part half = fixture_compliance(o, s.x, row_of, n, rows);
    double typical = ((float *)half.data)[0];
    struct bank_contact contact = {.regularisation_m_N = (float)(1e-3 * typical),
                                   .coupling_stiffness_N_m = 1000,
                                   .coupling_damping_Ns_m = 1,
                                   .force_limit_N = 8.9f,
                                   .force_rate_N_s = 2000,
                                   .decay_s = 0.02f,
                                   .typical_compliance_m_N = (float)typical};
    struct bank_tool tool[BANK_MAX_INSTRUMENTS] = {fixture_tool(o, 0), fixture_tool(o, 1)};
    if (o->tool)
        memcpy(tool, o->tool, o->instruments * sizeof tool[0]);
    struct bank_friction friction = {.mu = (float)o->friction_mu, .sweeps = o->friction_sweeps};
    struct fixture_part part[] = {
        {BANK_VERT, BANK_REQUIRED, 1, n, n * 12, x},
        {BANK_NORM, BANK_REQUIRED, 1, n, n * 12, normal},
        {BANK_TRIA, BANK_REQUIRED, 1, m, m * (uint32_t)sizeof *t, t},
        fixture_grid(x, t, m, o->radius_m),
        {BANK_ROWS, BANK_REQUIRED, 1, n, n * 2, row_of},
        half,
        {BANK_CONT, BANK_REQUIRED, 1, 1, sizeof contact, &contact},
        {BANK_TOOL, BANK_REQUIRED, 1, o->instruments, o->instruments * (uint32_t)sizeof tool[0], tool},
        {0}, /* effects, one after the other */
        {0},
        {0},
        {0},
        {0},
        {0},
        {0},
    };
    uint32_t parts = 8, effects = 0;
    struct bank_viscoelastic *visco = calloc(1, sizeof *visco + sizeof o->branch);
    *visco = (struct bank_viscoelastic){.branches = o->branches, .reach_m = (float)o->tip_radius_m};
    memcpy(visco->branch, o->branch, sizeof o->branch);
    struct bank_second second = {.points = {tool[0].point_count, tool[1].point_count}};
    if (o->instruments == 2) {
        part[parts++] = (struct fixture_part){BANK_SCND, BANK_REQUIRED, 1, 1, sizeof second, &second};
        effects |= EFFECT_SECOND;
    }
    if (o->friction_mu > 0) {
        part[parts++] = (struct fixture_part){BANK_FRIC, BANK_REQUIRED, 1, 1, sizeof friction, &friction};
        effects |= EFFECT_FRICTION;
    }
    struct bank_grasp grasp = {.close_count = 38, .open_count = 25, .slip_N = (float)o->grasp_slip_N, .sweeps = 20};
    if (o->grasp_slip_N > 0) {
        part[parts++] = (struct fixture_part){BANK_GRSP, BANK_REQUIRED, 1, 1, sizeof grasp, &grasp};
        effects |= EFFECT_GRASP;
    }
    if (o->swing) {
        uint32_t size = (uint32_t)sizeof *o->swing + o->swing->modes * n * 12;
        part[parts++] = (struct fixture_part){BANK_SWNG, BANK_REQUIRED, 1, o->swing->modes, size, (void *)o->swing};
        effects |= EFFECT_SWING;
    }
    struct fixture_part shape = {0};
    if (o->shape) {
        shape = part[parts++] = fixture_shape(o->shape, (const float(*)[3])x, n, (const unsigned(*)[3])s.t, m);
        effects |= EFFECT_SHAPE;
    }
    if (o->branches) {
        part[parts++] = (struct fixture_part){BANK_VISC, BANK_REQUIRED, 1, o->branches, 16 + 16 * o->branches, visco};
        effects |= EFFECT_VISCOELASTIC;
    }
    if (o->curves) {
        part[parts++] = (struct fixture_part){BANK_QNLC, BANK_REQUIRED, 1, 1, sizeof *o->curves, (void *)o->curves};
        effects |= EFFECT_QUASI_NONLINEAR;
    }
    struct bank_neo_hookean *neo = calloc(1, sizeof *neo + n * sizeof neo->vertex[0]);
    neo->radius_m = (float)o->tip_radius_m;
    if (o->cubic) {
        uint32_t size = (uint32_t)(sizeof *neo + n * sizeof neo->vertex[0]);
        memcpy(neo->vertex, o->cubic, n * sizeof neo->vertex[0]);
        part[parts++] = (struct fixture_part){BANK_NEOH, BANK_REQUIRED, 1, n, size, neo};
        effects |= EFFECT_NEO_HOOKEAN;
    }
    if (o->rigid) {
        uint32_t size = (uint32_t)(sizeof *o->rigid + o->rigid->obstacles * sizeof(struct bank_obstacle));
        part[parts++] = (struct fixture_part){BANK_RIGD, BANK_REQUIRED, 1, o->rigid->obstacles, size, (void *)o->rigid};
        effects |= EFFECT_RIGID;
    }
    unsigned char *bytes = bank_fixture_join(part, parts, length);
    ((struct bank_header *)bytes)->effects = effects;
    bank_fixture_seal(bytes, *length);
    free(part[3].data), free(half.data), free(shape.data), free(visco), free(neo), free(row_of), free(t), free(normal),
        free(x), free(s.x), free(s.t);
    return bytes;
}

#endif
