/* Prony series: the named models against their own formulas, and fits of synthetic measurements with noise, judged on the
 * moduli of the series that made them, not on the data. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "nonnegative.h"
#include "prony_fit.h"
#include "random.h"

static char path[] = "/tmp/trocar-prony-XXXXXX";

static void write_table(const char *text)
{
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    fputs(text, out);
    fclose(out);
}

static double noise(void)
{
    double sum = 0; /* twelve uniform numbers: normal to what is needed here, of variance 1 */
    for (int i = 0; i < 12; i++)
        sum += random_unit();
    return sum - 6;
}

static void write_oscillation(const struct prony *s, double G_Pa, double low, double high, int points, double share,
                              uint64_t seed)
{
    random_seed("noise of the moduli", seed);
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    fprintf(out, "# synthetic\nomega [rad/s], G' [kPa], G'' [Pa]\n");
    for (int i = 0; i < points; i++) {
        double w = low * pow(high / low, i / (points - 1.0));
        fprintf(out, "%.9g, %.9g, %.9g\n", w, 1e-3 * G_Pa * prony_storage(s, w) * (1 + share * noise()),
                G_Pa * prony_loss(s, w) * (1 + share * noise()));
    }
    fclose(out);
}

/* Largest relative error of the fitted G' and G'' over the range. */
static double off(const struct prony *truth, double G_Pa, const struct prony_fit *fit, double low, double high)
{
    double worst = 0;
    for (int i = 0; i <= 100; i++) {
        double w = low * pow(high / low, i / 100.0);
        worst = fmax(worst, fabs(prony_fit_value(fit, 0, w) / (G_Pa * prony_storage(truth, w)) - 1));
        worst = fmax(worst, fabs(prony_fit_value(fit, 1, w) / (G_Pa * prony_loss(truth, w)) - 1));
    }
    return worst;
}

static void moduli_are_recovered_within_one_percent(void **state)
{
    (void)state;
    static const struct prony truth[] = {
        {.count = 1, .share = {0.3}, .time_s = {0.05}},
        {.count = 2, .share = {0.3, 0.8}, .time_s = {0.02, 0.9}},
        {.count = 3, .share = {0.5, 0.4, 0.9}, .time_s = {0.01, 0.15, 2}},
        {.count = 1, .share = {0.6}, .time_s = {0.4}, .viscosity_s = 0.002},
        {.viscosity_s = 0.03},
    };
    for (size_t k = 0; k < sizeof truth / sizeof *truth; k++)
        for (int noisy = 0; noisy < 2; noisy++) {
            struct prony_fit fit;
            struct failure why = {0};
            double share = noisy ? 0.01 : 0;
            write_oscillation(&truth[k], 1300, 0.1, 300, 60, share, 77 + k);
            int status = prony_fit_file(path, &fit, &why);
            if (status)
                fail_msg("%s: %s", why.place, why.cause);
            double worst = off(&truth[k], 1300, &fit, 0.1, 300);
            print_message("# case %zu, noise %.1f %%: %zu branches for %zu, moduli off by %.2g %%, residual "
                          "%.2g %%\n",
                          k, 100 * share, fit.series.count, truth[k].count, 100 * worst, 100 * fit.residual_rms);
            assert_true(worst < (noisy ? 0.01 : 1e-6));
            assert_true(fabs(fit.equilibrium / 1300 - 1) < (noisy ? 0.01 : 1e-6));
            if (!noisy)
                assert_int_equal(fit.series.count, truth[k].count);
            prony_fit_free(&fit);
        }
}

