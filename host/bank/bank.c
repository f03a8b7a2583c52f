#include "bank.h"

#include <libgen.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include "crc.h"
#include "force_error.h"
#include "budget.h"
#include "pack.h"
#include "resume.h"
#include "tick.h" /* FIRMWARE_ABI */

enum { FORCE_ERROR_TRIALS = 20, FORCE_ERROR_SEED = 1 };
/* Direct solves may differ from the bank by what compression costs (another draw, hence the factor), and by the rounding of
 * float32 and of the solves themselves, amplified by at most the condition of a contact system, 2e4. */
#define FORCE_ERROR_AGREE    4
#define FORCE_ERROR_ROUNDING (2e4 * 0x1p-24)

int bank_refusal(int status, const struct bank_view *view, const void *bytes, size_t length, const char *path,
                 struct failure *why)
{
    const struct bank_header *h = bytes;
    uint32_t tag = view->fault_tag;
    char where[80] = "header", lacking[400];
    effects_names(view->fault_record, ", ", lacking, sizeof lacking);
    if (tag) {
        int used = snprintf(where, sizeof where, "section ");
        for (int k = 0; k < 4; k++) {
            unsigned char c = (unsigned char)(tag >> (8 * k));
            used += snprintf(where + used, sizeof where - used, c > 32 && c < 127 ? "%c" : "\\x%02x", c);
        }
        if (status == STATUS_BANK_INDEX || status == STATUS_BANK_NONFINITE)
            snprintf(where + used, sizeof where - used, ", record %u", view->fault_record);
    }
    if (status == STATUS_BANK_LENGTH && !tag && length >= sizeof *h)
        return failure_set(why, status, path, NULL, "the bank is cut short or too long: %zu bytes, its header says %u",
                           length, h->total_bytes);
    if (status == STATUS_BANK_VERSION && !tag)
        return failure_set(
            why, status, path, h->format_version > BANK_FORMAT_VERSION ? "upgrade this program" : "rebuild the bank",
            "the bank has format version %u; this program reads %d", h->format_version, BANK_FORMAT_VERSION);
    if (status == STATUS_BANK_ABI)
        return failure_set(why, status, path, NULL, "the bank wants firmware ABI %u; this image has %d", h->image_abi,
                           FIRMWARE_ABI);
    if (status == STATUS_BANK_EFFECT)
        return failure_set(why, status, path, NULL, "the bank asks for the effect %s, which this image lacks", lacking);
    return failure_set(why, (enum status)status, path, NULL, "%s (%s)", status_meaning(status), where);
}

static int read_provenance(struct bank_file *bank, struct failure *why)
{
    const struct bank_section *s = bank_view_section(&bank->view, BANK_PROV);
    if (!s || s->version != 1 || s->length == 0)
        return STATUS_OK;
    int status = provenance_parse((const char *)bank->bytes + s->offset, s->length, bank->path, &bank->provenance, why);
    if (status)
        return status;
    bank->scene_text = bank->provenance.scene;
    memcpy(bank->mesh_path, bank->provenance.mesh_path, sizeof bank->mesh_path);
    if (bank->scene_text &&
        crc32_update(0, bank->scene_text, strlen(bank->scene_text)) != bank->view.header->scene_hash)
        return failure_set(why, STATUS_BANK_CRC, bank->path, NULL, "the scene in section PROV is not the header's");
    return STATUS_OK;
}

