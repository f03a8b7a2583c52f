#include "bank_check.h"

#include <float.h>
#include <stdbool.h>

#include "row_code.h"
#include "row.h"

enum { ROW_WINDOW = 8192 }; /* rows whose "seen" bits are held at a time: 1 KiB of stack */

static const float unit_tolerance =
    1e-3f; /* on the square of a length and on scalar products; float32 rounds at 1e-7 */

static int fault(struct bank_view *view, int status, uint32_t tag, uint32_t record)
{
    view->fault_tag = tag;
    view->fault_record = record;
    return status;
}

/* False for NaN too. */
static bool within(float x, float low, float high)
{
    return x >= low && x <= high;
}

static bool finite(float x)
{
    return within(x, -FLT_MAX, FLT_MAX);
}

static bool positive(float x)
{
    return x > 0 && x <= FLT_MAX;
}

static float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static bool is_unit(const float a[3])
{
    return within(dot(a, a), 1 - unit_tolerance, 1 + unit_tolerance);
}

static int check_vertices(struct bank_view *view)
{
    for (uint32_t v = 0; v < view->vertex_count; v++) { /* bound: BANK_MAX_VERTICES */
        for (int k = 0; k < 3; k++)                     /* bound: 3 */
            if (!within(view->positions[3 * v + k], -BANK_MAX_POSITION_M, BANK_MAX_POSITION_M))
                return fault(view, STATUS_BANK_NONFINITE, BANK_VERT, v);
        if (!is_unit(&view->normals[3 * v]))
            return fault(view, STATUS_BANK_NONFINITE, BANK_NORM, v);
    }
    return STATUS_OK;
}

/* The neighbour across edge k has the same edge the other way round, and this triangle across it. */
static bool neighbours_agree(const struct bank_view *view, uint32_t t, int k)
{
    const struct bank_triangle *here = &view->triangles[t], *there = &view->triangles[here->neighbour[k]];
    uint16_t first = here->vertex[(k + 1) % 3], second = here->vertex[(k + 2) % 3];
    for (int j = 0; j < 3; j++) /* bound: 3 */
        if (there->vertex[(j + 1) % 3] == second && there->vertex[(j + 2) % 3] == first && there->neighbour[j] == t)
            return true;
    return false;
}

static bool has_area(const struct bank_view *view, const struct bank_triangle *t)
{
    const float *a = &view->positions[3 * t->vertex[0]], *b = &view->positions[3 * t->vertex[1]],
                *c = &view->positions[3 * t->vertex[2]];
    float u[3], v[3];
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        u[k] = b[k] - a[k];
        v[k] = c[k] - a[k];
    }
    return u[1] * v[2] != u[2] * v[1] || u[2] * v[0] != u[0] * v[2] || u[0] * v[1] != u[1] * v[0];
}

static int check_triangles(struct bank_view *view)
{
    for (uint32_t t = 0; t < view->triangle_count; t++) { /* bound: BANK_MAX_TRIANGLES */
        const struct bank_triangle *triangle = &view->triangles[t];
        for (int k = 0; k < 3; k++) { /* bound: 3 */
            if (triangle->vertex[k] >= view->vertex_count || triangle->vertex[k] == triangle->vertex[(k + 1) % 3])
                return fault(view, STATUS_BANK_INDEX, BANK_TRIA, t);
            if (triangle->neighbour[k] >= view->triangle_count || triangle->neighbour[k] == t)
                return fault(view, STATUS_BANK_INDEX, BANK_TRIA, t);
        }
    }
    for (uint32_t t = 0; t < view->triangle_count; t++) { /* bound: BANK_MAX_TRIANGLES */
        for (int k = 0; k < 3; k++)                       /* bound: 3 */
            if (!neighbours_agree(view, t, k))
                return fault(view, STATUS_BANK_INDEX, BANK_TRIA, t);
        if (!has_area(view, &view->triangles[t]))
            return fault(view, STATUS_BANK_NONFINITE, BANK_TRIA, t);
    }
    return STATUS_OK;
}

