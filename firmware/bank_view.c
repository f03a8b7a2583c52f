#include "bank_view.h"

#include <stdbool.h>

#include "bank_check.h"
#include "crc.h"
#include "effects/effects.h"
#include "row.h"
#include "tick.h" /* FIRMWARE_ABI */

static const uint32_t required_tags[] = {BANK_VERT, BANK_NORM, BANK_TRIA, BANK_GRID, BANK_ROWS,
                                         BANK_CONT, BANK_TOOL, BANK_GHLF, BANK_FACT};
/* GHLF or FACT, the last two, is enough */
enum { KNOWN_TAGS = sizeof required_tags / sizeof required_tags[0], HALF = KNOWN_TAGS - 2, FACTOR = KNOWN_TAGS - 1 };

static bool is_required_tag(uint32_t tag)
{
    for (uint32_t k = 0; k < KNOWN_TAGS; k++) /* bound: KNOWN_TAGS */
        if (required_tags[k] == tag)
            return true;
    return false;
}

/* Bit of the effect of this image whose section has this tag; 0: none. */
static uint32_t effect_of_tag(uint32_t tag)
{
    (void)tag;
#define EFFECT(bit, NAME, name, tag_, parts, what) IF_##NAME(if (tag == tag_) return EFFECT_##NAME;)
#include "effects.def"
#undef EFFECT
    return 0;
}

static int fault(struct bank_view *view, int status, uint32_t tag, uint32_t record)
{
    *view = (struct bank_view){.fault_tag = tag, .fault_record = record};
    return status;
}

static uint32_t padded(uint32_t length)
{
    return length + (-length & (BANK_ALIGNMENT - 1));
}

static int check_header(struct bank_view *view, const struct bank_header *h, size_t length)
{
    /* magic and version stand first and never move, so that a foreign or newer file is named as such */
    if (length < 8)
        return STATUS_BANK_LENGTH;
    if (h->magic != BANK_MAGIC)
        return STATUS_BANK_MAGIC;
    if (h->format_version != BANK_FORMAT_VERSION)
        return STATUS_BANK_VERSION;
    if (length < sizeof *h)
        return STATUS_BANK_LENGTH;
    if (h->header_crc != crc32_update(0, h, sizeof *h - sizeof h->header_crc))
        return STATUS_BANK_CRC;
    if (h->header_bytes != sizeof *h || h->total_bytes != length || h->total_bytes % BANK_ALIGNMENT)
        return STATUS_BANK_LENGTH;
    for (int k = 0; k < 6; k++) /* bound: 6 */
        if (h->reserved[k])
            return STATUS_BANK_SECTION;
    if (h->section_count < 1 || h->section_count > BANK_MAX_SECTIONS)
        return STATUS_BANK_SECTION;
    uint32_t table_bytes = h->section_count * (uint32_t)sizeof(struct bank_section);
    if (length - sizeof *h < table_bytes)
        return STATUS_BANK_LENGTH;
    if (h->table_crc != crc32_update(0, h + 1, table_bytes))
        return STATUS_BANK_CRC;
    if (h->image_abi > FIRMWARE_ABI)
        return STATUS_BANK_ABI;
    uint32_t lacking = h->effects & ~(uint32_t)EFFECTS_IN_IMAGE;
    if (lacking)
        return fault(view, STATUS_BANK_EFFECT, 0, lacking);
    return STATUS_OK;
}

