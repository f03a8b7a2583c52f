/* trocar info BANK: what a bank holds. */
#include <getopt.h>
#include <json-c/json.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "bank.h"
#include "cli.h"
#include "open_bank.h"

static const char usage[] =
    "usage: trocar info BANK [--json]\n"
    "       trocar info --effects BANK|SCENE.yaml\n"
    "\n"
    "Prints header, sections, contact, instruments and provenance of a bank, after checking it\n"
    "as a controller would.\n"
    "\n"
    "      --json      one JSON object on stdout\n"
    "      --effects   only the names of the effects that a bank or a scene asks for, in one line:\n"
    "                  those that the controller's image must have\n";

static void tag_text(uint32_t tag, char text[5])
{
    for (int k = 0; k < 4; k++) {
        unsigned char c = (unsigned char)(tag >> (8 * k));
        text[k] = c > 31 && c < 127 ? (char)c : '?';
    }
    text[4] = 0;
}

static void print_sections(const struct bank_view *view)
{
    printf("  section version  flags          count       bytes   share\n");
    for (uint32_t k = 0; k < view->header->section_count; k++) {
        const struct bank_section *s = &view->sections[k];
        char tag[5];
        tag_text(s->tag, tag);
        printf("  %-7s %7u  %-9s %10u  %10u  %5.1f %%\n", tag, s->version,
               s->flags & BANK_REQUIRED    ? "required"
               : s->flags & BANK_HOST_ONLY ? "host only"
                                           : "optional",
               s->count, s->length, 100.0 * s->length / view->header->total_bytes);
    }
}

static void print_tool(const struct bank_tool *t, uint32_t index)
{
    printf("instrument %u: trocar at (%.4g, %.4g, %.4g) m, axis (%.4g, %.4g, %.4g); tip radius %.4g m, %u points\n",
           index, (double)t->trocar_m[0], (double)t->trocar_m[1], (double)t->trocar_m[2], (double)t->rotation[2],
           (double)t->rotation[5], (double)t->rotation[8], (double)t->tip_radius_m, t->point_count);
    static const char *const name[3] = {"alpha", "beta", "insertion"}, *const unit[3] = {"rad", "rad", "m"};
    for (int k = 0; k < 3; k++)
        printf("  %-9s %.4g .. %.4g %s, %.4g %s per count of %u, at most %.4g %s/s and %.4g %s\n", name[k],
               (double)t->axis[k].minimum, (double)t->axis[k].maximum, unit[k], (double)t->axis[k].per_count, unit[k],
               t->axis[k].count_modulus, (double)t->axis[k].speed_limit, unit[k], (double)t->axis[k].effort_limit,
               k < 2 ? "N m" : "N");
}

static void print_text(const struct bank_file *bank)
{
    const struct bank_view *v = &bank->view;
    const struct bank_contact *c = v->contact;
    char effects[400];
    effects_names(v->header->effects, ", ", effects, sizeof effects);
    printf("%s: format %u, %u bytes, firmware ABI %u or newer, effects: %s\n", bank->path, v->header->format_version,
           v->header->total_bytes, v->header->image_abi, effects);
    printf("scene CRC-32 %08x, mesh CRC-32 %08x\n", v->header->scene_hash, v->header->mesh_hash);
    printf("surface: %u vertices (%u free), %u triangles; grid %u x %u x %u cells of %.4g m, at most %u triangles in "
           "one\n",
           v->vertex_count, v->row_count, v->triangle_count, v->grid->cells[0], v->grid->cells[1], v->grid->cells[2],
           (double)v->grid->cell_m, v->grid->max_in_cell);
    print_sections(v);
    printf("contact: regularisation %.3g m/N (median compliance %.3g m/N), coupling %.4g N/m and %.3g N s/m,\n"
           "  force at most %.3g N and %.4g N/s, decay %.3g s\n",
           (double)c->regularisation_m_N, (double)c->typical_compliance_m_N, (double)c->coupling_stiffness_N_m,
           (double)c->coupling_damping_Ns_m, (double)c->force_limit_N, (double)c->force_rate_N_s, (double)c->decay_s);
    for (uint32_t i = 0; i < v->tool_count; i++)
        print_tool(&v->tools[i], i);
    const struct provenance *p = &bank->provenance;
    if (!bank_view_section(v, BANK_PROV)) {
        puts("no provenance");
        return;
    }
    printf("built by %s from %s: %llu nodes, %llu tetrahedra, %s, %.1f s\n", p->program, p->mesh_path,
           (unsigned long long)p->nodes, (unsigned long long)p->tetrahedra, p->discretisation, p->build_seconds);
    if (p->force_error_max >= 0)
        printf("force error %.1e (p95), %.1e (max)\n", p->force_error_p95, p->force_error_max);
    if (p->scene)
        printf("scene:\n%s", p->scene);
}