static int check_cells(struct bank_view *view)
{
    const struct bank_grid *g = view->grid;
    uint32_t cells = (uint32_t)g->cells[0] * g->cells[1] * g->cells[2], longest = 0;
    if (bank_view_cell_start(view, 0) != 0)
        return fault(view, STATUS_BANK_INDEX, BANK_GRID, 0);
    for (uint32_t c = 0; c < cells; c++) { /* bound: BANK_MAX_GRID_CELLS */
        uint32_t start = bank_view_cell_start(view, c), end = bank_view_cell_start(view, c + 1);
        if (end < start || end > g->entries || end - start > BANK_MAX_CELL_TRIANGLES)
            return fault(view, STATUS_BANK_INDEX, BANK_GRID, c);
        for (uint32_t e = start; e < end; e++) { /* bound: BANK_MAX_CELL_TRIANGLES */
            uint16_t t = view->cell_triangle[e];
            if (t >= view->triangle_count || (e > start && t <= view->cell_triangle[e - 1]))
                return fault(view, STATUS_BANK_INDEX, BANK_GRID, c);
        }
        if (end - start > longest)
            longest = end - start;
    }
    if (bank_view_cell_start(view, cells) != g->entries || longest != g->max_in_cell)
        return fault(view, STATUS_BANK_INDEX, BANK_GRID, cells);
    return STATUS_OK;
}

/* The cell that holds a point inside the grid. */
static uint32_t cell_of(const struct bank_grid *g, const float x[3])
{
    uint32_t index[3];
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        float s = (x[k] - g->origin_m[k]) / g->cell_m;
        index[k] = s > 0 ? (uint32_t)s : 0;
        if (index[k] >= g->cells[k])
            index[k] = g->cells[k] - 1u;
    }
    return index[0] + g->cells[0] * (index[1] + (uint32_t)g->cells[1] * index[2]);
}

/* Every vertex inside the grid, and every triangle listed where its centroid lies: a triangle that the grid forgot
 * would let the instrument pass. */
static int check_cover(struct bank_view *view)
{
    const struct bank_grid *g = view->grid;
    for (uint32_t v = 0; v < view->vertex_count; v++) /* bound: BANK_MAX_VERTICES */
        for (int k = 0; k < 3; k++)                   /* bound: 3 */
            if (!within((view->positions[3 * v + k] - g->origin_m[k]) / g->cell_m, 0, (float)g->cells[k]))
                return fault(view, STATUS_BANK_NONFINITE, BANK_GRID, v);
    for (uint32_t t = 0; t < view->triangle_count; t++) { /* bound: BANK_MAX_TRIANGLES */
        const uint16_t *v = view->triangles[t].vertex;
        float centroid[3];
        for (int k = 0; k < 3; k++) /* bound: 3 */
            centroid[k] =
                (view->positions[3 * v[0] + k] + view->positions[3 * v[1] + k] + view->positions[3 * v[2] + k]) / 3;
        uint32_t cell = cell_of(g, centroid), e = bank_view_cell_start(view, cell),
                 end = bank_view_cell_start(view, cell + 1);
        while (e < end && view->cell_triangle[e] != t) /* bound: BANK_MAX_CELL_TRIANGLES */
            e++;
        if (e == end)
            return fault(view, STATUS_BANK_INDEX, BANK_GRID, t);
    }
    return STATUS_OK;
}

static int check_grid(struct bank_view *view)
{
    const struct bank_grid *g = view->grid;
    bool good = positive(g->cell_m) && g->reserved == 0;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        good = good && finite(g->origin_m[k]);
    if (!good)
        return fault(view, STATUS_BANK_NONFINITE, BANK_GRID, 0);
    int status = check_cells(view);
    return status ? status : check_cover(view);
}

