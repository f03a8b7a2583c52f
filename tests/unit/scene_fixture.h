/* Scene texts for the tests of host/scenes. */
#ifndef TROCAR_TESTS_SCENE_FIXTURE_H
#define TROCAR_TESTS_SCENE_FIXTURE_H

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <setjmp.h>

#include <cmocka.h>

#include "scene.h"

/* Every key of a scene, once. */
static const char scene_full[] =
    "scene: every-key\n"
    "body:\n"
    "  mesh: {file: meshes/liver.msh, extent: 0.214 m, size: 6 mm, order: linear}\n"
    "  materials:\n"
    "    - {label: all, E: 4 kPa, nu: 0.45, rho: 1060 kg/m3}\n"
    "    - {label: tumour, E: 0.02 MPa, nu: -0.25, rho: 1.1 g/cm3}\n"
    "    - {label: 7, E: 900 Pa, nu: 0.499, rho: 1 g/cm3}\n"
    "  fixed:\n"
    "    - {box: {from: [-0.1, -5 cm, 0], to: [0.1, 50 mm, 1e-2]}}\n"
    "    - {sphere: {at: [0, 0.01, 0.02], radius: 5 mm}, components: [x, z]}\n"
    "    - {plane: {at: [0, 0, 0.03], normal: [0, 3, -4]}, components: [y]}\n"
    "    - {label: bone}\n"
    "    - {patch: {near: [-0.1, 0, 0], share: 4 %}}\n"
    "    - {axis_end: {share: 2.5 %}}\n"
    "  ligaments:\n"
    "    - {box: {from: [0, 0, 0], to: [1, 1, 1]}, stiffness: 200 N/m, direction: [0, 0, 2]}\n"
    "    - {patch: {near: [0.1, 0, 0], share: 100 %}, stiffness: 0.5 N/mm, direction: [1, 1, 0]}\n"
    "  allow_components: true\n"
    "instruments:\n"
    "  - name: right\n"
    "    trocar: {at: [0, 0, 0.2], axis: [0, 0, -1]}\n"
    "    length: 0.12..0.22 m\n"
    "    tip: {radius: 4 mm, points: 9}\n"
    "    device: impulse-engine\n"
    "    coupling: {stiffness: 0.8 N/mm, damping: 0.2 N s/m}\n"
    "    force_limit: 5000 mN\n"
    "  - {name: left}\n"
    "contact: {regularisation: 0.2 %, steps: 12}\n"
    "effects: {}\n"
    "budget: {instructions: 240000, bank: 1.5 MiB, force_error: 0.5 %}\n";

/* The least that a scene must say. */
static const char scene_small[] = "scene: small\n"
                                  "body:\n"
                                  "  mesh: {file: a.msh, unit: mm}\n"
                                  "  materials: [{E: 4 kPa, nu: 0.45, rho: 1060 kg/m3}]\n";

static inline int parse(const char *text, const char *path, struct scene *scene, struct failure *why)
{
    memset(why, 0, sizeof *why);
    return scene_parse(text, strlen(text), path, scene, why);
}

/* `text` with the first `from` replaced by `to` (malloc). */
static inline char *changed(const char *text, const char *from, const char *to)
{
    const char *at = strstr(text, from);
    if (!at)
        fail_msg("the fixture has no '%s'", from);
    char *copy = malloc(strlen(text) + strlen(to) + 1);
    assert_non_null(copy);
    sprintf(copy, "%.*s%s%s", (int)(at - text), text, to, at + strlen(from));
    return copy;
}

static inline void same_selection(const struct selection *p, const struct selection *q)
{
    assert_int_equal(p->kind, q->kind);
    assert_memory_equal(p->a, q->a, sizeof p->a);
    assert_memory_equal(p->b, q->b, sizeof p->b);
    assert_memory_equal(&p->value, &q->value, sizeof p->value);
    assert_string_equal(p->label, q->label);
}

/* All that a scene says, to the bit; lines and the scene's own path aside. */
static inline void same_scene(const struct scene *p, const struct scene *q)
{
    assert_string_equal(p->name, q->name);
    assert_string_equal(p->mesh_path, q->mesh_path);
    assert_true(p->extent_m == q->extent_m && p->surface_size_m == q->surface_size_m);
    assert_int_equal(p->unit, q->unit);
    assert_int_equal(p->allow_components, q->allow_components);
    assert_string_equal(p->intensity_array, q->intensity_array);
    assert_string_equal(p->intensity_path, q->intensity_path);
    assert_int_equal(p->material_count, q->material_count);
    for (size_t i = 0; i < p->material_count; i++) {
        assert_string_equal(p->material[i].label, q->material[i].label);
        assert_true(p->material[i].E_Pa == q->material[i].E_Pa && p->material[i].nu == q->material[i].nu &&
                    p->material[i].rho_kg_m3 == q->material[i].rho_kg_m3);
        assert_int_equal(p->material[i].symmetry, q->material[i].symmetry);
        assert_memory_equal(&p->material[i].orthotropic, &q->material[i].orthotropic,
                            sizeof p->material[i].orthotropic);
        assert_memory_equal(p->material[i].along, q->material[i].along, sizeof p->material[i].along);
        assert_string_equal(p->material[i].along_array, q->material[i].along_array);
        assert_int_equal(p->material[i].by_intensity, q->material[i].by_intensity);
        assert_memory_equal(p->material[i].intensity, q->material[i].intensity, sizeof p->material[i].intensity);
        assert_memory_equal(p->material[i].across, q->material[i].across, sizeof p->material[i].across);
    }
    assert_int_equal(p->fixed_count, q->fixed_count);
    for (size_t i = 0; i < p->fixed_count; i++) {
        same_selection(&p->fixed[i].where, &q->fixed[i].where);
        assert_memory_equal(p->fixed[i].component, q->fixed[i].component, sizeof p->fixed[i].component);
    }
    assert_int_equal(p->ligament_count, q->ligament_count);
    for (size_t i = 0; i < p->ligament_count; i++) {
        same_selection(&p->ligament[i].where, &q->ligament[i].where);
        assert_true(p->ligament[i].stiffness_N_m == q->ligament[i].stiffness_N_m);
        assert_memory_equal(p->ligament[i].direction, q->ligament[i].direction, sizeof p->ligament[i].direction);
    }
    assert_int_equal(p->instrument_count, q->instrument_count);
    for (size_t i = 0; i < p->instrument_count; i++) {
        const struct scene_instrument *a = &p->instrument[i], *b = &q->instrument[i];
        assert_string_equal(a->name, b->name);
        assert_string_equal(a->device, b->device);
        assert_int_equal(a->placed, b->placed);
        assert_memory_equal(a->trocar_m, b->trocar_m, sizeof a->trocar_m);
        assert_memory_equal(a->axis, b->axis, sizeof a->axis);
        assert_true(a->length_min_m == b->length_min_m && a->length_max_m == b->length_max_m);
        assert_true(a->tip_radius_m == b->tip_radius_m && a->tip_points == b->tip_points);
        assert_true(a->coupling_stiffness_N_m == b->coupling_stiffness_N_m);
        assert_true(a->coupling_damping_Ns_m == b->coupling_damping_Ns_m && a->force_limit_N == b->force_limit_N);
    }
    assert_true(p->regularisation == q->regularisation);
    assert_true(p->budget_instructions == q->budget_instructions);
    assert_true(p->budget_bank_bytes == q->budget_bank_bytes && p->budget_force_error == q->budget_force_error);
}

#endif