static void add_number(struct json_object *to, const char *key, double value)
{
    json_object_object_add(to, key, json_object_new_double(value));
}

static void add_whole(struct json_object *to, const char *key, uint64_t value)
{
    json_object_object_add(to, key, json_object_new_int64((int64_t)value));
}

static void add_text(struct json_object *to, const char *key, const char *value)
{
    json_object_object_add(to, key, json_object_new_string(value));
}

static struct json_object *vector(const float *x, int n)
{
    struct json_object *array = json_object_new_array();
    for (int k = 0; k < n; k++)
        json_object_array_add(array, json_object_new_double((double)x[k]));
    return array;
}

static struct json_object *json_sections(const struct bank_view *v)
{
    struct json_object *array = json_object_new_array();
    for (uint32_t k = 0; k < v->header->section_count; k++) {
        const struct bank_section *s = &v->sections[k];
        struct json_object *entry = json_object_new_object();
        char tag[5];
        tag_text(s->tag, tag);
        add_text(entry, "tag", tag);
        add_whole(entry, "version", s->version);
        json_object_object_add(entry, "required", json_object_new_boolean(s->flags & BANK_REQUIRED));
        json_object_object_add(entry, "host_only", json_object_new_boolean(s->flags & BANK_HOST_ONLY));
        add_whole(entry, "count", s->count);
        add_whole(entry, "offset", s->offset);
        add_whole(entry, "bytes", s->length);
        add_number(entry, "share", (double)s->length / v->header->total_bytes);
        json_object_array_add(array, entry);
    }
    return array;
}

static struct json_object *json_tools(const struct bank_view *v)
{
    struct json_object *array = json_object_new_array();
    for (uint32_t i = 0; i < v->tool_count; i++) {
        const struct bank_tool *t = &v->tools[i];
        struct json_object *entry = json_object_new_object();
        json_object_object_add(entry, "trocar_m", vector(t->trocar_m, 3));
        json_object_object_add(entry, "rotation", vector(t->rotation, 9));
        add_number(entry, "tip_radius_m", (double)t->tip_radius_m);
        add_whole(entry, "points", t->point_count);
        json_object_array_add(array, entry);
    }
    return array;
}

