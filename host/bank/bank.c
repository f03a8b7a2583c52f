#include "bank.h"

#include <libgen.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include "crc.h"
#include "force_error.h"
#include "pack.h"
#include "tick.h" /* FIRMWARE_ABI */

enum { FORCE_ERROR_TRIALS = 20, FORCE_ERROR_SEED = 1 };

int bank_refusal(int status, const struct bank_view *view, const void *bytes, size_t length, const char *path,
                 struct failure *why)
{
    const struct bank_header *h = bytes;
    uint32_t tag = view->fault_tag;
    char where[80] = "header";
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
        return failure_set(why, status, path, NULL, "the bank asks for effects %#x, which this image lacks",
                           h->effects & ~(unsigned)BANK_VIEW_EFFECTS);
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
    if (status)
        bank_unload(bank);
    return status;
}

void bank_unload(struct bank_file *bank)
{
    provenance_free(&bank->provenance);
    free(bank->bytes);
    *bank = (struct bank_file){0};
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

static int check_budget(const struct scene *scene, const struct pack *pack, struct failure *why)
{
    if (scene->budget_bank_bytes > 0 && (double)pack->bytes > scene->budget_bank_bytes)
        return failure_set(why, STATUS_CHECK_FAILED, scene->path, "raise budget: bank, or use a coarser mesh",
                           "the bank will have %llu bytes, the scene allows %.0f", (unsigned long long)pack->bytes,
                           scene->budget_bank_bytes);
    return STATUS_OK;
}

/* The bank as it lies in the file, opened as a controller would, and its forces against direct solves. */
static int measure(const struct file_writer *writer, struct body *body, bool quiet, struct force_error *error,
                   struct failure *why)
{
    void *bytes = mmap(NULL, writer->length, PROT_READ, MAP_SHARED, writer->descriptor, 0);
    if (bytes == MAP_FAILED)
        return failure_set(why, STATUS_FILE_READ, writer->path, NULL, "cannot map the bank that was written");
    struct progress bar;
    progress_start(&bar, "measuring the bank", quiet);
    struct bank_view view;
    int status = bank_view_open(&view, bytes, writer->length);
    if (status)
        status = bank_refusal(status, &view, bytes, writer->length, writer->path, why);
    else
        status = force_error_measure(&view, body, FORCE_ERROR_TRIALS, FORCE_ERROR_SEED, &bar, error, why);
    progress_end(&bar);
    munmap(bytes, writer->length);
    return status;
}

static int write_provenance(struct pack *pack, const struct body *body, const struct build_result *result, char *scene,
                            struct file_writer *writer, struct failure *why)
{
    struct provenance p = {.scene = scene,
                           .program = "trocar",
                           .discretisation = BANK_DISCRETISATION,
                           .nodes = result->nodes,
                           .tetrahedra = result->elements,
                           .build_seconds = result->seconds,
                           .force_error_p95 = result->force_error_p95,
                           .force_error_max = result->force_error_max};
    snprintf(p.mesh_path, sizeof p.mesh_path, "%s", body->scene.mesh_path);
    relative_path(body->scene.mesh_path, writer->path, p.mesh_from_bank, sizeof p.mesh_from_bank);
    char *text;
    size_t length;
    int status = provenance_print(&p, &text, &length, why);
    if (!status)
        status = pack_provenance(pack, text, length, writer, why);
    free(text);
    return status;
}

/* Contact and instruments, from the scene as its text in the bank reads: what is checked later is that text, and reading
 * may round the last bit of a number otherwise. */
static int set_records(const char *scene_text, const char *path, double median_m_N, struct pack *pack,
                       struct failure *why)
{
    struct scene *scene = malloc(sizeof *scene);
    if (!scene)
        return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the scene");
    int status = scene_parse(scene_text, strlen(scene_text), path, scene, why);
    if (!status)
        scene_contact(scene, median_m_N, &pack->contact);
    for (size_t i = 0; i < pack->tools && !status; i++)
        status = scene_tool(&scene->instrument[i], &pack->tool[i], why);
    pack->scene_hash = crc32_update(0, scene_text, strlen(scene_text));
    free(scene);
    return status;
}

/* From the body to the bank's bytes behind `writer`, without provenance. */
static int write_bank(struct body *body, struct pack *pack, const char *scene_text, bool quiet,
                      struct file_writer *writer, struct build_result *result, struct failure *why)
{
    struct compliance compliance = {0};
    int status = compliance_build(body->model, quiet, &compliance, why);
    if (status)
        return status;
    result->median_compliance_m_N = compliance.median_diagonal_m_N;
    status = set_records(scene_text, body->scene.path, compliance.median_diagonal_m_N, pack, why);
    if (!status)
        status = pack_write(pack, &compliance, writer, quiet, why);
    compliance_free(&compliance);
    return status;
}

static int build(struct body *body, bool quiet, struct file_writer *writer, double started_s,
                 struct build_result *result, struct failure *why)
{
    struct pack pack = {0};
    struct force_error error = {0};
    char *scene_text = NULL;
    const struct scene *scene = &body->scene;
    result->nodes = body->mesh.node_count;
    result->elements = body->mesh.tetrahedron_count;
    result->surface_nodes = body->surface.vertex_count;
    result->unknowns = model_unknowns(body->model);
    int status = pack_prepare(&pack, &body->mesh, &body->surface, model_fixed_vertices(body->model),
                              scene->instrument_count, why);
    if (!status)
        status = check_budget(scene, &pack, why);
    result->rows = pack.rows;
    if (!status && !(scene_text = scene_print(scene)))
        status = failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the scene");
    if (!status)
        status = write_bank(body, &pack, scene_text, quiet, writer, result, why);
    if (!status)
        status = measure(writer, body, quiet, &error, why);
    result->force_error_p95 = error.p95;
    result->force_error_max = error.max;
    if (!status && scene->budget_force_error > 0 && error.max > scene->budget_force_error)
        status =
            failure_set(why, STATUS_CHECK_FAILED, scene->path, "raise budget: force_error",
                        "the bank's force error is %.2e, the scene allows %.2e", error.max, scene->budget_force_error);
    result->seconds = seconds_now() - started_s;
    if (!status)
        status = write_provenance(&pack, body, result, scene_text, writer, why);
    result->bytes = writer->length;
    if (!status)
        status = file_commit(writer, why);
    free(scene_text);
    pack_free(&pack);
    return status;
}

int bank_build(struct scene *scene, const char *out_path, bool quiet, struct build_result *result, struct failure *why)
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
        status = build(body, quiet, &writer, started_s, result, why);
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
