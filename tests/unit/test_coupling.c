/* Limits of the rendered force, its decay, and passivity: a wall that would make a sampled loop gain energy does not. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

#include "coupling.h"
#include "random.h"

static struct bank_contact limits = {.regularisation_m_N = 1e-5f,
                                     .coupling_stiffness_N_m = 1000,
                                     .coupling_damping_Ns_m = 0,
                                     .force_limit_N = 8.9f,
                                     .force_rate_N_s = 2000,
                                     .decay_s = 0.02f};
static const struct bank_view bank = {.contact = &limits};

static float length(const float v[3])
{
    return sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void force_never_passes_its_limit_nor_its_rate(void **state)
{
    (void)state;
    random_seed("limits", 9);
    struct coupling c = {.started = false};
    float tip[3] = {0}, last[3] = {0};
    for (int n = 0; n < 200000; n++) {
        float wanted[3], velocity[3];
        double size = pow(10, random_range(-3, 6));
        for (int i = 0; i < 3; i++) {
            wanted[i] = (float)random_range(-size, size);
            velocity[i] = (float)random_range(-1, 1);
            tip[i] += 1e-3f * velocity[i];
        }
        coupling_update(&c, &bank, wanted, tip, velocity, random_below(4) != 0);
        float change[3] = {c.force_N[0] - last[0], c.force_N[1] - last[1], c.force_N[2] - last[2]};
        assert_true(length(c.force_N) <= limits.force_limit_N * 1.000001f);
        assert_true(length(change) <= 2.0f * 1.00001f); /* 2000 N/s in a millisecond */
        memcpy(last, c.force_N, sizeof last);
    }
    assert_true(c.clamps > 0 && c.rate_limits > 0);
}

static void force_decays_to_exactly_zero_in_ten_time_constants(void **state)
{
    (void)state;
    struct coupling c = {.force_N = {6, -5, 4}, .gravity_share = 1};
    float before = length(c.force_N);
    int ticks = 0;
    while (!coupling_settled(&c)) {
        coupling_decay(&c, &bank);
        assert_true(length(c.force_N) < before);
        before = length(c.force_N) > 0 ? length(c.force_N) : 1e-30f;
        ticks++;
        assert_true(ticks <= 200);
    }
    /* 8.8 N to 1 mN: ln 8800 = 9.1 time constants */
    printf("# settled after %d ms\n", ticks);
}

/* A mass meets a wall of 12 kN/m sampled at 1 kHz with a delay of one tick and no friction at all: without the
 * controller each bounce gains energy. */
static double bounce(bool controlled)
{
    limits.coupling_stiffness_N_m = 12000; /* no contact is stiffer than the coupling (contact.h) */
    double mass = 0.1, x = 1e-3, v = -0.05, most = 0;
    struct coupling c = {.started = false};
    float force = 0;
    for (int n = 0; n < 4000; n++) {
        float tip[3] = {0, 0, (float)x}, velocity[3] = {0, 0, (float)v};
        float wanted[3] = {0, 0, x < 0 ? (float)(-12000 * x) : 0};
        if (controlled) {
            coupling_update(&c, &bank, wanted, tip, velocity, x < 0);
            force = c.force_N[2];
        } else {
            force = fminf(wanted[2], limits.force_limit_N);
        }
        for (int sub = 0; sub < 20; sub++) {
            v += 5e-5 * (force - 0.05) / mass; /* a light push keeps it at the wall */
            x += 5e-5 * v;
        }
        if (n > 2000 && x > 0 && force == 0) /* away from the wall: kinetic energy and that of the push */
            most = fmax(most, 0.5 * mass * v * v + 0.05 * x);
    }
    return most;
}

static void passivity_control_takes_back_what_sampling_creates(void **state)
{
    (void)state;
    double wild = bounce(false), tame = bounce(true), start = 0.5 * 0.1 * 0.05 * 0.05 + 0.05 * 1e-3;
    printf("# energy of a mass at a 12 kN/m wall: start %.3g J, without control %.3g J, with %.3g J\n", start, wild,
           tame);
    assert_true(wild > 2 * start);
    assert_true(tame <= start);
}

/* A store that is empty by a microjoule at a crawl must not be paid back in one kick. */
static void small_debts_are_paid_back_gently(void **state)
{
    (void)state;
    limits.coupling_stiffness_N_m = 1200;
    struct coupling c = {.started = true, .contact_share = 1, .force_N = {0, 0, 0.2f}, .energy_J = -15e-6f};
    float tip[3] = {0, 0, 15e-6f}, velocity[3] = {0, 0, 0.015f}, wanted[3] = {0, 0, 0.2f}; /* 15 um in a tick */
    coupling_update(&c, &bank, wanted, tip, velocity, true);
    assert_int_equal(c.passivity_interventions, 1);
    assert_true(fabsf(c.force_N[2] - 0.2f) <= 1200 * 15e-6f * 1.001f); /* k v T: 18 mN, not the 1.2 N of energy / way */
    assert_true(c.force_N[2] < 0.2f);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(force_never_passes_its_limit_nor_its_rate),
        cmocka_unit_test(force_decays_to_exactly_zero_in_ten_time_constants),
        cmocka_unit_test(small_debts_are_paid_back_gently),
        cmocka_unit_test(passivity_control_takes_back_what_sampling_creates),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