int bank_load(const char *path, struct bank_file *bank, struct failure *why)
{
    *bank = (struct bank_file){0};
    snprintf(bank->path, sizeof bank->path, "%s", path);
    int status = file_load(path, &bank->bytes, &bank->length, why);
    if (status)
        return status;
    if ((uintptr_t)bank->bytes % BANK_ALIGNMENT) {
        unsigned char *aligned = aligned_alloc(BANK_ALIGNMENT, (bank->length / BANK_ALIGNMENT + 1) * BANK_ALIGNMENT);
        if (aligned)
            memcpy(aligned, bank->bytes, bank->length);
        free(bank->bytes);
        bank->bytes = aligned;
        if (!aligned)
            return failure_set(why, STATUS_MEMORY, path, NULL, "no memory to read the bank");
    }
    status = bank_view_open(&bank->view, bank->bytes, bank->length);
    if (status)
        status = bank_refusal(status, &bank->view, bank->bytes, bank->length, path, why);
    else
        status = read_provenance(bank, why);
    if (!status)
        status = rows_in_memory(&bank->view, &bank->rows, why);
    if (status)
        bank_unload(bank);
    return status;
}

void bank_unload(struct bank_file *bank)
{
    provenance_free(&bank->provenance);
    rows_in_memory_free(&bank->rows);
    free(bank->bytes);
    *bank = (struct bank_file){0};
}

struct scene *bank_scene(const struct bank_file *bank)
{
    struct scene *scene = bank->scene_text ? calloc(1, sizeof *scene) : NULL;
    struct failure ignored;
    if (scene && !scene_parse(bank->scene_text, strlen(bank->scene_text), "the bank's scene", scene, &ignored))
        return scene;
    free(scene);
    return NULL;
}

/* `file` as seen from the folder of `out`, or "" when that cannot be told. */
static void relative_path(const char *file, const char *out, char *relative, size_t room)
{
    char copy[PATH_MAX], from[PATH_MAX], to[PATH_MAX];
    *relative = 0;
    snprintf(copy, sizeof copy, "%s", out);
    if (!realpath(dirname(copy), from) || !realpath(file, to))
        return;
    size_t common = 0, used = 0; /* length of the common part, up to a '/' in both */
    if (!strcmp(from, "/"))
        *from = 0;
    for (size_t k = 0;; k++) {
        if ((from[k] == '/' || !from[k]) && to[k] == '/')
            common = k;
        if (!from[k] || from[k] != to[k])
            break;
    }
    char text[4 * PATH_MAX];
    for (const char *p = from + common; *p; p++)
        if (*p == '/')
            used += (size_t)sprintf(text + used, "../");
    used += (size_t)sprintf(text + used, "%s", to + common + 1);
    if (used < room)
        memcpy(relative, text, used + 1);
}

int bank_measure(struct bank_view *view, const struct compliance *G, const struct compressed *compressed, size_t trials,
                 uint64_t seed, struct compression_error *error, struct failure *why)
{
    struct rows_in_memory rows;
    int status = rows_in_memory(view, &rows, why);
    size_t *start = malloc((view->row_count + 1) * sizeof *start);
    if (!status && !start)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory to measure the bank");
    if (!status) {
        struct contact_surface surface = {.vertices = view->vertex_count,
                                          .triangles = view->triangle_count,
                                          .triangle = view->triangles,
                                          .positions = view->positions,
                                          .normals = view->normals,
                                          .row_of = view->row_of,
                                          .regularisation_m_N = (double)view->contact->regularisation_m_N};
        struct factor factor = {.rows = view->row_count, .start = start, .block = rows.block};
        if (compressed) {
            factor.rounding.step = (double)view->factor.header->step;
            for (uint32_t i = 0; i <= view->row_count; i++)
                start[i] = rows.start[i];
        }
        status =
            compression_error_measure(&surface, G, compressed ? compressed->order.at : NULL,
                                      compressed ? &factor : NULL, COMPRESSION_ERROR_ALL, trials, seed, error, why);
    }
    free(start);
    rows_in_memory_free(&rows);
    return status;
}

/* The bank as it lies in the file, opened as a controller would: its forces against those of G, and against direct solves
 * that share nothing with G. The two differ in what they draw (3-dimensional and along the normals), not in kind. */
