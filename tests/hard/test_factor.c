/* Section FACT: rows come back bit for bit; damaged code is refused or harmless; a finer step is a truer one; and how small
 * it is. TROCAR_LONG=1: more damage, and the large liver. (Contact systems: test_contact_sets.c.) */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "bank.h"
#include "factor_fixture.h"
#include "random.h"
#include "row.h"
#include "row_code.h"

static bool thorough;

static int setup(void **state)
{
    (void)state;
    thorough = getenv("TROCAR_LONG") != NULL;
    return 0;
}

static const struct bank_fixture_options sphere = {.subdivisions = 3,
                                                   .radius_m = 0.05,
                                                   .fixed_share = 0.15,
                                                   .young_Pa = 4000,
                                                   .grain_m = 0.006,
                                                   .shear = 0.05,
                                                   .instruments = 1,
                                                   .tip_points = 7,
                                                   .tip_radius_m = 0.005};

static void rows_come_back_bit_for_bit(void **state)
{
    (void)state;
    random_seed("portions", 1);
    double steps[] = {COMPRESSION_STEP_MAX, 2e-2, COMPRESSION_STEP, 1e-4, COMPRESSION_STEP_MIN};
    for (size_t s = 0; s < sizeof steps / sizeof steps[0]; s++) {
        struct factor_fixture f;
        assert_int_equal(factor_fixture(&sphere, steps[s], &f), STATUS_OK);
        uint32_t most = row_max_blocks(&f.view);
        struct row_block *whole = malloc(most * sizeof *whole), *part = malloc((most + 1) * sizeof *part);
        for (uint32_t i = 0; i < f.view.row_count; i++) {
            const struct row_block *made = f.factor.block + f.factor.start[i];
            uint32_t count = (uint32_t)(f.factor.start[i + 1] - f.factor.start[i]), got = 0;
            assert_int_equal(row_decode(&f.view, i, whole), count);
            assert_memory_equal(whole, made, count * sizeof *whole);
            struct row_reader reader; /* in portions of any size */
            row_start(&reader, &f.view, i);
            while (!row_finished(&reader)) {
                struct row_block some[64];
                uint32_t found = row_read(&reader, 1 + random_below(64), some);
                assert_true(got + found <= count);
                memcpy(part + got, some, found * sizeof *some);
                got += found;
            }
            assert_int_equal(got, count);
            assert_memory_equal(part, made, count * sizeof *part);
        }
        print_message("# step %g: %zu bytes, at most %u blocks in a row\n", steps[s],
                      (size_t)bank_view_section(&f.view, BANK_FACT)->length, most);
        free(whole);
        free(part);
        factor_fixture_free(&f);
    }
}

/* G from the integers of the encoder by long sums, against what the view says, with its rows decoded and without. */
static void the_compliance_is_that_of_the_integers(void **state)
{
    (void)state;
    random_seed("pairs", 2);
    struct factor_fixture f;
    assert_int_equal(factor_fixture(&sphere, COMPRESSION_STEP, &f), STATUS_OK);
    struct bank_view decoded = f.view;
    struct rows_in_memory rows;
    struct failure why;
    assert_int_equal(rows_in_memory(&decoded, &rows, &why), STATUS_OK);
    for (int trial = 0; trial < 2000; trial++) {
        uint32_t i = random_below(f.view.row_count), j = trial % 10 ? random_below(f.view.row_count) : i;
        double expected[9] = {0}, step = (double)f.view.factor.header->step;
        for (size_t p = f.factor.start[i]; p < f.factor.start[i + 1]; p++)
            for (size_t q = f.factor.start[j]; q < f.factor.start[j + 1]; q++)
                for (int k = 0; k < 9 && f.factor.block[p].column == f.factor.block[q].column; k++)
                    for (int c = 0; c < 3; c++)
                        expected[k] += step * step * f.factor.block[p].value[k / 3 * 3 + c] *
                                       f.factor.block[q].value[k % 3 * 3 + c];
        float got[9], quick[9];
        bank_view_compliance(&f.view, i, j, got);
        bank_view_compliance(&decoded, i, j, quick);
        assert_memory_equal(got, quick, sizeof got);
        for (int k = 0; k < 9; k++) /* three roundings to float32: the integer, the step's square, their product */
            assert_true(fabs((double)got[k] - expected[k]) <= 3 * 0x1p-24 * fabs(expected[k]) + 1e-30);
    }
    rows_in_memory_free(&rows);
    factor_fixture_free(&f);
}