/* Each row 0 .. n-1 is owned by exactly one vertex. Without memory for n marks: ROW_WINDOW of them at a time. */
static int check_rows(struct bank_view *view)
{
    uint32_t owned = 0;
    for (uint32_t v = 0; v < view->vertex_count; v++) { /* bound: BANK_MAX_VERTICES */
        if (view->row_of[v] == BANK_NONE)
            continue;
        if (view->row_of[v] >= view->row_count)
            return fault(view, STATUS_BANK_INDEX, BANK_ROWS, v);
        owned++;
    }
    if (owned != view->row_count)
        return fault(view, STATUS_BANK_INDEX, BANK_ROWS, view->vertex_count);
    for (uint32_t first = 0; first < view->row_count; first += ROW_WINDOW) { /* bound: 65536 / ROW_WINDOW = 8 */
        uint32_t seen[ROW_WINDOW / 32];
        for (int k = 0; k < ROW_WINDOW / 32; k++) /* bound: ROW_WINDOW / 32 */
            seen[k] = 0;
        for (uint32_t v = 0; v < view->vertex_count; v++) { /* bound: BANK_MAX_VERTICES */
            uint32_t mark = (uint32_t)view->row_of[v] - first;
            if (view->row_of[v] == BANK_NONE || view->row_of[v] < first || mark >= ROW_WINDOW)
                continue;
            if (seen[mark / 32] >> (mark % 32) & 1)
                return fault(view, STATUS_BANK_INDEX, BANK_ROWS, v);
            seen[mark / 32] |= 1u << (mark % 32);
        }
    }
    return STATUS_OK;
}

/* A positive semidefinite matrix has no entry larger than its largest diagonal entry. A component that is fixed leaves
 * a zero on the diagonal, so zero is allowed, but not three of them. */
static int check_half(struct bank_view *view)
{
    float largest = 0;
    for (uint32_t i = 0; i < view->row_count; i++) { /* bound: BANK_MAX_VERTICES */
        const float *block = view->half + 9 * ((size_t)i * (i + 1) / 2 + i);
        float trace = 0;
        for (int a = 0; a < 3; a++) { /* bound: 3 */
            int b = (a + 1) % 3;
            float aa = block[4 * a], bb = block[4 * b], ab = block[3 * a + b], ba = block[3 * b + a];
            bool good = within(aa, 0, FLT_MAX) && within(bb, 0, FLT_MAX) && finite(ab) && finite(ba);
            /* the 2x2 minors: |ab| <= sqrt(aa bb) <= (aa + bb) / 2, with room for float32 rounding */
            float mean = 0.5f * aa + 0.5f * bb;
            if (!good || !within(ab - ba, -1e-5f * mean, 1e-5f * mean) ||
                !within(ab, -1.00001f * mean, 1.00001f * mean))
                return fault(view, STATUS_BANK_NONFINITE, BANK_GHLF, i);
            trace += aa;
            if (aa > largest)
                largest = aa;
        }
        if (!positive(trace))
            return fault(view, STATUS_BANK_NONFINITE, BANK_GHLF, i);
    }
    float limit = largest + 1e-5f * largest;
    for (uint32_t i = 0; i < view->row_count; i++) { /* bound: BANK_MAX_VERTICES */
        const float *row = view->half + 9 * ((size_t)i * (i + 1) / 2);
        for (uint32_t k = 0; k < 9 * (i + 1); k++) /* bound: 9 BANK_MAX_VERTICES; in all, the section once */
            if (!within(row[k], -limit, limit))
                return fault(view, STATUS_BANK_NONFINITE, BANK_GHLF, i);
    }
    return STATUS_OK;
}