static int measure(const struct file_writer *writer, struct body *body, const struct compliance *G,
                   const struct compressed *compressed, bool quiet, struct compression_error *error,
                   struct failure *why)
{
    void *bytes = mmap(NULL, writer->length, PROT_READ, MAP_SHARED, writer->descriptor, 0);
    if (bytes == MAP_FAILED)
        return failure_set(why, STATUS_FILE_READ, writer->path, NULL, "cannot map the bank that was written");
    struct progress bar;
    progress_start(&bar, "measuring the bank", quiet);
    struct bank_view view;
    struct force_error direct = {0};
    int status = bank_view_open(&view, bytes, writer->length);
    if (status)
        status = bank_refusal(status, &view, bytes, writer->length, writer->path, why);
    if (!status)
        status = force_error_measure(&view, body, FORCE_ERROR_TRIALS, FORCE_ERROR_SEED, &bar, &direct, why);
    if (!status)
        status = bank_measure(&view, G, compressed, COMPRESSION_TRIALS, COMPRESSION_SEED, error, why);
    const struct error_figures *patch = &error->of[COMPRESSION_ERROR_PATCH];
    if (!status && direct.p95 > FORCE_ERROR_AGREE * patch->max + FORCE_ERROR_ROUNDING)
        status = failure_set(why, STATUS_CHECK_FAILED, writer->path, "report this",
                             "the bank's forces differ from direct solves by %.2e, from its own compliance by %.2e",
                             direct.p95, patch->max);
    progress_end(&bar);
    munmap(bytes, writer->length);
    return status;
}

static int print_provenance(const struct body *body, const struct build_result *result, char *scene,
                            const char *bank_path, char **text, size_t *length, struct failure *why)
{
    struct provenance p = {.scene = scene,
                           .program = "trocar",
                           .nodes = result->nodes,
                           .tetrahedra = result->elements,
                           .build_seconds = result->seconds,
                           .force_error_p95 = result->force_error_p95,
                           .force_error_max = result->force_error_max,
                           .step = result->step};
    compression_error_print(&result->error, p.measured, sizeof p.measured);
    snprintf(p.discretisation, sizeof p.discretisation, "%s", result->discretisation);
    snprintf(p.mesh_path, sizeof p.mesh_path, "%s", body->scene.mesh_path);
    relative_path(body->scene.mesh_path, bank_path, p.mesh_from_bank, sizeof p.mesh_from_bank);
    return provenance_print(&p, text, length, why);
}

/* Bytes of section PROV at most: its text with numbers as long as they get. */
static int longest_provenance(const struct body *body, const struct build_result *result, char *scene,
                              const char *bank_path, double *bytes, struct failure *why)
{
    struct build_result widest = *result;
    widest.seconds = 1e6;
    widest.step = 1.23456e-5;
    for (int k = 0; k < COMPRESSION_ERROR_KINDS; k++)
        widest.error.of[k] = (struct error_figures){1.23e-7, 1.23e-7}; /* 1.23e-05 per cent */
    char *text;
    size_t length;
    int status = print_provenance(body, &widest, scene, bank_path, &text, &length, why);
    if (!status)
        free(text);
    *bytes = status ? 0 : compression_padded(length);
    return status;
}

static int write_provenance(struct pack *pack, const struct body *body, const struct build_result *result, char *scene,
                            struct file_writer *writer, struct failure *why)
{
    char *text;
    size_t length;
    int status = print_provenance(body, result, scene, writer->path, &text, &length, why);
    if (status)
        return status;
    status = pack_provenance(pack, text, length, writer, why);
    free(text);
    return status;
}

/* The scene as its text in the bank reads: what is checked later is that text, and reading may round the last bit of a number
 * otherwise. NULL after a failure. */
static struct scene *scene_as_written(const char *scene_text, const char *path, struct failure *why)
{
    struct scene *scene = malloc(sizeof *scene);
    if (!scene)
        failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the scene");
    else if (scene_parse(scene_text, strlen(scene_text), path, scene, why)) {
        free(scene);
        scene = NULL;
    }
    return scene;
}