/* One entry: its fields, and that it starts where the one before it ended. */
static int check_entry(const struct bank_header *h, uint32_t k, uint64_t expected_offset)
{
    const struct bank_section *table = (const struct bank_section *)(h + 1), *s = &table[k];
    uint32_t total_bytes = h->total_bytes, effect = effect_of_tag(s->tag);
    const uint16_t known_flags = BANK_REQUIRED | BANK_HOST_ONLY;
    if (s->offset != expected_offset || s->reserved[0] || s->reserved[1])
        return STATUS_BANK_SECTION;
    if ((s->flags & ~known_flags) || s->flags == known_flags)
        return STATUS_BANK_SECTION;
    if (s->length > total_bytes - s->offset || padded(s->length) > total_bytes - s->offset)
        return STATUS_BANK_LENGTH;
    for (uint32_t other = 0; other < k; other++) /* bound: BANK_MAX_SECTIONS */
        if (table[other].tag == s->tag)
            return STATUS_BANK_SECTION;
    if (is_required_tag(s->tag)) {
        if (s->flags != BANK_REQUIRED)
            return STATUS_BANK_SECTION;
        if (s->version != bank_section_version(s->tag))
            return STATUS_BANK_VERSION;
    } else if (effect) {
        if (s->flags != BANK_REQUIRED || !(h->effects & effect))
            return STATUS_BANK_SECTION;
        if (s->version != 1)
            return STATUS_BANK_VERSION;
    } else if (s->flags & BANK_REQUIRED)
        return STATUS_BANK_REQUIRED;
    return STATUS_OK;
}

static int check_table(struct bank_view *view, const struct bank_header *h)
{
    const struct bank_section *table = (const struct bank_section *)(h + 1);
    const uint8_t *bytes = (const uint8_t *)h;
    uint64_t end = sizeof *h + (uint64_t)h->section_count * sizeof *table;
    for (uint32_t k = 0; k < h->section_count; k++) { /* bound: BANK_MAX_SECTIONS */
        int status = check_entry(h, k, end);
        if (status)
            return fault(view, status, table[k].tag, k);
        end += padded(table[k].length);
    }
    if (end != h->total_bytes)
        return fault(view, STATUS_BANK_LENGTH, 0, h->section_count);
    for (uint32_t k = 0; k < h->section_count; k++) { /* bound: BANK_MAX_SECTIONS; in all, the bank's bytes once */
        const struct bank_section *s = &table[k];
        uint32_t room = padded(s->length);
        if (s->crc != crc32_update(0, bytes + s->offset, room))
            return fault(view, STATUS_BANK_CRC, s->tag, k);
        for (uint32_t b = s->length; b < room; b++) /* bound: BANK_ALIGNMENT - 1 */
            if (bytes[s->offset + b])
                return fault(view, STATUS_BANK_SECTION, s->tag, k);
    }
    return STATUS_OK;
}

/* Count within its limits and length exactly what the count asks for. */
static bool sized(const struct bank_section *s, uint32_t low, uint32_t high, uint64_t record_bytes)
{
    return s->count >= low && s->count <= high && s->length == s->count * record_bytes;
}

static int check_sizes(struct bank_view *view, const struct bank_section *const found[KNOWN_TAGS])
{
    const struct bank_section *vert = found[0], *norm = found[1], *tria = found[2], *grid = found[3];
    const struct bank_section *rows = found[4], *cont = found[5], *tool = found[6];
    const struct bank_section *half = found[HALF], *factor = found[FACTOR];
    const struct bank_section *bad = NULL;
    uint64_t block_bytes = 9 * sizeof(float);
    uint32_t tools = view->header->effects & EFFECT_SECOND ? 2 : 1;
    if (!sized(vert, 4, BANK_MAX_VERTICES, 3 * sizeof(float)))
        bad = vert;
    else if (!sized(norm, vert->count, vert->count, 3 * sizeof(float)))
        bad = norm;
    else if (!sized(tria, 4, BANK_MAX_TRIANGLES, sizeof(struct bank_triangle)))
        bad = tria;
    else if (!sized(rows, vert->count, vert->count, sizeof(uint16_t)))
        bad = rows;
    else if (half && (half->count < 1 || half->count > vert->count ||
                      half->length != block_bytes * half->count * ((uint64_t)half->count + 1) / 2))
        bad = half;
    else if (factor && (factor->count < 1 || factor->count > vert->count ||
                        factor->length < sizeof(struct bank_factor) || factor->length % 2))
        bad = factor;
    else if (!sized(cont, 1, 1, sizeof(struct bank_contact)))
        bad = cont;
    else if (!sized(tool, tools, tools, sizeof(struct bank_tool)))
        bad = tool;
    else if (grid->length < sizeof(struct bank_grid))
        bad = grid;
    if (bad)
        return fault(view, STATUS_BANK_LENGTH, bad->tag, 0);
    return STATUS_OK;
}