static void relaxation_curves_give_the_moduli_too(void **state)
{
    (void)state;
    static const struct prony truth = {.count = 2, .share = {0.3, 0.8}, .time_s = {0.02, 0.9}};
    for (int noisy = 0; noisy < 2; noisy++) {
        random_seed("noise of the curve", 5);
        struct prony_fit fit;
        struct failure why = {0};
        FILE *out = fopen(path, "w");
        assert_non_null(out);
        fprintf(out, "t [ms]; F [mN]\n");
        for (int i = 0; i < 200; i++) {
            double t = 0.002 * pow(5000, i / 199.0);
            fprintf(out, "%.9g; %.9g\n", 1e3 * t,
                    1e3 * 0.7 * prony_relaxation(&truth, t) * (1 + noisy * 0.01 * noise()));
        }
        fclose(out);
        int status = prony_fit_file(path, &fit, &why);
        if (status)
            fail_msg("%s: %s", why.place, why.cause);
        double worst = 0;
        for (int i = 0; i <= 100; i++) { /* within the times measured */
            double t = 0.002 * pow(5000, i / 100.0);
            worst = fmax(worst, fabs(prony_fit_value(&fit, 0, t) / (0.7 * prony_relaxation(&truth, t)) - 1));
        }
        print_message("# relaxation, noise %d %%: %zu branches, off by %.2g %%\n", noisy, fit.series.count,
                      100 * worst);
        assert_true(worst < (noisy ? 0.01 : 1e-6));
        prony_fit_free(&fit);
    }
}

/* The formulas of section 3 of the physics, written out again. */
static void named_models_have_the_moduli_of_their_formulas(void **state)
{
    (void)state;
    const double k1 = 4000, k2 = 1500, C = 90;
    for (double w = 0.01; w < 1e4; w *= 3) {
        struct prony kv = prony_kelvin_voigt(k1, C), b = prony_boltzmann(k1, k2, C);
        struct prony m = prony_maxwell_kelvin_voigt(k1, k2, C);
        assert_true(fabs(k1 * prony_storage(&kv, w) - k1) <= 1e-12 * k1);
        assert_true(fabs(k1 * prony_loss(&kv, w) / (C * w) - 1) < 1e-12);
        double q = k2 / C, storage = k1 + k2 * w * w / (q * q + w * w), loss = k2 * k2 / C * w / (q * q + w * w);
        assert_true(fabs(k1 * prony_storage(&b, w) / storage - 1) < 1e-12);
        assert_true(fabs(k1 * prony_loss(&b, w) / loss - 1) < 1e-12);
        double rest = k1 * k2 / (k1 + k2), top = k1 * k1 / (k1 + k2), rate = (k1 + k2) / C;
        assert_true(fabs(rest * prony_storage(&m, w) / (rest + top * w * w / (rate * rate + w * w)) - 1) < 1e-12);
        assert_true(fabs(rest * prony_loss(&m, w) / (top * w * rate / (rate * rate + w * w)) - 1) < 1e-12);
        assert_true(fabs(rest * prony_relaxation(&m, 1 / w) / (rest + top * exp(-rate / w)) - 1) < 1e-12);
    }
}

static void nonnegative_answers_satisfy_the_conditions_of_the_minimum(void **state)
{
    (void)state;
    enum { ROWS = 12, COLUMNS = 8 };
    random_seed("problems", 31);
    for (int trial = 0; trial < 300; trial++) {
        double A[ROWS * COLUMNS], b[ROWS], x[COLUMNS], residual[ROWS];
        for (int i = 0; i < ROWS * COLUMNS; i++)
            A[i] = random_range(-1, 1);
        for (int i = 0; i < ROWS; i++)
            b[i] = random_range(-1, 1);
        assert_int_equal(nonnegative_solve(ROWS, COLUMNS, A, b, x), 0);
        for (int i = 0; i < ROWS; i++) {
            residual[i] = b[i];
            for (int c = 0; c < COLUMNS; c++)
                residual[i] -= A[i * COLUMNS + c] * x[c];
        }
        for (int c = 0; c < COLUMNS; c++) {
            double slope = 0;
            for (int i = 0; i < ROWS; i++)
                slope += A[i * COLUMNS + c] * residual[i];
            assert_true(x[c] >= 0);
            assert_true(x[c] > 0 ? fabs(slope) < 1e-10
                                 : slope < 1e-9); /* lengths of some 2: what steepest() stops at */
        }
    }
}

