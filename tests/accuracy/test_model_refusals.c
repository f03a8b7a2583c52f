/* What a model refuses, and the words it finds for it: a motion that nothing holds is found by an independent argument
 * (which displacement the supports of the case leave free), not by the program's own null space. */
#include "specimen.h"

#include <signal.h>
#include <SuiteSparse_config.h>

static void cube(struct specimen *s)
{
    specimen_block(s, 2, 2, 2, 0.1, 0.1, 0.1);
    specimen_material(s, "all", 4000, 0.45);
}

/* The model is refused with `status`, and the message holds every given word (NULL ends them). */
static void refused(struct specimen *s, int status, ...)
{
    struct failure why = {0};
    int got = specimen_try(s, &why);
    print_message("# %s: %s; %s\n", status_name(got), why.cause, why.remedy);
    assert_int_equal(got, status);
    assert_int_equal(why.status, status);
    assert_null(s->model);
    assert_true(*why.cause && *why.remedy);
    va_list words;
    va_start(words, status);
    for (const char *word = va_arg(words, const char *); word; word = va_arg(words, const char *))
        if (!strstr(why.cause, word))
            fail_msg("'%s' is not in '%s'", word, why.cause);
    va_end(words);
    specimen_free(s);
}

static void ligament(struct specimen *s, struct selection where, double x, double y, double z)
{
    s->scene.ligament[s->scene.ligament_count++] =
        (struct scene_ligament){.where = where, .stiffness_N_m = 100, .direction = {x, y, z}};
}

static void free_rigid_motions_are_refused_and_named(void **state)
{
    (void)state;
    const char *end = NULL;
    struct specimen s;
    cube(&s);
    refused(&s, STATUS_MODEL_FREE_MOTION, "held by nothing", end);

    cube(&s); /* one point */
    specimen_fix(&s, box(0.1, 0.1, 0.1, 0.1, 0.1, 0.1), "xyz");
    refused(&s, STATUS_MODEL_FREE_MOTION, "rotation about the x axis through (0.05, 0.1, 0.1) m", "about the y axis",
            "about the z axis through (0.1, 0.1, 0.05) m", end);

    cube(&s); /* a hinge: an edge along y */
    specimen_fix(&s, box(0.1, 0, 0, 0.1, 1, 0), "xyz");
    refused(&s, STATUS_MODEL_FREE_MOTION, "still move: rotation about the y axis through (0.1, 0.05, 0) m", end);

    cube(&s); /* an oblique hinge: the diagonal of the face x = 0 */
    specimen_fix(&s, box(0, 0, 0, 0, 0, 0), "xyz");
    specimen_fix(&s, box(0, 0.05, 0.05, 0, 0.05, 0.05), "xyz");
    refused(&s, STATUS_MODEL_FREE_MOTION, "rotation about the (0, 0.707, 0.707) axis through (0, 0.05, 0.05) m", end);

    cube(&s); /* a floor without friction */
    specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "z");
    refused(&s, STATUS_MODEL_FREE_MOTION, "translation along x, translation along y, rotation about the z axis", end);

    cube(&s); /* a sleeve: nodes on both sides slide along x only */
    specimen_fix(&s, box(0, 0, 0, 1, 0, 1), "yz");
    refused(&s, STATUS_MODEL_FREE_MOTION, "still move: translation along x", end);

    cube(&s); /* ligaments along one direction leave the two others and the turn about it */
    ligament(&s, box(0, 0, 0, 1, 1, 0), 0, 0, 1);
    refused(&s, STATUS_MODEL_FREE_MOTION, "translation along x, translation along y, rotation about the z axis", end);

    cube(&s); /* an oblique roller: one translation is free, neither x nor y */
    specimen_fix(&s, box(0, 0, 0, 1, 1, 1), "z");
    ligament(&s, box(0, 0, 0, 1, 1, 1), 0.6, 0.8, 0);
    refused(&s, STATUS_MODEL_FREE_MOTION, "still move: translation along (0.8, -0.6, 0)", end);
}

static void enough_supports_are_accepted_whatever_holds_them(void **state)
{
    (void)state;
    struct specimen s;
    struct failure why;
    cube(&s); /* three planes of rollers */
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "x");
    specimen_fix(&s, box(0, 0, 0, 1, 0, 1), "y");
    specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "z");
    must(specimen_try(&s, &why), &why);
    specimen_free(&s);
    cube(&s); /* the floor, and ligaments across it that are not in line */
    specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "z");
    ligament(&s, box(0, 0, 0, 1, 0, 0), 1, 0, 0);
    ligament(&s, box(0, 0.1, 0, 1, 0.1, 0), 1, 0, 0);
    ligament(&s, box(0, 0, 0, 0, 0, 0), 0, 1, 0);
    must(specimen_try(&s, &why), &why);
    specimen_free(&s);
    cube(&s); /* a hinge along y and one ligament that keeps it from turning */
    specimen_fix(&s, box(0.1, 0, 0, 0.1, 1, 0), "xyz");
    ligament(&s, box(0, 0, 0, 0, 1, 0), 0, 0, 1);
    must(specimen_try(&s, &why), &why);
    specimen_free(&s);
}

