#include "scene.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "effects/image.h"
#include "quantity.h"

static void quantity(FILE *out, const char *before, double value, enum dimension dimension)
{
    char text[QUANTITY_TEXT];
    quantity_print(value, dimension, text);
    fprintf(out, "%s%s", before, text);
}

/* A list of three quantities. */
static void triple(FILE *out, const char *before, const double v[3], enum dimension dimension)
{
    fputs(before, out);
    for (int i = 0; i < 3; i++)
        quantity(out, i ? ", " : "[", v[i], dimension);
    fputc(']', out);
}

static void vector(FILE *out, const char *before, const double v[3])
{
    triple(out, before, v, DIMENSION_POSITION);
}

/* Words go bare, everything else in double quotes, so that no text can be read as something else. */
static void word(FILE *out, const char *before, const char *text)
{
    static const char bare[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-/";
    fputs(before, out);
    if (*text && strspn(text, bare) == strlen(text) && *text != '-' && *text != '.') {
        fputs(text, out);
        return;
    }
    fputc('"', out);
    for (; *text; text++) {
        if (*text == '"' || *text == '\\')
            fputc('\\', out);
        fputc(*text, out);
    }
    fputc('"', out);
}

static void selection(FILE *out, const struct selection *where)
{
    switch (where->kind) {
    case SELECT_BOX:
        vector(out, "box: {from: ", where->a);
        vector(out, ", to: ", where->b);
        fputc('}', out);
        break;
    case SELECT_SPHERE:
        vector(out, "sphere: {at: ", where->a);
        quantity(out, ", radius: ", where->value, DIMENSION_LENGTH);
        fputc('}', out);
        break;
    case SELECT_PLANE:
        vector(out, "plane: {at: ", where->a);
        vector(out, ", normal: ", where->b);
        fputc('}', out);
        break;
    case SELECT_LABEL:
        word(out, "label: ", where->label);
        break;
    case SELECT_PATCH:
        vector(out, "patch: {near: ", where->a);
        quantity(out, ", share: ", where->value, DIMENSION_SHARE);
        fputc('}', out);
        break;
    case SELECT_AXIS_END:
        quantity(out, "axis_end: {share: ", where->value, DIMENSION_SHARE);
        fputc('}', out);
        break;
    }
}

static void law(FILE *out, const struct scene_material *m)
{
    const struct scene_orthotropic *o = &m->orthotropic;
    switch (m->symmetry) {
    case SYMMETRY_ISOTROPIC:
        quantity(out, ", E: ", m->E_Pa, DIMENSION_PRESSURE);
        quantity(out, ", nu: ", m->nu, DIMENSION_NUMBER);
        return;
    case SYMMETRY_TRANSVERSE:
        quantity(out, ", transverse: {E_L: ", o->E_Pa[0], DIMENSION_PRESSURE);
        quantity(out, ", E_T: ", o->E_Pa[1], DIMENSION_PRESSURE);
        quantity(out, ", G_LT: ", o->G_Pa[0], DIMENSION_PRESSURE);
        quantity(out, ", nu_LT: ", o->nu[0], DIMENSION_NUMBER);
        quantity(out, ", nu_TT: ", o->nu[2], DIMENSION_NUMBER);
        break;
    case SYMMETRY_ORTHOTROPIC:
        triple(out, ", orthotropic: {E: ", o->E_Pa, DIMENSION_PRESSURE);
        triple(out, ", G: ", o->G_Pa, DIMENSION_PRESSURE);
        triple(out, ", nu: ", o->nu, DIMENSION_NUMBER);
        break;
    }
    if (*m->along_array) {
        word(out, "}, along: {array: ", m->along_array);
        fputc('}', out);
    } else {
        vector(out, "}, along: ", m->along);
    }
    if (m->symmetry == SYMMETRY_ORTHOTROPIC)
        vector(out, ", across: ", m->across);
}

static void body(FILE *out, const struct scene *scene)
{
    static const char *const unit_name[] = {"", "m", "cm", "mm"};
    word(out, "body:\n  mesh: {file: ", scene->mesh_path);
    if (scene->extent_m > 0)
        quantity(out, ", extent: ", scene->extent_m, DIMENSION_LENGTH);
    else if (scene->unit != MESH_UNIT_NONE)
        fprintf(out, ", unit: %s", unit_name[scene->unit]);
    if (scene->surface_size_m > 0)
        quantity(out, ", size: ", scene->surface_size_m, DIMENSION_LENGTH);
    fprintf(out, ", order: %s}\n", scene->order == ELEMENT_QUADRATIC ? "quadratic" : "linear");
    if (*scene->intensity_array) {
        word(out, "  intensities: {array: ", scene->intensity_array);
        if (*scene->intensity_path)
            word(out, ", file: ", scene->intensity_path);
        fputs("}\n", out);
    }
    fputs("  materials:\n", out);
    for (size_t i = 0; i < scene->material_count; i++) {
        word(out, "    - {label: ", scene->material[i].label);
        if (scene->material[i].by_intensity) {
            quantity(out, ", intensity: ", scene->material[i].intensity[0], DIMENSION_NUMBER);
            quantity(out, "..", scene->material[i].intensity[1], DIMENSION_NUMBER);
        }
        law(out, &scene->material[i]);
        quantity(out, ", rho: ", scene->material[i].rho_kg_m3, DIMENSION_DENSITY);
        fputs("}\n", out);
    }
    if (scene->fixed_count)
        fputs("  fixed:\n", out);
    for (size_t i = 0; i < scene->fixed_count; i++) {
        const bool *c = scene->fixed[i].component;
        fputs("    - {", out);
        selection(out, &scene->fixed[i].where);
        if (scene->fixed[i].slides) {
            vector(out, ", along: ", scene->fixed[i].along);
        } else if (!(c[0] && c[1] && c[2])) {
            const char *before = ", components: [";
            for (int k = 0; k < 3; k++)
                if (c[k]) {
                    fprintf(out, "%s%c", before, "xyz"[k]);
                    before = ", ";
                }
            fputc(']', out);
        }
        fputs("}\n", out);
    }
    if (scene->ligament_count)
        fputs("  ligaments:\n", out);
    for (size_t i = 0; i < scene->ligament_count; i++) {
        fputs("    - {", out);
        selection(out, &scene->ligament[i].where);
        quantity(out, ", stiffness: ", scene->ligament[i].stiffness_N_m, DIMENSION_STIFFNESS);
        vector(out, ", direction: ", scene->ligament[i].direction);
        fputs("}\n", out);
    }
    if (scene->allow_components)
        fputs("  allow_components: true\n", out);
}

static void instrument(FILE *out, const struct scene_instrument *s)
{
    word(out, "  - name: ", s->name);
    if (s->placed) {
        vector(out, "\n    trocar: {at: ", s->trocar_m);
        vector(out, ", axis: ", s->axis);
        fputc('}', out);
    }
    quantity(out, "\n    length: ", s->length_min_m, DIMENSION_POSITION);
    quantity(out, "..", s->length_max_m, DIMENSION_POSITION);
    quantity(out, " m\n    tip: {radius: ", s->tip_radius_m, DIMENSION_LENGTH);
    fprintf(out, ", points: %u}", s->tip_points);
    word(out, "\n    device: ", s->device);
    fputc('\n', out);
    if (s->coupling_stiffness_N_m > 0 || s->coupling_damping_Ns_m > 0) {
        const char *before = "    coupling: {stiffness: ";
        if (s->coupling_stiffness_N_m > 0) {
            quantity(out, before, s->coupling_stiffness_N_m, DIMENSION_STIFFNESS);
            before = ", damping: ";
        } else {
            before = "    coupling: {damping: ";
        }
        if (s->coupling_damping_Ns_m > 0)
            quantity(out, before, s->coupling_damping_Ns_m, DIMENSION_DAMPING);
        fputs("}\n", out);
    }
    if (s->force_limit_N > 0) {
        quantity(out, "    force_limit: ", s->force_limit_N, DIMENSION_FORCE);
        fputc('\n', out);
    }
}

static void budget(FILE *out, const struct scene *scene)
{
    const char *before = "budget: {";
    if (scene->budget_instructions > 0) {
        quantity(out, "budget: {instructions: ", scene->budget_instructions, DIMENSION_NUMBER);
        before = ", ";
    }
    if (scene->budget_bank_bytes > 0) {
        fputs(before, out);
        quantity(out, "bank: ", scene->budget_bank_bytes, DIMENSION_BYTES);
        before = ", ";
    }
    if (scene->budget_force_error > 0) {
        fputs(before, out);
        quantity(out, "force_error: ", scene->budget_force_error, DIMENSION_SHARE);
        before = ", ";
    }
    if (before[0] == ',')
        fputs("}\n", out);
}

static void effects(FILE *out, const struct scene *scene)
{
    const char *before = "";
    for (size_t i = 0; i < effects_count(); i++)
        if (scene->effects.named & effects_at(i)->bit & ~(uint32_t)EFFECT_SECOND) { /* that is in the instruments */
            fprintf(out, "%s%s: ", before, effects_at(i)->name);
            effects_at(i)->print(out, scene);
            before = ", ";
        }
}

char *scene_print(const struct scene *scene)
{
    char *text = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&text, &length);
    if (!out)
        return NULL;
    word(out, "scene: ", scene->name);
    fputc('\n', out);
    body(out, scene);
    fputs("instruments:\n", out);
    for (size_t i = 0; i < scene->instrument_count; i++)
        instrument(out, &scene->instrument[i]);
    quantity(out, "contact: {regularisation: ", scene->regularisation, DIMENSION_RATIO);
    if (scene->solver_steps)
        fprintf(out, ", steps: %u", scene->solver_steps);
    fputs("}\neffects: {", out);
    effects(out, scene);
    fputs("}\n", out);
    budget(out, scene);
    bool failed = ferror(out) != 0;
    if (fclose(out) != 0 || failed) {
        free(text);
        return NULL;
    }
    return text;
}