static void print_json(const struct bank_file *bank)
{
    const struct bank_view *v = &bank->view;
    const struct provenance *p = &bank->provenance;
    struct json_object *root = json_object_new_object(), *contact = json_object_new_object();
    add_whole(root, "format_version", v->header->format_version);
    add_whole(root, "bytes", v->header->total_bytes);
    add_whole(root, "image_abi", v->header->image_abi);
    struct json_object *effects = json_object_new_array();
    for (size_t i = 0; i < effects_count(); i++)
        if (v->header->effects & effects_at(i)->bit)
            json_object_array_add(effects, json_object_new_string(effects_at(i)->name));
    json_object_object_add(root, "effects", effects);
    add_whole(root, "scene_crc32", v->header->scene_hash);
    add_whole(root, "mesh_crc32", v->header->mesh_hash);
    add_whole(root, "surface_nodes", v->vertex_count);
    add_whole(root, "free_surface_nodes", v->row_count);
    add_whole(root, "triangles", v->triangle_count);
    json_object_object_add(root, "sections", json_sections(v));
    add_number(contact, "regularisation_m_N", (double)v->contact->regularisation_m_N);
    add_number(contact, "coupling_stiffness_N_m", (double)v->contact->coupling_stiffness_N_m);
    add_number(contact, "coupling_damping_Ns_m", (double)v->contact->coupling_damping_Ns_m);
    add_number(contact, "force_limit_N", (double)v->contact->force_limit_N);
    add_number(contact, "force_rate_N_s", (double)v->contact->force_rate_N_s);
    add_number(contact, "decay_s", (double)v->contact->decay_s);
    add_number(contact, "typical_compliance_m_N", (double)v->contact->typical_compliance_m_N);
    json_object_object_add(root, "contact", contact);
    json_object_object_add(root, "instruments", json_tools(v));
    if (bank_view_section(v, BANK_PROV)) {
        struct json_object *made = json_object_new_object();
        add_text(made, "program", p->program);
        add_text(made, "mesh_path", p->mesh_path);
        add_text(made, "discretisation", p->discretisation);
        add_whole(made, "nodes", p->nodes);
        add_whole(made, "tetrahedra", p->tetrahedra);
        add_number(made, "build_seconds", p->build_seconds);
        if (p->force_error_max >= 0) {
            add_number(made, "force_error_p95", p->force_error_p95);
            add_number(made, "force_error_max", p->force_error_max);
        }
        if (p->scene)
            add_text(made, "scene", p->scene);
        json_object_object_add(root, "provenance", made);
    }
    puts(json_object_to_json_string_ext(root, JSON_C_TO_STRING_SPACED | JSON_C_TO_STRING_NOSLASHESCAPE));
    json_object_put(root);
}

/* Names with spaces between; an empty line when there is none. */
static int print_effects(const char *path, struct failure *why)
{
    char names[400];
    uint32_t bits = 0;
    int status;
    if (is_scene(path)) {
        struct scene *scene = malloc(sizeof *scene);
        if (!scene)
            return failure_set(why, STATUS_MEMORY, path, NULL, "no memory for the scene");
        status = scene_read(path, scene, why);
        bits = scene->effects.named;
        free(scene);
    } else {
        struct bank_file bank;
        status = load_bank(path, &bank, why);
        if (!status) {
            bits = bank.view.header->effects;
            bank_unload(&bank);
        }
    }
    if (status)
        return status;
    effects_names(bits, " ", names, sizeof names);
    puts(bits ? names : "");
    return STATUS_OK;
}

int verb_info(int argc, char **argv, struct failure *why)
{
    static const struct option longs[] = {
        {"json", no_argument, NULL, 'j'}, {"effects", no_argument, NULL, 'e'}, {"help", no_argument, NULL, 'h'}, {0}};
    bool json = false, effects = false;
    int answer;
    opterr = 0;
    optind = 0; /* GNU: start over */
    while ((answer = getopt_long(argc, argv, ":h", longs, NULL)) != -1) {
        if (answer == 'j')
            json = true;
        else if (answer == 'e')
            effects = true;
        else if (answer == 'h') {
            fputs(usage, stdout);
            return STATUS_OK;
        } else
            return cli_bad_option("info", answer, argv, why);
    }
    if (optind != argc - 1)
        return failure_set(why, STATUS_USAGE, NULL, "see trocar info --help", "info takes one bank");
    if (effects)
        return print_effects(argv[optind], why);
    struct bank_file bank;
    int status = load_bank(argv[optind], &bank, why);
    if (status)
        return status;
    if (json)
        print_json(&bank);
    else
        print_text(&bank);
    bank_unload(&bank);
    return STATUS_OK;
}
