/* The field on the page: contacts of two links, and the swing on top. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "bank.h"
#include "bank_fixture.h"
#include "bank_view.h"
#include "shown_field.h"

enum { MODES = 2 };

static struct bank_view bank;
static unsigned char *bytes;
static float *shape; /* per mode and vertex */
static double *u, *wanted;
static struct link links[2];

/* Shapes of no meaning: the arithmetic does not ask. */
static int setup(void **state)
{
    (void)state;
    struct bank_fixture_options o = bank_fixture_default;
    const size_t vertices = 162;
    struct bank_swing *swing = calloc(1, sizeof *swing + MODES * 12 * vertices);
    shape = (float *)(swing + 1);
    swing->modes = MODES;
    for (size_t i = 0; i < MODES * 3 * vertices; i++)
        shape[i] = 0.01f * (float)((int)(i * 7 % 19) - 9);
    o.swing = swing;
    size_t length;
    bytes = bank_fixture(&o, &length);
    assert_int_equal(bank_view_open(&bank, bytes, length), STATUS_OK);
    assert_int_equal(bank.vertex_count, vertices);
    free(swing);
    shape = (float *)(bank.swing + 1);
    u = calloc(3 * vertices, sizeof *u);
    wanted = calloc(3 * vertices, sizeof *wanted);
    memset(links, 0, sizeof links);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    free(bytes);
    free(u);
    free(wanted);
    return 0;
}

/* A contact on vertex 0 of a triangle of free vertices. */
static uint32_t touch(struct link *link, uint32_t from)
{
    uint32_t t = from;
    while (bank.row_of[bank.triangles[t].vertex[0]] == BANK_NONE)
        t++;
    link->contact[link->contact_count++] = (struct link_contact){t, {0, 0}, {0.001, -0.003, 0.004}};
    return t;
}

static void without_contact_the_organ_is_where_its_modes_are(void **state)
{
    (void)state;
    const float amplitude[BANK_MAX_MODES] = {0.25f, -0.125f};
    struct failure why;
    assert_int_equal(shown_field(&bank, links, 2, amplitude, u, &why), STATUS_OK);
    for (size_t i = 0; i < 3 * (size_t)bank.vertex_count; i++)
        assert_float_equal(u[i], 0.25 * (double)shape[i] - 0.125 * (double)shape[3 * bank.vertex_count + i], 1e-15);
    assert_int_equal(shown_field(&bank, links, 2, NULL, u, &why), STATUS_OK);
    for (size_t i = 0; i < 3 * (size_t)bank.vertex_count; i++)
        assert_float_equal(u[i], 0, 0);
}

/* Two links' contacts are one system; and modes at their load add nothing to it, ahead of it what they are ahead. */
static void with_contacts_the_modes_add_what_they_are_ahead_of_their_load(void **state)
{
    (void)state;
    struct failure why;
    const uint32_t triangle[2] = {touch(&links[0], 10), touch(&links[1], 150)};
    double displacement[6], weights[4] = {0}, force[6];
    for (int t = 0; t < 2; t++)
        memcpy(displacement + 3 * t, links[t].contact[0].displacement_m, 3 * sizeof *displacement);
    assert_int_equal(field_from_contacts(&bank, 2, triangle, weights, displacement, wanted, force, &why), STATUS_OK);
    float amplitude[BANK_MAX_MODES] = {0};
    for (size_t k = 0; k < MODES; k++)
        for (int i = 0; i < 6; i++)
            amplitude[k] +=
                shape[3 * (k * bank.vertex_count + bank.triangles[triangle[i / 3]].vertex[0]) + (size_t)(i % 3)] *
                (float)force[i];
    amplitude[1] += 0.5f;
    assert_int_equal(shown_field(&bank, links, 2, amplitude, u, &why), STATUS_OK);
    /* single precision of the amplitudes: some 1e-7 of them, times shapes of 0.1 */
    const double rounding = 1e-7 * (1 + fabs((double)amplitude[0]) + fabs((double)amplitude[1]));
    for (size_t i = 0; i < 3 * (size_t)bank.vertex_count; i++)
        assert_float_equal(u[i], wanted[i] + 0.5 * (double)shape[3 * bank.vertex_count + i], rounding);
}

static void foreign_triangles_are_left_out(void **state)
{
    (void)state;
    struct failure why;
    links[0].contact[0] = (struct link_contact){bank.triangle_count, {0, 0}, {0, 0, 0.01}};
    links[0].contact_count = 1;
    assert_int_equal(shown_field(&bank, links, 1, NULL, u, &why), STATUS_OK);
    for (size_t i = 0; i < 3 * (size_t)bank.vertex_count; i++)
        assert_float_equal(u[i], 0, 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {TEST(without_contact_the_organ_is_where_its_modes_are),
                                       TEST(with_contacts_the_modes_add_what_they_are_ahead_of_their_load),
                                       TEST(foreign_triangles_are_left_out)};
    return cmocka_run_group_tests_name("shown field", tests, NULL, NULL);
}