/* Exactly: the integer Gram matrix itself, without the blocks' rounding to float32. */
static void the_gram_matrix_is_exact(void **state)
{
    (void)state;
    random_seed("gram", 4);
    struct factor_fixture f;
    assert_int_equal(factor_fixture(&sphere, COMPRESSION_STEP_MIN, &f), STATUS_OK);
    struct row_block *a = malloc(row_max_blocks(&f.view) * sizeof *a), *b = malloc(row_max_blocks(&f.view) * sizeof *b);
    for (int trial = 0; trial < 300; trial++) {
        uint32_t i = random_below(f.view.row_count), j = random_below(f.view.row_count);
        uint32_t p = row_decode(&f.view, i, a), q = row_decode(&f.view, j, b);
        int32_t ii[9], jj[9], ij[9];
        row_dot(a, p, a, p, ii);
        row_dot(b, q, b, q, jj);
        row_dot(a, p, b, q, ij);
        for (int r = 0; r < 3; r++) /* Cauchy and Schwarz: no sum has wrapped */
            for (int c = 0; c < 3; c++) {
                assert_true(ii[4 * r] >= 0 && jj[4 * c] >= 0);
                assert_true((int64_t)ij[3 * r + c] * ij[3 * r + c] <= (int64_t)ii[4 * r] * jj[4 * c]);
            }
    }
    free(a);
    free(b);
    factor_fixture_free(&f);
}

/* Seeded damage inside FACT under right checksums. What opens decodes within the bounds that it promises. */
static void damaged_code_is_refused_or_harmless(void **state)
{
    (void)state;
    random_seed("damage", 5);
    struct factor_fixture f;
    struct bank_fixture_options o = sphere;
    o.subdivisions = 1;
    assert_int_equal(factor_fixture(&o, COMPRESSION_STEP, &f), STATUS_OK);
    const struct bank_section *s = bank_view_section(&f.view, BANK_FACT);
    size_t head = (size_t)((const unsigned char *)f.view.factor.code - f.bytes) - s->offset;
    unsigned tries = thorough ? 200000 : 6000, opened = 0;
    for (unsigned k = 0; k < tries; k++) {
        unsigned char *copy = bank_fixture_memory(f.length);
        memcpy(copy, f.bytes, f.length);
        for (unsigned hit = 1 + random_below(3); hit > 0; hit--) {
            size_t at = random_below(2) ? random_below((unsigned)head) : random_below(s->length);
            if (random_below(4) == 0)
                copy[s->offset + at] = (unsigned char)random_bits();
            else
                copy[s->offset + at] ^= (unsigned char)(1u << random_below(8));
        }
        if (random_below(10) == 0)
            bank_fixture_section(copy, BANK_FACT)->count += 1 - 2 * random_below(2);
        bank_fixture_seal(copy, f.length);
        struct bank_view view;
        int status = bank_view_open(&view, copy, f.length);
        if (status == STATUS_OK) {
            opened++;
            uint32_t most = row_max_blocks(&view);
            struct row_block *row = malloc(most * sizeof *row); /* exactly: the sanitizer sees one block too many */
            for (uint32_t i = 0; i < view.row_count; i++) {
                uint32_t count = row_decode(&view, i, row);
                assert_true(count >= 1 && count <= most && row[count - 1].column == i);
                for (uint32_t b = 1; b < count; b++)
                    assert_true(row[b].column > row[b - 1].column);
                int32_t sum[9];
                row_dot(row, count, row, count, sum);
                assert_true(sum[0] >= 0 && sum[4] >= 0 && sum[8] >= 0);
            }
            free(row);
        } else
            assert_true(view.fault_tag == BANK_FACT || view.fault_tag == BANK_ROWS || view.fault_tag == 0);
        free(copy);
    }
    print_message("# %u of %u damaged banks opened\n", opened, tries);
    factor_fixture_free(&f);
}

/* The layout of the rows has changed once; a bank of before is refused, naming the section. */
static void the_layout_of_before_is_refused(void **state)
{
    (void)state;
    struct factor_fixture f;
    struct bank_fixture_options o = sphere;
    o.subdivisions = 1;
    assert_int_equal(factor_fixture(&o, COMPRESSION_STEP, &f), STATUS_OK);
    bank_fixture_section(f.bytes, BANK_FACT)->version = 1;
    bank_fixture_seal(f.bytes, f.length);
    struct bank_view view;
    assert_int_equal(bank_view_open(&view, f.bytes, f.length), STATUS_BANK_VERSION);
    assert_int_equal(view.fault_tag, BANK_FACT);
    factor_fixture_free(&f);
}