static int check_grid_size(struct bank_view *view, const struct bank_section *section, const struct bank_grid *g)
{
    uint32_t cells = 1;
    for (int k = 0; k < 3; k++) { /* bound: 3; the product stays below 2^27 at each step */
        if (g->cells[k] < 1 || g->cells[k] > BANK_MAX_GRID_AXIS)
            return fault(view, STATUS_BANK_INDEX, BANK_GRID, 0);
        cells *= g->cells[k];
        if (cells > BANK_MAX_GRID_CELLS)
            return fault(view, STATUS_BANK_INDEX, BANK_GRID, 0);
    }
    uint64_t bytes = sizeof *g + 4 * (cells / 32 + 1) + 2 * ((uint64_t)cells + 1) + 2 * (uint64_t)g->entries;
    if (section->count != cells || section->length != bytes)
        return fault(view, STATUS_BANK_LENGTH, BANK_GRID, 0);
    return STATUS_OK;
}

/* The arrays of FACT one behind the other; what is left is code. */
static int take_factor(struct bank_view *view, const struct bank_section *section, const char *bytes)
{
    struct bank_factor_view *f = &view->factor;
    f->header = (const struct bank_factor *)bytes;
    f->rows = section->count;
    uint32_t levels = f->header->levels, classes = f->header->classes, n = f->rows;
    if (levels < 1 || levels > BANK_FACTOR_LEVELS || classes < 1 || classes > BANK_FACTOR_CLASSES)
        return fault(view, STATUS_BANK_INDEX, BANK_FACT, 0);
    f->level_first = (const uint16_t *)(f->header + 1);
    f->level_log = f->level_first + levels;
    f->level_unit = f->level_log + levels;
    f->distance_unit = f->level_unit + levels;
    f->diagonal = (const struct bank_context *)(f->distance_unit + 64);
    f->context = f->diagonal + levels;
    f->table = (const struct bank_table *)(f->context + levels * classes);
    f->place = (const uint16_t *)(f->table + BANK_FACTOR_TABLES);
    f->base = f->place + 3 * n;
    f->offset = f->base + 2 * (n / 32 + 1);
    f->code = f->offset + n + 1;
    uint32_t before = (uint32_t)((const char *)f->code - bytes);
    if (section->length < before + 2 * BANK_FACTOR_SPARE)
        return fault(view, STATUS_BANK_LENGTH, BANK_FACT, 0);
    f->words = (section->length - before) / 2 - BANK_FACTOR_SPARE;
    return STATUS_OK;
}

/* Each effect that the bank names has its section; the effect itself says whether it is good. */
static int open_effects(struct bank_view *view)
{
    int status = STATUS_OK;
#define EFFECT(bit, NAME, name, tag, parts, what)                                                                      \
    IF_##NAME(if (!status && (view->header->effects & EFFECT_##NAME)) {                                                \
        view->fault_tag = tag;                                                                                         \
        view->fault_record = 0;                                                                                        \
        status = bank_view_section(view, tag) ? name##_open(view) : STATUS_BANK_MISSING;                               \
    })
#include "effects.def"
#undef EFFECT
    if (!status)
        view->fault_tag = 0;
    return status;
}

