#include "pack.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "crc.h"
#include "tick.h" /* FIRMWARE_ABI */

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "sections are written as they lie in memory");

static size_t padded(size_t length)
{
    return (length + BANK_ALIGNMENT - 1) / BANK_ALIGNMENT * BANK_ALIGNMENT;
}

static uint64_t half_bytes(uint64_t rows)
{
    return 9 * sizeof(float) * (rows * (rows + 1) / 2);
}

static uint64_t grid_bytes(const struct grid *grid)
{
    return sizeof grid->header + 4 * (grid->cells / 32 + 1) + 2 * ((uint64_t)grid->cells + 1 + grid->header.entries);
}

static int check_limits(const struct surface *surface, uint64_t rows, struct failure *why)
{
    if (surface->vertex_count > BANK_MAX_VERTICES || surface->triangle_count > BANK_MAX_TRIANGLES)
        return failure_set(why, STATUS_MESH_TOO_LARGE, NULL, NULL,
                           "the surface has %zu vertices and %zu triangles; the bank holds %d of each",
                           surface->vertex_count, surface->triangle_count, BANK_MAX_VERTICES);
    if (rows == 0)
        return failure_set(why, STATUS_SCENE_SELECTION, NULL, "fix fewer nodes", "every surface vertex is fixed");
    if (half_bytes(rows) > UINT32_MAX / 16 * 15)
        return failure_set(why, STATUS_MESH_TOO_LARGE, NULL, NULL,
                           "the compliance of %llu free vertices has %.1f GB; the bank holds 4 GB",
                           (unsigned long long)rows, 1e-9 * (double)half_bytes(rows));
    return STATUS_OK;
}

int pack_prepare(struct pack *p, const struct mesh *mesh, const struct surface *surface, const bool *fixed,
                 size_t tools, struct failure *why)
{
    *p = (struct pack){.vertices = surface->vertex_count,
                       .triangles = surface->triangle_count,
                       .tools = tools,
                       .mesh_hash = mesh->file_hash};
    for (size_t v = 0; v < p->vertices; v++)
        p->rows += !fixed[v];
    int status = check_limits(surface, p->rows, why);
    if (status)
        return status;
    p->positions = malloc(3 * p->vertices * sizeof *p->positions);
    p->normals = malloc(3 * p->vertices * sizeof *p->normals);
    p->triangle = malloc(p->triangles * sizeof *p->triangle);
    p->row_of = malloc(p->vertices * sizeof *p->row_of);
    if (!p->positions || !p->normals || !p->triangle || !p->row_of) {
        pack_free(p);
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the surface");
    }
    uint16_t row = 0;
    for (size_t v = 0; v < p->vertices; v++) {
        p->row_of[v] = fixed[v] ? BANK_NONE : row++;
        for (int k = 0; k < 3; k++) {
            p->positions[3 * v + k] = (float)mesh->nodes[3 * surface->node[v] + k];
            p->normals[3 * v + k] = (float)surface->normals[3 * v + k];
        }
    }
    for (size_t t = 0; t < p->triangles; t++)
        for (int k = 0; k < 3; k++) {
            p->triangle[t].vertex[k] = (uint16_t)surface->triangles[3 * t + k];
            p->triangle[t].neighbour[k] = (uint16_t)surface->neighbours[3 * t + k];
        }
    status = grid_build(p->vertices, p->positions, p->triangles, surface->triangles, &p->grid, why);
    if (status) {
        pack_free(p);
        return status;
    }
    uint64_t lengths[PACK_SECTIONS - 1] = {12 * p->vertices,
                                           12 * p->vertices,
                                           sizeof *p->triangle * p->triangles,
                                           grid_bytes(&p->grid),
                                           2 * p->vertices,
                                           sizeof(struct bank_contact),
                                           sizeof(struct bank_tool) * tools,
                                           half_bytes(p->rows)};
    p->bytes = sizeof(struct bank_header) + PACK_SECTIONS * sizeof(struct bank_section);
    for (int k = 0; k < PACK_SECTIONS - 1; k++)
        p->bytes += padded(lengths[k]);
    return STATUS_OK;
}

/* A section that is being written: pieces are appended and summed up. */
struct stream {
    struct bank_section *section;
    struct file_writer *writer;
};

static struct stream stream_open(struct pack *p, int k, uint32_t tag, size_t count, struct file_writer *writer)
{
    p->section[k] = (struct bank_section){.tag = tag,
                                          .version = bank_section_version(tag),
                                          .offset = (uint32_t)writer->length,
                                          .count = (uint32_t)count,
                                          .flags = tag == BANK_PROV ? BANK_HOST_ONLY : BANK_REQUIRED};
    return (struct stream){&p->section[k], writer};
}