/* The sections of effects: before the budget is looked at, which they count towards. */
static int set_effects(struct body *body, const char *scene_text, struct pack *pack, struct failure *why)
{
    struct scene *scene = scene_as_written(scene_text, body->scene.path, why);
    int status = scene ? pack_effects(pack, scene, body, why) : why->status;
    free(scene);
    return status;
}

/* Contact and instruments. */
static int set_records(const char *scene_text, const char *path, double median_m_N, struct pack *pack,
                       struct failure *why)
{
    struct scene *scene = scene_as_written(scene_text, path, why);
    int status = scene ? STATUS_OK : why->status;
    if (!status)
        scene_contact(scene, median_m_N, &pack->contact);
    for (size_t i = 0; i < pack->tools && !status; i++)
        status = scene_tool(&scene->instrument[i], &pack->tool[i], why);
    pack->scene_hash = crc32_update(0, scene_text, strlen(scene_text));
    free(scene);
    return status;
}

int bank_compress(const struct body *body, const struct compliance *G, const struct pack *pack,
                  const struct compression *wanted, bool quiet, struct compressed *compressed, struct failure *why)
{
    double *position = malloc(3 * G->rows * sizeof *position);
    uint16_t *row_of = malloc(pack->vertices * sizeof *row_of);
    int status = position && row_of ? STATUS_OK : failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the rows");
    for (size_t v = 0; v < pack->vertices && !status; v++) {
        row_of[v] = G->row_of[v] == UINT32_MAX ? BANK_NONE : (uint16_t)G->row_of[v];
        for (int k = 0; k < 3 && row_of[v] != BANK_NONE; k++)
            position[3 * row_of[v] + k] = body->mesh.nodes[3 * body->surface.node[v] + k];
    }
    struct contact_surface surface = {.vertices = pack->vertices,
                                      .triangles = pack->triangles,
                                      .triangle = pack->triangle,
                                      .positions = pack->positions,
                                      .normals = pack->normals,
                                      .row_of = row_of,
                                      .regularisation_m_N = (double)pack->contact.regularisation_m_N};
    if (!status)
        status = compress_compliance(G, position, &surface, wanted, quiet, compressed, why);
    free(position);
    free(row_of);
    return status;
}

/* From the compliance to the bank's bytes behind `writer`, without provenance, and their errors. */
static int write_bank(struct body *body, struct pack *pack, const struct compliance *G, const char *scene_text,
                      const struct compression *wanted, bool quiet, struct file_writer *writer,
                      struct build_result *result, struct failure *why)
{
    struct compressed compressed = {0};
    int status = set_records(scene_text, body->scene.path, G->median_diagonal_m_N, pack, why);
    if (!status && !wanted->plain)
        status = bank_compress(body, G, pack, wanted, quiet, &compressed, why);
    if (status == STATUS_BANK_LIMIT)
        snprintf(why->place, sizeof why->place, "%s", body->scene.path);
    if (!status && !wanted->plain) {
        pack_compressed(pack, &compressed);
        result->step = compressed.step;
        result->default_bytes = compressed.default_bytes;
        result->default_error = compressed.default_error;
    }
    if (!status)
        status = budget_instructions_fit(&body->scene, wanted->plain ? NULL : &compressed, &pack->contact,
                                         &result->instructions, why);
    result->row_work = pack->contact.row_work;
    if (!status)
        status = pack_write(pack, G, wanted->plain ? NULL : &compressed, writer, quiet, why);
    if (!status)
        status = measure(writer, body, G, wanted->plain ? NULL : &compressed, quiet, &result->error, why);
    compressed_free(&compressed);
    return status;
}

/* Found in BANK.part, or built, and then kept there if it took `keep_after_s`. */
static int find_compliance(struct body *body, const struct resume *resume, double keep_after_s, bool quiet,
                           struct compliance *G, struct failure *why)
{
    if (resume_load(resume, body, G))
        return STATUS_OK;
    double begin_s = seconds_now();
    int status = compliance_build(body->model, quiet, G, why);
    if (!status && seconds_now() - begin_s >= keep_after_s)
        status = resume_save(resume, body, G, why);
    return status;
}