int bank_view_open(struct bank_view *view, const void *bytes, size_t length)
{
    *view = (struct bank_view){0};
    if ((uintptr_t)bytes % BANK_ALIGNMENT)
        return STATUS_BANK_ALIGNMENT;
    const struct bank_header *h = bytes;
    int status = check_header(view, h, length);
    if (!status)
        status = check_table(view, h);
    if (status)
        return status;

    view->header = h;
    view->sections = (const struct bank_section *)(h + 1);
    const struct bank_section *found[KNOWN_TAGS];
    for (uint32_t k = 0; k < KNOWN_TAGS; k++) { /* bound: KNOWN_TAGS */
        found[k] = bank_view_section(view, required_tags[k]);
        if (!found[k] && k < HALF)
            return fault(view, STATUS_BANK_MISSING, required_tags[k], 0);
    }
    if (!found[HALF] && !found[FACTOR])
        return fault(view, STATUS_BANK_MISSING, BANK_FACT, 0);
    if (found[HALF] && found[FACTOR])
        return fault(view, STATUS_BANK_SECTION, BANK_FACT, 0);
    status = check_sizes(view, found);
    if (status)
        return status;
    const char *base = bytes;
    const struct bank_grid *grid = (const struct bank_grid *)(base + found[3]->offset);
    status = check_grid_size(view, found[3], grid);
    if (status)
        return status;

    view->vertex_count = found[0]->count;
    view->triangle_count = found[2]->count;
    view->row_count = found[HALF] ? found[HALF]->count : found[FACTOR]->count;
    view->tool_count = found[6]->count;
    view->positions = (const float *)(base + found[0]->offset);
    view->normals = (const float *)(base + found[1]->offset);
    view->triangles = (const struct bank_triangle *)(base + found[2]->offset);
    view->grid = grid;
    view->cell_base = (const uint32_t *)(grid + 1);
    view->cell_start = (const uint16_t *)(view->cell_base + found[3]->count / 32 + 1);
    view->cell_triangle = view->cell_start + found[3]->count + 1;
    view->row_of = (const uint16_t *)(base + found[4]->offset);
    view->contact = (const struct bank_contact *)(base + found[5]->offset);
    view->tools = (const struct bank_tool *)(base + found[6]->offset);
    if (found[HALF])
        view->half = (const float *)(base + found[HALF]->offset);
    else {
        status = take_factor(view, found[FACTOR], base + found[FACTOR]->offset);
        if (status)
            return status;
    }
    status = bank_check_contents(view);
    if (!status)
        status = open_effects(view);
    if (status)
        return fault(view, status, view->fault_tag, view->fault_record);
    return STATUS_OK;
}

const struct bank_section *bank_view_section(const struct bank_view *view, uint32_t tag)
{
    for (uint32_t k = 0; k < view->header->section_count; k++) /* bound: BANK_MAX_SECTIONS */
        if (view->sections[k].tag == tag)
            return &view->sections[k];
    return NULL;
}

/* Both rows are read side by side, a block at a time, so that neither needs memory. */
static void factor_compliance(const struct bank_view *view, uint32_t i, uint32_t j, float out[9])
{
    struct row_reader left, right;
    struct row_block l = {0}, r = {0};
    int32_t sum[9], total[9] = {0};
    float step2 = view->factor.header->step * view->factor.header->step;
    if (view->decoded) {
        const uint32_t *start = view->decoded_start;
        row_dot(view->decoded + start[i], start[i + 1] - start[i], view->decoded + start[j], start[j + 1] - start[j],
                total);
        for (int k = 0; k < 9; k++) /* bound: 9 */
            out[k] = step2 * (float)total[k];
        return;
    }
    row_start(&left, view, i);
    row_start(&right, view, j);
    bool more_left = row_next(&left, &l), more_right = row_next(&right, &r);
    while (more_left && more_right) { /* bound: blocks of both rows */
        bool step_left = l.column <= r.column, step_right = r.column <= l.column;
        row_dot(&l, 1, &r, 1, sum);
        for (int k = 0; k < 9; k++) /* bound: 9 */
            total[k] += sum[k];
        if (step_left)
            more_left = row_next(&left, &l);
        if (step_right)
            more_right = row_next(&right, &r);
    }
    for (int k = 0; k < 9; k++) /* bound: 9 */
        out[k] = step2 * (float)total[k];
}

void bank_view_compliance(const struct bank_view *view, uint32_t i, uint32_t j, float block[9])
{
    if (!view->half) {
        factor_compliance(view, i, j, block);
        return;
    }
    uint32_t high = i > j ? i : j, low = i > j ? j : i;
    const float *stored = view->half + 9 * ((size_t)high * (high + 1) / 2 + low);
    for (int a = 0; a < 3; a++)     /* bound: 3 */
        for (int b = 0; b < 3; b++) /* bound: 3 */
            block[3 * a + b] = i >= j ? stored[3 * a + b] : stored[3 * b + a];
}