static int stream_add(struct stream *s, const void *bytes, size_t length, struct failure *why)
{
    s->section->length += (uint32_t)length;
    s->section->crc = crc32_update(s->section->crc, bytes, length);
    return file_append(s->writer, bytes, length, why);
}

static int stream_close(struct stream *s, struct failure *why)
{
    static const unsigned char zero[BANK_ALIGNMENT];
    size_t rest = padded(s->section->length) - s->section->length;
    s->section->crc = crc32_update(s->section->crc, zero, rest);
    return file_append(s->writer, zero, rest, why);
}

static int write_whole(struct pack *p, int k, uint32_t tag, size_t count, const void *bytes, size_t length,
                       struct file_writer *writer, struct failure *why)
{
    struct stream s = stream_open(p, k, tag, count, writer);
    int status = stream_add(&s, bytes, length, why);
    return status ? status : stream_close(&s, why);
}

static int write_grid(struct pack *p, int k, struct file_writer *writer, struct failure *why)
{
    const struct grid *g = &p->grid;
    struct stream s = stream_open(p, k, BANK_GRID, g->cells, writer);
    int status = stream_add(&s, &g->header, sizeof g->header, why);
    if (!status)
        status = stream_add(&s, g->base, (g->cells / 32 + 1) * sizeof *g->base, why);
    if (!status)
        status = stream_add(&s, g->start, (g->cells + 1) * sizeof *g->start, why);
    if (!status)
        status = stream_add(&s, g->entry, g->header.entries * sizeof *g->entry, why);
    return status ? status : stream_close(&s, why);
}

/* Rows first .. last-1 of the half matrix as float32. G is column-major with its lower half filled: down a column of G
 * the band is contiguous, along a row it is not. */
static void round_band(const struct compliance *compliance, size_t first, size_t last, float *band)
{
    size_t n = compliance->rows, ld = 3 * n, base = first * (first + 1) / 2;
    for (size_t j = 0; j < last; j++)
        for (int b = 0; b < 3; b++) {
            const double *column = compliance->G + ld * (3 * j + b);
            for (size_t i = j > first ? j : first; i < last; i++)
                for (int a = 0; a < 3; a++) {
                    bool upper = i == j && a < b; /* inside the diagonal block: take the mirror image */
                    double g = upper ? compliance->G[ld * (3 * j + a) + 3 * i + b] : column[3 * i + a];
                    band[9 * (i * (i + 1) / 2 - base + j) + 3 * a + b] = (float)g;
                }
        }
}

static int write_half(struct pack *p, int k, const struct compliance *compliance, struct file_writer *writer,
                      bool quiet, struct failure *why)
{
    size_t n = compliance->rows;
    float *band = malloc(9 * sizeof *band * PACK_BAND * n);
    if (!band)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to write the compliance");
    struct progress bar;
    progress_start(&bar, "writing the bank", quiet);
    struct stream s = stream_open(p, k, BANK_GHLF, n, writer);
    int status = STATUS_OK;
    for (size_t first = 0; first < n && !status; first += PACK_BAND) {
        size_t last = first + PACK_BAND < n ? first + PACK_BAND : n;
        round_band(compliance, first, last, band);
        size_t blocks = last * (last + 1) / 2 - first * (first + 1) / 2;
        status = stream_add(&s, band, 9 * sizeof *band * blocks, why);
        progress_show(&bar, (double)(last * (last + 1)) / (double)(n * (n + 1)));
    }
    progress_end(&bar);
    free(band);
    return status ? status : stream_close(&s, why);
}

static size_t sections(const struct pack *p)
{
    return PACK_SECTIONS + p->effect_sections;
}

/* Table, then header, over the place that was kept for them. */
static int write_head(struct pack *p, struct file_writer *writer, struct failure *why)
{
    struct bank_header h = {.magic = BANK_MAGIC,
                            .format_version = BANK_FORMAT_VERSION,
                            .header_bytes = sizeof h,
                            .total_bytes = (uint32_t)writer->length,
                            .section_count = (uint32_t)sections(p),
                            .image_abi = FIRMWARE_ABI,
                            .effects = p->effects,
                            .scene_hash = p->scene_hash,
                            .mesh_hash = p->mesh_hash,
                            .table_crc = crc32_update(0, p->section, sections(p) * sizeof p->section[0])};
    h.header_crc = crc32_update(0, &h, sizeof h - sizeof h.header_crc);
    int status = file_patch(writer, sizeof h, p->section, sections(p) * sizeof p->section[0], why);
    return status ? status : file_patch(writer, 0, &h, sizeof h, why);
}