static void bad_data_are_refused_with_their_line(void **state)
{
    (void)state;
    static const char good[] = "omega [rad/s], G' [Pa], G'' [Pa]\n1, 1000, 50\n2, 1020, 60\n4, 1050, 70\n8, 1090, "
                               "75\n16, 1120, 70\n32, 1150, 60\n";
    static const struct {
        const char *from, *to;
        int status;
        long line;
        const char *says;
    } cases[] = {
        {"omega [rad/s]", "omega", STATUS_TABLE_SYNTAX, 0, "column 'omega' must be in [rad/s]"},
        {"omega [rad/s]", "speed [rad/s]", STATUS_TABLE_SYNTAX, 0, "neither frequencies"},
        {"G' [Pa]", "G'", STATUS_TABLE_SYNTAX, 0, "column 'G'' has no unit"},
        {"G' [Pa]", "G' [N]", STATUS_TABLE_SYNTAX, 0, "the unit 'N'"},
        {", G'' [Pa]", ", G3 [Pa]", STATUS_TABLE_SYNTAX, 0, "lacks G''"},
        {"4, 1050, 70", "4, 1050", STATUS_TABLE_SYNTAX, 4, "fewer fields"},
        {"4, 1050, 70", "4, 1050, x", STATUS_TABLE_SYNTAX, 4, "'x' in column 'G'''"},
        {"4, 1050, 70", "4, , 70", STATUS_FIT, 4, "G' is missing"},
        {"4, 1050, 70", "4, nan, 70", STATUS_FIT, 4, "G' is missing"},
        {"4, 1050, 70", "4, 1050, -70", STATUS_FIT, 4, "G'' = -70"},
        {"4, 1050, 70", "2, 1050, 70", STATUS_FIT, 4, "does not rise"},
        {"4, 1050, 70\n8, 1090, 75\n", "", STATUS_FIT, 0, "4 rows are too few"},
        {"1, 1000, 50\n2, 1020, 60\n4, 1050, 70\n8, 1090, 75\n16, 1120, 70\n32, 1150, 60\n",
         "10, 1000, 50\n11, 1010, 50\n12, 1020, 50\n13, 1030, 50\n14, 1040, 50\n", STATUS_FIT, 0, "factor of 3"},
        {"8, 1090, 75", "8, 1900, 75", STATUS_FIT, 0, "misses a value by"},
        {good, "t [s], G [Pa]\n1, 100\n2, 90\n4, 120\n8, 80\n16, 70\n", STATUS_FIT, 4, "relaxation only falls"},
        {good, "t [s], G [Pa]\n1, 1000\n2, 100\n4, 10\n8, 1\n16, 0.1\n32, 0.01\n", STATUS_FIT, 0, "no equilibrium"},
        {good, "t [s], G [Pa]\n1, 100\n2, 100\n4, 100\n8, 100\n16, 100\n", STATUS_FIT, 0, "no relaxation"},
        {good, "", STATUS_TABLE_SYNTAX, 0, "no header"},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char text[1000], place[80];
        struct prony_fit fit;
        struct failure why = {0};
        const char *at = strstr(good, cases[k].from);
        assert_non_null(at);
        snprintf(text, sizeof text, "%.*s%s%s", (int)(at - good), good, cases[k].to, at + strlen(cases[k].from));
        write_table(text);
        int status = prony_fit_file(path, &fit, &why);
        print_message("# %d: %s; %s\n", status, why.cause, why.remedy);
        assert_int_equal(status, cases[k].status);
        if (!strstr(why.cause, cases[k].says))
            fail_msg("'%s' is not in '%s'", cases[k].says, why.cause);
        if (cases[k].line) {
            snprintf(place, sizeof place, "%s:%ld", path, cases[k].line);
            assert_string_equal(why.place, place);
        }
        prony_fit_free(&fit);
    }
    struct prony_fit fit;
    struct failure why = {0};
    assert_int_equal(prony_fit_file("/nowhere/data.csv", &fit, &why), STATUS_FILE_OPEN);
    write_table(good);
    assert_int_equal(prony_fit_file(path, &fit, &why), STATUS_OK);
    prony_fit_free(&fit);
}

static int make_file(void **state)
{
    (void)state;
    int file = mkstemp(path);
    return file < 0 ? -1 : close(file);
}

static int remove_file(void **state)
{
    (void)state;
    return unlink(path);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(named_models_have_the_moduli_of_their_formulas),
        cmocka_unit_test(nonnegative_answers_satisfy_the_conditions_of_the_minimum),
        cmocka_unit_test(moduli_are_recovered_within_one_percent),
        cmocka_unit_test(relaxation_curves_give_the_moduli_too),
        cmocka_unit_test(bad_data_are_refused_with_their_line),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
