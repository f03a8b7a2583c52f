#include "candidate.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "crc.h"
#include "pack.h"
#include "refine.h"
#include "row.h"
#include "worst_tick.h"

/* The body again on its mesh refined once. */
static int refine_body(struct body *body, struct failure *why)
{
    struct mesh fine;
    int status = refine_mesh(&body->mesh, &fine, NULL, why);
    if (status)
        return status;
    model_free(body->model);
    body->model = NULL;
    surface_free(&body->surface);
    mesh_free(&body->mesh);
    body->mesh = fine;
    status = mesh_surface(&body->mesh, &body->surface, why);
    return status ? status : model_create(&body->scene, &body->mesh, &body->surface, &body->model, why);
}

int discretise(const struct scene *scene, const struct setting *setting, bool quiet, struct discretisation *d,
               struct failure *why)
{
    double started_s = seconds_now();
    *d = (struct discretisation){0};
    struct scene *wanted = malloc(sizeof *wanted);
    if (!wanted)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the scene");
    *wanted = *scene;
    knob_apply(setting, wanted);
    int status = body_from_scene(wanted, &d->body, &d->mesh, why);
    free(wanted);
    for (int k = 0; k < (int)setting->value[KNOB_REFINE] && !status; k++)
        status = refine_body(&d->body, why);
    if (!status)
        status = compliance_build(d->body.model, quiet, &d->compliance, why);
    d->seconds = seconds_now() - started_s;
    if (status)
        discretisation_free(d);
    return status;
}

void discretisation_free(struct discretisation *d)
{
    compliance_free(&d->compliance);
    body_close(&d->body);
}

/* Those that are turned off are not in it; the others as set. */
static struct worst_effects effects_as_set(const struct scene *scene, const struct setting *setting)
{
    struct worst_effects effects = worst_tick_effects(scene);
    if (scene->effects.named & EFFECT_FRICTION)
        effects.sweeps = (unsigned)setting->value[KNOB_SWEEPS];
    return effects;
}

static unsigned points_as_set(const struct scene *scene, const struct setting *setting)
{
    return (unsigned)setting->value[KNOB_POINTS] * (unsigned)scene->instrument_count;
}

double candidate_worst_tick(const struct candidate *c, const struct body *body, const struct setting *setting)
{
    return worst_tick(c->view.contact, effects_as_set(&body->scene, setting), points_as_set(&body->scene, setting),
                      row_max_blocks(&c->view));
}

/* The share of a tick for rows: as set, else what the scene's budget leaves (the least when it leaves none). */
static void set_row_work(const struct scene *scene, const struct setting *setting, uint32_t max_blocks,
                         struct bank_contact *contact)
{
    worst_tick_fit(contact, effects_as_set(scene, setting), points_as_set(scene, setting), max_blocks,
                   scene->budget_instructions);
    if (setting->value[KNOB_ROW_WORK] > 0)
        contact->row_work = (uint16_t)setting->value[KNOB_ROW_WORK];
}

/* The records that follow from scene and setting: contact, instruments and effects of `pack`, row_work left out. */
static int records(struct body *body, const struct setting *setting, double median_m_N, struct pack *pack,
                   struct failure *why)
{
    struct scene *scene = malloc(sizeof *scene);
    if (!scene)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the scene");
    *scene = body->scene;
    knob_apply(setting, scene);
    scene_contact(scene, median_m_N, &pack->contact);
    int status = STATUS_OK;
    for (size_t i = 0; i < scene->instrument_count && !status; i++)
        status = scene_tool(&scene->instrument[i], &pack->tool[i], why);
    if (!status)
        status = pack_effects(pack, scene, body, why);
    free(scene);
    return status;
}