static void every_piece_of_a_body_must_be_held(void **state)
{
    (void)state;
    struct specimen one, s;
    cube(&one);
    memset(&s, 0, sizeof s);
    size_t nodes = one.mesh.node_count, tets = one.mesh.tetrahedron_count;
    mesh_room(&s.mesh, 2 * nodes, 2 * tets);
    for (size_t i = 0; i < 6 * nodes; i++)
        s.mesh.nodes[i] = one.mesh.nodes[i % (3 * nodes)] + (i >= 3 * nodes && i % 3 == 0 ? 0.5 : 0);
    for (size_t i = 0; i < 8 * tets; i++)
        s.mesh.tetrahedra[i] = one.mesh.tetrahedra[i % (4 * tets)] + (uint32_t)(i >= 4 * tets ? nodes : 0);
    mesh_free(&one.mesh);
    specimen_material(&s, "all", 4000, 0.45);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    refused(&s, STATUS_MODEL_FREE_MOTION, "piece 2 of 2 (27 nodes around (0.55, 0.05, 0.05) m) is held by nothing",
            (const char *)NULL);
}

/* Pieces that share one node only: connected, each rigid motion of the whole held, yet the second turns about the node. */
static void a_part_that_hangs_on_a_hinge_is_found_by_its_pivot(void **state)
{
    (void)state;
    struct specimen s;
    struct failure why;
    struct compliance c;
    memset(&s, 0, sizeof s);
    mesh_room(&s.mesh, 7, 2);
    static const double nodes[21] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0.2, 0.3, 1, 1, 0.1, 2, 0.3, 1, 2.1, -0.4, 0, 1.9};
    static const uint32_t corners[8] = {0, 1, 2, 3, 3, 4, 5, 6};
    memcpy(s.mesh.nodes, nodes, sizeof nodes);
    memcpy(s.mesh.tetrahedra, corners, sizeof corners);
    specimen_material(&s, "all", 4000, 0.45);
    specimen_fix(&s, box(0, 0, 0, 1, 1, 0), "xyz");
    /* mesh_check refuses such a mesh; here the surface is made by hand to reach the solver */
    s.surface.vertex_count = 7;
    s.surface.node = room(7 * sizeof *s.surface.node);
    s.surface.vertex_of = room(7 * sizeof *s.surface.vertex_of);
    for (uint32_t n = 0; n < 7; n++)
        s.surface.node[n] = s.surface.vertex_of[n] = n;
    must(model_create(&s.scene, &s.mesh, &s.surface, &s.model, &why), &why);
    double f[12] = {1}, u[12];
    assert_int_equal(model_unknowns(s.model), 12);
    assert_int_equal(model_solve(s.model, 1, f, u, &why), STATUS_MODEL_FACTOR);
    print_message("# %s; %s\n", why.cause, why.remedy);
    assert_int_equal(compliance_build(s.model, true, &c, &why), STATUS_MODEL_FACTOR);
    print_message("# %s; %s\n", why.cause, why.remedy);
    specimen_free(&s);
}

static void unstable_materials_are_refused_with_their_line(void **state)
{
    (void)state;
    static const double bad[][2] = {{4000, 0.5}, {4000, 0.7}, {4000, -0.1},    {4000, NAN},
                                    {-1, 0.3},   {0, 0.3},    {INFINITY, 0.3}, {NAN, 0.3}};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        struct specimen s;
        specimen_block(&s, 1, 1, 1, 0.1, 0.1, 0.1);
        specimen_material(&s, "all", bad[k][0], bad[k][1]);
        s.scene.material[0].line = 12;
        snprintf(s.scene.path, sizeof s.scene.path, "bad.yaml");
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
        struct failure why;
        assert_int_equal(specimen_try(&s, &why), STATUS_MODEL_MATERIAL);
        assert_string_equal(why.place, "bad.yaml:12");
        assert_non_null(strstr(why.cause, "'all'"));
        specimen_free(&s);
    }
}

static void labels_and_selections_that_do_not_fit_are_refused(void **state)
{
    (void)state;
    const char *end = NULL;
    struct specimen s;
    cube(&s); /* a label without material */
    s.mesh.label_count = 2;
    s.mesh.label[1].number = 8;
    s.mesh.labels[5] = 8;
    snprintf(s.scene.material[0].label, sizeof s.scene.material[0].label, "0");
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    refused(&s, STATUS_MODEL_LABEL, "8", end);
    cube(&s);
    specimen_fix(&s, box(3, 3, 3, 4, 4, 4), "xyz");
    refused(&s, STATUS_SCENE_SELECTION, end);
    cube(&s); /* a ligament on an inner node only */
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    ligament(&s, box(0.05, 0.05, 0.05, 0.05, 0.05, 0.05), 0, 0, 1);
    refused(&s, STATUS_SCENE_SELECTION, end);
    cube(&s);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    ligament(&s, box(0, 0, 0, 1, 1, 1), 0, 0, 0);
    refused(&s, STATUS_SCENE_VALUE, end);
    cube(&s);
    specimen_fix(&s, box(0, 0, 0, 1, 1, 1), "xyz");
    refused(&s, STATUS_SCENE_VALUE, "every node", end);
}