static int build(struct body *body, const struct compression *compression, double keep_after_s, bool quiet,
                 struct file_writer *writer, double started_s, struct build_result *result, struct failure *why)
{
    struct resume resume = {0};
    struct pack pack = {0};
    struct compliance G = {0};
    char *scene_text = NULL;
    const struct scene *scene = &body->scene;
    struct compression wanted = compression ? *compression : (struct compression){0};
    double provenance_bytes = 0;
    result->nodes = body->mesh.node_count;
    result->elements = body->mesh.tetrahedron_count;
    result->surface_nodes = body->surface.vertex_count;
    result->unknowns = model_unknowns(body->model);
    result->discretisation = model_discretisation(body->model);
    int status = pack_prepare(&pack, &body->mesh, &body->surface, model_fixed_vertices(body->model),
                              scene->instrument_count, why);
    result->rows = pack.rows;
    if (!status && !(scene_text = scene_print(scene)))
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the scene");
    if (!status)
        status = set_effects(body, scene_text, &pack, why);
    if (!status)
        status = longest_provenance(body, result, scene_text, writer->path, &provenance_bytes, why);
    if (!status)
        status = budget_begin(scene, &pack, provenance_bytes, &wanted, why);
    if (!status)
        status = resume_begin(writer->path, body, scene_text, &resume, why);
    if (!status)
        status = find_compliance(body, &resume, keep_after_s, quiet, &G, why);
    result->median_compliance_m_N = G.median_diagonal_m_N;
    if (!status)
        status = write_bank(body, &pack, &G, scene_text, &wanted, quiet, writer, result, why);
    compliance_free(&G);
    const struct error_figures *patch = &result->error.of[COMPRESSION_ERROR_PATCH];
    result->force_error_p95 = patch->p95;
    result->force_error_max = patch->max;
    if (!status && wanted.force_error > 0 && patch->p95 > wanted.force_error) /* as written; the search kept it */
        status = failure_set(why, STATUS_BANK_LIMIT, scene->path, NULL,
                             "the bank's force error is %.4g %%, the limit %.4g %%", 100 * patch->p95,
                             100 * wanted.force_error);
    result->seconds = seconds_now() - started_s;
    if (!status)
        status = write_provenance(&pack, body, result, scene_text, writer, why);
    result->bytes = writer->length;
    if (!status)
        status = file_commit(writer, why);
    if (status == STATUS_INTERRUPTED && resume_is_there(&resume))
        failure_set(why, status, resume.path, "run it again, it goes on from there; or remove the file",
                    "interrupted; the compliance is kept");
    else
        resume_end(&resume);
    free(scene_text);
    pack_free(&pack);
    return status;
}

int bank_build(struct scene *scene, const char *out_path, const struct compression *compression, double keep_after_s,
               bool quiet, struct build_result *result, struct failure *why)
{
    double started_s = seconds_now();
    struct file_writer writer;
    *result = (struct build_result){0};
    int status = file_begin(&writer, out_path, why);
    if (status)
        return status;
    struct body *body = malloc(sizeof *body);
    if (!body)
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the body");
    if (!status)
        status = body_from_scene(scene, body, &result->mesh, why);
    if (!status) {
        *scene = body->scene;
        status = scene_check_reach(scene, &body->mesh, &body->surface, why);
        if (!status)
            status = build(body, compression, keep_after_s, quiet, &writer, started_s, result, why);
        body_close(body);
    }
    free(body);
    file_abandon(&writer);
    struct rusage self, children;
    getrusage(RUSAGE_SELF, &self);
    getrusage(RUSAGE_CHILDREN, &children);
    long most_kib = self.ru_maxrss > children.ru_maxrss ? self.ru_maxrss : children.ru_maxrss;
    result->peak_rss_bytes = 1024.0 * (double)most_kib;
    result->seconds = seconds_now() - started_s;
    return status;
}