/* Levels in rising order from row 0; units that keep every multiple within 16 bits; cumulative frequencies up to 2^12. */
static bool factor_tables_good(const struct bank_factor_view *f)
{
    uint32_t unit = f->header->diagonal_unit;
    bool good = positive(f->header->step) && f->header->max_blocks >= 1 && f->header->max_blocks <= f->rows &&
                !f->header->reserved[0] && !f->header->reserved[1] && !f->header->reserved[2] && f->level_first[0] == 0;
    for (uint32_t k = 0; k < 64; k++) /* bound: 64 */
        unit = f->distance_unit[k] > unit ? f->distance_unit[k] : unit;
    for (uint32_t l = 0; l < f->header->levels; l++) /* bound: BANK_FACTOR_LEVELS */
        good = good && f->level_log[l] < 64 && f->level_first[l] < f->rows &&
               (l == 0 || f->level_first[l] > f->level_first[l - 1]) &&
               (uint64_t)f->level_unit[l] * unit <= ROW_MULTIPLE_MAX << 6;
    for (uint32_t t = 0; t < BANK_FACTOR_TABLES; t++) { /* bound: BANK_FACTOR_TABLES */
        const struct bank_table *table = row_table(f, t);
        good = good && table->plain <= BANK_FACTOR_PLAIN && table->upper[BANK_FACTOR_SYMBOLS - 1] == ROW_SLOTS;
        for (uint32_t s = 1; s < BANK_FACTOR_SYMBOLS; s++) /* bound: BANK_FACTOR_SYMBOLS */
            good = good && table->upper[s - 1] <= table->upper[s];
    }
    return good;
}

/* The code of every row lies behind that of the row before, and there are no words between, and zeros at the end. */
static int check_directory(struct bank_view *view)
{
    const struct bank_factor_view *f = &view->factor;
    uint32_t end = 0;
    for (uint32_t i = 0; i < f->rows; i++) { /* bound: BANK_MAX_VERTICES */
        uint32_t start = row_code_start(f, i), next = row_code_start(f, i + 1);
        if (start != end || next > f->words || next < start || next - start < 2)
            return fault(view, STATUS_BANK_INDEX, BANK_FACT, i);
        end = next;
    }
    for (uint32_t k = 0; k < BANK_FACTOR_SPARE; k++) /* bound: BANK_FACTOR_SPARE */
        if (f->code[f->words + k])
            return fault(view, STATUS_BANK_INDEX, BANK_FACT, f->rows);
    for (uint32_t k = 0; k < 3 * f->rows; k++) /* bound: 3 BANK_MAX_VERTICES */
        if (f->place[k] > INT16_MAX)
            return fault(view, STATUS_BANK_INDEX, BANK_FACT, k / 3);
    return end == f->words ? STATUS_OK : fault(view, STATUS_BANK_LENGTH, BANK_FACT, f->rows);
}

/* Every row decodes to its last word, into no more blocks than promised, and the sums of squares of its three scalar rows
 * stay below 2^31: by Cauchy and Schwarz then every product of two rows does, as does every partial sum. */
static int check_factor_row(struct bank_view *view, uint32_t row)
{
    struct row_reader reader;
    struct row_block block = {0};
    uint64_t squares[3] = {0, 0, 0};
    uint32_t count = 0;
    row_start(&reader, view, row);
    while (row_next(&reader, &block)) { /* bound: row + 1 */
        count++;
        for (int k = 0; k < 9; k++) /* bound: 9 */
            squares[k / 3] += (uint64_t)((int32_t)block.value[k] * block.value[k]);
    }
    bool good = !reader.damaged && reader.state == ROW_STATE_LOW && reader.next == reader.end &&
                count <= view->factor.header->max_blocks && squares[0] + squares[1] + squares[2] > 0;
    for (int a = 0; a < 3; a++) /* bound: 3; a column of a block that is not on the diagonal of Q is below it */
        good = good && squares[a] < 0x80000000u;
    return good ? STATUS_OK : fault(view, STATUS_BANK_INDEX, BANK_FACT, row);
}

static int check_factor(struct bank_view *view)
{
    if (!factor_tables_good(&view->factor))
        return fault(view, STATUS_BANK_INDEX, BANK_FACT, 0);
    int status = check_directory(view);
    for (uint32_t i = 0; i < view->row_count && !status; i++) /* bound: BANK_MAX_VERTICES */
        status = check_factor_row(view, i);
    return status;
}