static void contacts_that_contradict_each_other_are_an_error_unless_regularised(void **state)
{
    (void)state;
    struct specimen s;
    struct failure why;
    cube(&s);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    specimen_model(&s);
    const uint32_t vertex[6] = {20, 21, 22, 20, 21, 22};
    const double weight[6] = {0.2, 0.3, 0.5, 0.2, 0.3, 0.5}, direction[6] = {0, 0, 1, 0, 0, 1}, d[2] = {0.001, 0.001};
    double p[2], C[4];
    assert_int_equal(model_constrained(s.model, 2, vertex, weight, direction, 0, d, p, C, &why), STATUS_MODEL_FACTOR);
    must(model_constrained(s.model, 2, vertex, weight, direction, 1e-3 * C[0], d, p, NULL, &why), &why);
    /* two equal contacts on springs epsilon share the force: p = d / (2 C + epsilon) */
    assert_true(fabs(p[0] / (d[0] / (2.001 * C[0])) - 1) < 1e-9);
    assert_true(fabs(p[1] / p[0] - 1) < 1e-9);
    specimen_free(&s);
}

/* ---- memory ---- */

static long calls_left; /* of CHOLMOD's allocations */

static void *failing_malloc(size_t bytes)
{
    return calls_left-- > 0 ? malloc(bytes) : NULL;
}

static void *failing_calloc(size_t count, size_t bytes)
{
    return calls_left-- > 0 ? calloc(count, bytes) : NULL;
}

static void *failing_realloc(void *old, size_t bytes)
{
    return calls_left-- > 0 ? realloc(old, bytes) : NULL;
}

static void running_out_of_memory_in_any_allocation_of_the_solver_is_a_clean_error(void **state)
{
    (void)state;
    SuiteSparse_config.malloc_func = failing_malloc;
    SuiteSparse_config.calloc_func = failing_calloc;
    SuiteSparse_config.realloc_func = failing_realloc;
    long failures = 0;
    for (long allowed = 0;; allowed++) {
        struct specimen s;
        struct failure why;
        struct compliance c;
        specimen_block(&s, 4, 4, 4, 0.1, 0.1, 0.1);
        specimen_material(&s, "all", 4000, 0.45);
        specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
        calls_left = allowed;
        int status = specimen_try(&s, &why);
        if (status == STATUS_OK) {
            double *f = room(model_unknowns(s.model) * sizeof *f);
            f[0] = 1;
            status = model_solve(s.model, 1, f, f, &why);
            free(f);
        }
        if (status == STATUS_OK) {
            status = compliance_build(s.model, true, &c, &why);
            if (status == STATUS_OK)
                compliance_free(&c);
        }
        specimen_free(&s);
        if (status == STATUS_OK)
            break;
        assert_int_equal(status, STATUS_MEMORY);
        failures++;
    }
    SuiteSparse_config.malloc_func = malloc;
    SuiteSparse_config.calloc_func = calloc;
    SuiteSparse_config.realloc_func = realloc;
    print_message("# %ld allocations failed one after the other\n", failures);
    assert_true(failures > 20);
}

/* The flag stays up: the last test of this program. */
static void interrupt_stops_the_solves_and_the_compliance(void **state)
{
    (void)state;
    struct specimen s;
    struct failure why;
    struct compliance c;
    cube(&s);
    specimen_fix(&s, box(0, 0, 0, 0, 1, 1), "xyz");
    specimen_model(&s);
    interrupt_install();
    raise(SIGINT);
    assert_int_equal(compliance_build(s.model, true, &c, &why), STATUS_INTERRUPTED);
    assert_null(c.G);
    double *f = room(model_unknowns(s.model) * sizeof *f);
    assert_int_equal(model_solve(s.model, 1, f, f, &why), STATUS_INTERRUPTED);
    free(f);
    specimen_free(&s);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(free_rigid_motions_are_refused_and_named),
        cmocka_unit_test(enough_supports_are_accepted_whatever_holds_them),
        cmocka_unit_test(every_piece_of_a_body_must_be_held),
        cmocka_unit_test(a_part_that_hangs_on_a_hinge_is_found_by_its_pivot),
        cmocka_unit_test(unstable_materials_are_refused_with_their_line),
        cmocka_unit_test(labels_and_selections_that_do_not_fit_are_refused),
        cmocka_unit_test(contacts_that_contradict_each_other_are_an_error_unless_regularised),
        cmocka_unit_test(running_out_of_memory_in_any_allocation_of_the_solver_is_a_clean_error),
        cmocka_unit_test(interrupt_stops_the_solves_and_the_compliance),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