uint64_t pack_rest(const struct pack *p)
{
    return p->bytes - padded(half_bytes(p->rows));
}

void pack_compressed(struct pack *p, const struct compressed *compressed)
{
    p->bytes += padded(compressed->length) - padded(half_bytes(p->rows));
}

int pack_effects(struct pack *p, const struct scene *scene, struct body *body, struct failure *why)
{
    for (size_t i = 0; i < effects_count(); i++) {
        const struct effect *effect = effects_at(i);
        if (!(scene->effects.named & effect->bit))
            continue;
        int status = effect->section(scene, body, &p->effect[p->effect_sections], why);
        if (status)
            return status;
        p->effects |= effect->bit;
        p->effect_tag[p->effect_sections] = effect->tag;
        p->bytes += sizeof(struct bank_section) + padded(p->effect[p->effect_sections++].length);
    }
    return STATUS_OK;
}

/* Row numbers as the section that follows counts them. */
static int number_rows(struct pack *p, const struct compliance *compliance, const struct compressed *compressed,
                       struct failure *why)
{
    uint16_t *rank = malloc(p->rows * sizeof *rank);
    if (!rank)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to number the rows");
    for (size_t k = 0; k < p->rows; k++)
        rank[compressed ? compressed->order.at[k] : k] = (uint16_t)k;
    for (size_t v = 0; v < p->vertices; v++)
        p->row_of[v] = compliance->row_of[v] == UINT32_MAX ? BANK_NONE : rank[compliance->row_of[v]];
    free(rank);
    return STATUS_OK;
}

int pack_write(struct pack *p, const struct compliance *compliance, const struct compressed *compressed,
               struct file_writer *writer, bool quiet, struct failure *why)
{
    if (compliance->rows != p->rows)
        return failure_set(why, STATUS_MODEL_FACTOR, NULL, NULL,
                           "the compliance has %zu rows where the surface has %zu", compliance->rows, p->rows);
    static const char empty[sizeof(struct bank_header) + (PACK_SECTIONS + PACK_EFFECTS) * sizeof(struct bank_section)];
    int status = number_rows(p, compliance, compressed, why);
    if (!status)
        status = file_append(writer, empty, sizeof(struct bank_header) + sections(p) * sizeof p->section[0], why);
    if (!status)
        status = write_whole(p, 0, BANK_VERT, p->vertices, p->positions, 12 * p->vertices, writer, why);
    if (!status)
        status = write_whole(p, 1, BANK_NORM, p->vertices, p->normals, 12 * p->vertices, writer, why);
    if (!status)
        status =
            write_whole(p, 2, BANK_TRIA, p->triangles, p->triangle, sizeof *p->triangle * p->triangles, writer, why);
    if (!status)
        status = write_grid(p, 3, writer, why);
    if (!status)
        status = write_whole(p, 4, BANK_ROWS, p->vertices, p->row_of, 2 * p->vertices, writer, why);
    if (!status)
        status = write_whole(p, 5, BANK_CONT, 1, &p->contact, sizeof p->contact, writer, why);
    if (!status)
        status = write_whole(p, 6, BANK_TOOL, p->tools, p->tool, sizeof p->tool[0] * p->tools, writer, why);
    if (!status)
        status = compressed ? write_whole(p, 7, BANK_FACT, p->rows, compressed->bytes, compressed->length, writer, why)
                            : write_half(p, 7, compliance, writer, quiet, why);
    int last = PACK_SECTIONS - 1;
    for (size_t e = 0; e < p->effect_sections && !status; e++)
        status = write_whole(p, last++, p->effect_tag[e], p->effect[e].count, p->effect[e].bytes, p->effect[e].length,
                             writer, why);
    if (!status)
        status = write_whole(p, last, BANK_PROV, 1, "", 0, writer, why);
    return status ? status : write_head(p, writer, why);
}

int pack_provenance(struct pack *p, const char *text, size_t length, struct file_writer *writer, struct failure *why)
{
    int last = (int)sections(p) - 1;
    writer->length = p->section[last].offset;
    if (writer->length + padded(length) > UINT32_MAX)
        return failure_set(why, STATUS_MESH_TOO_LARGE, writer->path, NULL, "the bank exceeds 4 GB");
    int status = write_whole(p, last, BANK_PROV, 1, text, length, writer, why);
    return status ? status : write_head(p, writer, why);
}

void pack_free(struct pack *p)
{
    free(p->positions);
    free(p->normals);
    free(p->triangle);
    free(p->row_of);
    grid_free(&p->grid);
    for (size_t e = 0; e < p->effect_sections; e++)
        free(p->effect[e].bytes);
    *p = (struct pack){0};
}