static int check_contact(struct bank_view *view)
{
    const struct bank_contact *c = view->contact;
    bool good = positive(c->regularisation_m_N) && positive(c->coupling_stiffness_N_m) &&
                within(c->coupling_damping_Ns_m, 0, FLT_MAX) && positive(c->force_limit_N) &&
                positive(c->force_rate_N_s) && positive(c->decay_s) && c->decay_s <= BANK_MAX_DECAY_S &&
                positive(c->typical_compliance_m_N) && c->solver_steps <= BANK_MAX_SOLVER_STEPS &&
                c->row_work <= BANK_MAX_ROW_WORK;
    return good ? STATUS_OK : fault(view, STATUS_BANK_NONFINITE, BANK_CONT, 0);
}

static bool axis_good(const struct bank_axis *axis, float low, float high)
{
    return axis->count_modulus >= 1 && axis->count_modulus <= BANK_MAX_COUNTS &&
           axis->count_zero < axis->count_modulus && finite(axis->per_count) && axis->per_count != 0 &&
           finite(axis->zero) && within(axis->minimum, low, high) && within(axis->maximum, low, high) &&
           axis->minimum < axis->maximum && positive(axis->speed_limit) && positive(axis->effort_limit);
}

static bool rotation_good(const float r[9])
{
    float column[3][3];
    for (int k = 0; k < 9; k++) /* bound: 9 */
        column[k % 3][k / 3] = r[k];
    const float *x = column[0], *y = column[1], *z = column[2];
    float cross[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
    return is_unit(x) && is_unit(y) && is_unit(z) && within(dot(x, y), -unit_tolerance, unit_tolerance) &&
           within(dot(y, z), -unit_tolerance, unit_tolerance) && within(dot(z, x), -unit_tolerance, unit_tolerance) &&
           dot(cross, z) > 0;
}

static bool tool_good(const struct bank_tool *t)
{
    bool good = rotation_good(t->rotation) && axis_good(&t->axis[0], -BANK_MAX_ANGLE_RAD, BANK_MAX_ANGLE_RAD) &&
                axis_good(&t->axis[1], -BANK_MAX_ANGLE_RAD, BANK_MAX_ANGLE_RAD) &&
                axis_good(&t->axis[2], 0, BANK_MAX_POSITION_M) && within(t->gravity_N, 0, FLT_MAX) &&
                finite(t->gravity_arm_m) && is_unit(t->gravity_direction) &&
                within(t->tip_radius_m, 0, BANK_MAX_POSITION_M) && t->point_count >= 1 &&
                t->point_count <= BANK_MAX_TOOL_POINTS;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        good = good && within(t->trocar_m[k], -BANK_MAX_POSITION_M, BANK_MAX_POSITION_M);
    for (int p = 0; p < BANK_MAX_TOOL_POINTS; p++) /* bound: BANK_MAX_TOOL_POINTS; unused ones too */
        for (int k = 0; k < 3; k++)                /* bound: 3 */
            good = good && within(t->point_m[p][k], -BANK_MAX_POSITION_M, BANK_MAX_POSITION_M);
    for (int k = 0; k < 4; k++) /* bound: 4 */
        good = good && t->reserved[k] == 0;
    return good;
}

static int check_tools(struct bank_view *view)
{
    for (uint32_t i = 0; i < view->tool_count; i++) /* bound: BANK_MAX_INSTRUMENTS */
        if (!tool_good(&view->tools[i]))
            return fault(view, STATUS_BANK_NONFINITE, BANK_TOOL, i);
    return STATUS_OK;
}

int bank_check_contents(struct bank_view *view)
{
    int status = check_vertices(view);
    if (!status)
        status = check_triangles(view);
    if (!status)
        status = check_grid(view);
    if (!status)
        status = check_rows(view);
    if (!status)
        status = view->half ? check_half(view) : check_factor(view);
    if (!status)
        status = check_contact(view);
    if (!status)
        status = check_tools(view);
    return status;
}