/* Prepare, compress, write; `compressed` is left for the measurement. */
static int store(struct discretisation *d, const struct setting *setting, const char *path, bool quiet,
                 struct compressed *compressed, struct failure *why)
{
    struct pack pack = {0};
    struct file_writer writer = {.descriptor = -1};
    const struct scene *scene = &d->body.scene;
    struct compression wanted = {.plain = setting->value[KNOB_STEP] == 0, .step = setting->value[KNOB_STEP]};
    char *text = scene_print(scene), *document = NULL;
    struct provenance provenance = {.scene = text,
                                    .program = "trocar tradeoff",
                                    .nodes = d->body.mesh.node_count,
                                    .tetrahedra = d->body.mesh.tetrahedron_count,
                                    .force_error_p95 = -1,
                                    .force_error_max = -1};
    size_t length = 0;
    int status = text ? STATUS_OK : failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the scene");
    snprintf(provenance.discretisation, sizeof provenance.discretisation, "%s", model_discretisation(d->body.model));
    snprintf(provenance.mesh_path, sizeof provenance.mesh_path, "%s", scene->mesh_path);
    if (!status)
        status = pack_prepare(&pack, &d->body.mesh, &d->body.surface, model_fixed_vertices(d->body.model),
                              scene->instrument_count, why);
    if (!status)
        status = records(&d->body, setting, d->compliance.median_diagonal_m_N, &pack, why);
    if (!status)
        pack.scene_hash = crc32_update(0, text, strlen(text));
    if (!status && !wanted.plain)
        status = bank_compress(&d->body, &d->compliance, &pack, &wanted, quiet, compressed, why);
    if (!status && !wanted.plain)
        pack_compressed(&pack, compressed);
    if (!status)
        status = file_begin(&writer, path, why);
    if (!status)
        status = pack_write(&pack, &d->compliance, wanted.plain ? NULL : compressed, &writer, quiet, why);
    if (!status)
        status = provenance_print(&provenance, &document, &length, why);
    if (!status)
        status = pack_provenance(&pack, document, length, &writer, why);
    if (!status)
        status = file_commit(&writer, why);
    file_abandon(&writer);
    pack_free(&pack);
    free(document);
    free(text);
    return status;
}

int candidate_make(struct discretisation *d, const struct setting *setting, const char *folder, size_t trials,
                   uint64_t seed, bool quiet, struct candidate *c, struct failure *why)
{
    double started_s = seconds_now();
    struct compressed compressed = {0};
    *c = (struct candidate){0};
    snprintf(c->path, sizeof c->path, "%s/candidate.bank", folder);
    int status = store(d, setting, c->path, quiet, &compressed, why);
    c->seconds = seconds_now() - started_s;
    if (!status)
        status = bank_load(c->path, &c->bank, why);
    if (!status)
        status = bank_view_open(&c->view, c->bank.bytes, c->bank.length);
    if (!status && trials)
        status = bank_measure(&c->view, &d->compliance, setting->value[KNOB_STEP] == 0 ? NULL : &compressed, trials,
                              seed, &c->error, why);
    if (!status) /* without the rows that were decoded for the measurement */
        status = bank_view_open(&c->view, c->bank.bytes, c->bank.length);
    compressed_free(&compressed);
    if (status)
        candidate_free(c);
    return status;
}

/* A section's new bytes, and the sums over it. */
static void replace(struct bank_file *bank, uint32_t tag, const void *bytes)
{
    struct bank_header *h = (struct bank_header *)bank->bytes;
    struct bank_section *section = (struct bank_section *)(bank->bytes + sizeof *h);
    for (uint32_t k = 0; k < h->section_count; k++) {
        if (section[k].tag != tag)
            continue;
        memcpy(bank->bytes + section[k].offset, bytes, section[k].length);
        size_t padded = (section[k].length + BANK_ALIGNMENT - 1) / BANK_ALIGNMENT * BANK_ALIGNMENT;
        section[k].crc = crc32_update(0, bank->bytes + section[k].offset, padded);
    }
    h->table_crc = crc32_update(0, section, h->section_count * sizeof *section);
    h->header_crc = crc32_update(0, h, sizeof *h - sizeof h->header_crc);
}

int candidate_retool(struct candidate *c, struct body *body, const struct setting *setting, struct failure *why)
{
    struct pack pack = {0};
    int status = records(body, setting, (double)c->view.contact->typical_compliance_m_N, &pack, why);
    pack.contact.regularisation_m_N = c->view.contact->regularisation_m_N; /* not rounded twice */
    if (!status) {
        set_row_work(&body->scene, setting, row_max_blocks(&c->view), &pack.contact);
        replace(&c->bank, BANK_CONT, &pack.contact);
        replace(&c->bank, BANK_TOOL, pack.tool);
    }
    for (size_t e = 0; e < pack.effect_sections && !status; e++)
        replace(&c->bank, pack.effect_tag[e], pack.effect[e].bytes);
    pack_free(&pack);
    if (status)
        return status;
    status = file_replace(c->path, c->bank.bytes, c->bank.length, why);
    if (status)
        return status;
    status = bank_view_open(&c->view, c->bank.bytes, c->bank.length);
    return status ? bank_refusal(status, &c->view, c->bank.bytes, c->bank.length, c->path, why) : STATUS_OK;
}

void candidate_free(struct candidate *c)
{
    bank_unload(&c->bank);
    if (*c->path)
        unlink(c->path);
}