static double patch_error(const struct factor_fixture *f)
{
    struct contact_surface s = {.vertices = f->view.vertex_count,
                                .triangles = f->view.triangle_count,
                                .triangle = f->view.triangles,
                                .positions = f->view.positions,
                                .normals = f->view.normals,
                                .row_of = f->view.row_of,
                                .regularisation_m_N = (double)f->view.contact->regularisation_m_N};
    struct compression_error e;
    struct failure why;
    assert_int_equal(
        compression_error_measure(&s, &f->G, f->order.at, &f->factor, 1u << COMPRESSION_ERROR_PATCH, 300, 1, &e, &why),
        STATUS_OK);
    return e.of[COMPRESSION_ERROR_PATCH].p95;
}

static void a_finer_step_is_truer_and_longer(void **state)
{
    (void)state;
    double last = INFINITY;
    size_t last_length = 0;
    for (double step = 0.1; step > 1e-4; step /= 4) {
        struct factor_fixture f;
        assert_int_equal(factor_fixture(&sphere, step, &f), STATUS_OK);
        double error = patch_error(&f);
        print_message("# step %g: patch error %.2e, %zu bytes\n", step, error, f.length);
        assert_true(error < last);
        assert_true(f.length > last_length);
        last = error;
        last_length = f.length;
        factor_fixture_free(&f);
    }
}

static int build(const char *mesh, double force_error, struct build_result *result)
{
    const char *data = getenv("TROCAR_DATA");
    char path[600], out[] = "/tmp/trocar-factor-XXXXXX";
    snprintf(path, sizeof path, "%s/%s", data ? data : "../shared/data", mesh);
    if (access(path, R_OK) != 0)
        return -1;
    int file = mkstemp(out);
    assert_true(file >= 0);
    close(file);
    struct scene *scene = calloc(1, sizeof *scene);
    struct failure why;
    scene_assume(path, 0.214, MESH_UNIT_NONE, scene);
    struct compression wanted = {.force_error = force_error};
    int status = bank_build(scene, out, &wanted, INFINITY, true, result, &why);
    if (status)
        failure_print(stderr, &why);
    unlink(out);
    free(scene);
    assert_int_equal(status, STATUS_OK);
    return 0;
}

/* Bytes of the whole file per surface vertex at a patch error (p95): the figures that the project promises. */
static void livers_are_small(void **state)
{
    (void)state;
    static const struct {
        const char *mesh;
        double error, bytes;
        bool large;
    } promised[] = {{"liver_smooth_1665_6691.msh", 0.005, 800, false},
                    {"liver_smooth_1665_6691.msh", 0.001, 1550, true},
                    {"liver_smooth_6267_29596.msh", 0.005, 1400, true},
                    {"liver_smooth_6267_29596.msh", 0.001, 3100, true}};
    bool any = false;
    for (size_t k = 0; k < sizeof promised / sizeof promised[0]; k++) {
        struct build_result r;
        if ((promised[k].large && !thorough) || build(promised[k].mesh, promised[k].error, &r) != 0)
            continue;
        any = true;
        double bytes = (double)r.bytes / (double)r.surface_nodes;
        print_message("# %s: %.0f bytes per vertex at %.2f %% (two tools %.2f %%, displacement %.2f %%)\n",
                      promised[k].mesh, bytes, 100 * r.force_error_p95, 100 * r.error.of[COMPRESSION_ERROR_TWO].p95,
                      100 * r.error.of[COMPRESSION_ERROR_FIELD].p95);
        assert_true(r.force_error_p95 <= promised[k].error);
        assert_true(bytes <= promised[k].bytes);
    }
    if (!any)
        skip();
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_come_back_bit_for_bit),
        cmocka_unit_test(the_compliance_is_that_of_the_integers),
        cmocka_unit_test(the_gram_matrix_is_exact),
        cmocka_unit_test(damaged_code_is_refused_or_harmless),
        cmocka_unit_test(the_layout_of_before_is_refused),
        cmocka_unit_test(a_finer_step_is_truer_and_longer),
        cmocka_unit_test(livers_are_small),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
