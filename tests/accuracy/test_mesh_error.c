/* The mesh error: how much too stiff the shown body answers to a tool of a given radius, against the same body with every
 * element cut into eight, quadratic (for linear elements that is cut twice, nearly). Stiffness is force over the
 * displacement of the tool, both under the tool's weights (patch.h), pressed along the normal at random sites. Geometry and
 * clamped region are the same on both.
 *
 * How true the reference is: a liver of 412 nodes cut twice, into 64 parts, is softer than cut once by 0.5 % on average, at
 * nu = 0.45 and at 0.499, and full integration of the volume (element.h), which errs to the other side, differs from it by
 * 0.7 and 1.9 % there. With 20 mm tools next to nothing of the error comes from the weights on the shown surface, which give
 * the compliance of the exact traction to 0.1 %; with 10 mm, below an element's size, half of it does.
 *
 * Not the bank's error, which is measured apart against an exact solve of the same discretisation.
 *
 * Short form: a small liver at one nu, whose elements are to the tool what the thesis' are. TROCAR_LONG=1: an ovoid, a
 * cylinder and a liver of the thesis' size, nu = 0.3 .. 0.4999; a table. */
#include "mesh_error.h"
#include "refine.h"

enum { SITES = 12 };

static const double MIDDLE[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};

/* No part of a tool of 40 mm there is held. */
static bool is_free(const struct specimen *s, const bool *fixed, uint32_t triangle)
{
    struct failure why;
    struct patch p;
    must(patch_create(&s->mesh, &s->surface, triangle, MIDDLE, 0.04, &p, &why), &why);
    bool good = true;
    for (size_t k = 0; k < p.count; k++)
        good = good && !fixed[p.vertex[k]];
    patch_free(&p);
    return good;
}

struct errors {
    double worst[2][2], mean[2][2]; /* per order, per radius of 20 and 10 mm: relative error of the stiffness */
};

/* `s`: mesh and scene; its model is made here, of both orders. */
static struct errors measure(struct specimen *s, const char *name, double nu)
{
    static const double radius[2] = {0.02, 0.01};
    struct failure why;
    struct specimen fine;
    struct model *model[2];
    struct errors errors = {{{0}}, {{0}}};
    uint64_t seed = 7;
    s->scene.material[0].nu = nu;
    specimen_refine(s, &fine);
    fine.scene.order = ELEMENT_QUADRATIC;
    specimen_model(&fine);
    if (!s->surface.vertex_count)
        must(mesh_surface(&s->mesh, &s->surface, &why), &why);
    for (int order = 0; order < 2; order++) {
        s->scene.order = order ? ELEMENT_QUADRATIC : ELEMENT_LINEAR;
        must(model_create(&s->scene, &s->mesh, &s->surface, &model[order], &why), &why);
    }
    for (int site = 0; site < SITES;) {
        uint32_t t = (uint32_t)(draw(&seed) * (double)s->surface.triangle_count);
        if (!is_free(s, model_fixed_vertices(model[0]), t))
            continue;
        double centre[3], same[3];
        triangle_centre(&s->mesh, &s->surface, t, centre);
        uint32_t t_fine = triangle_at(&fine.mesh, &fine.surface, centre);
        triangle_centre(&fine.mesh, &fine.surface, t_fine, same);
        assert_true(hypot(hypot(same[0] - centre[0], same[1] - centre[1]), same[2] - centre[2]) < 1e-10);
        for (int r = 0; r < 2; r++) {
            struct patch tool, fine_tool;
            must(patch_create(&s->mesh, &s->surface, t, MIDDLE, radius[r], &tool, &why), &why);
            must(patch_create(&fine.mesh, &fine.surface, t_fine, MIDDLE, radius[r], &fine_tool, &why), &why);
            double truth, own;
            must(tool_compliance(fine.model, &fine_tool, fine_tool.normal, &truth, &why), &why);
            for (int order = 0; order < 2; order++) {
                must(tool_compliance(model[order], &tool, fine_tool.normal, &own, &why), &why);
                double error = truth / own - 1;
                errors.mean[order][r] += error / SITES;
                if (fabs(error) > fabs(errors.worst[order][r]))
                    errors.worst[order][r] = error;
            }
            patch_free(&tool);
            patch_free(&fine_tool);
        }
        site++;
    }
    for (int r = 0; r < 2; r++)
        print_message(
            "# %s, nu = %.4f, tool radius %2.0f mm: stiffness of P1 %+6.1f %% (worst %+6.1f %%), of P2 projected "
            "%+5.1f %% (worst %+5.1f %%)\n",
            name, nu, 1e3 * radius[r], 100 * errors.mean[0][r], 100 * errors.worst[0][r], 100 * errors.mean[1][r],
            100 * errors.worst[1][r]);
    specimen_free(&fine);
    for (int order = 0; order < 2; order++)
        model_free(model[order]);
    return errors;
}

/* The project's promise: 6 % at 20 mm, and at most a quarter of P1's. And no locking: near incompressibility the mean error
 * stays within 2 %, what the reference's own error explains, of what it is for the first nu; P1's grows tenfold. */
static void check(struct specimen *s, const char *name, size_t count, const double *nu)
{
    double first = 0;
    for (size_t k = 0; k < count; k++) {
        struct errors e = measure(s, name, nu[k]);
        assert_true(fabs(e.worst[1][0]) < 0.06);
        assert_true(fabs(e.worst[1][0]) < fabs(e.worst[0][0]) / 4);
        first = k == 0 ? fabs(e.mean[1][0]) : first;
        assert_true(fabs(e.mean[1][0]) < 0.02 + first);
    }
}

static bool data(struct specimen *s, const char *name, double extent_m)
{
    struct failure why;
    if (!specimen_data(s, name, 0.45))
        return false;
    must(mesh_scale(&s->mesh, extent_m, MESH_UNIT_NONE, &why), &why);
    specimen_clamp_end(s, 0, 0.12);
    return true;
}

static void quadratic_elements_are_too_stiff_by_few_percent_under_a_tool(void **state)
{
    (void)state;
    static const double one[] = {0.45}, all[] = {0.3, 0.45, 0.49, 0.499, 0.4999};
    struct specimen s;
    if (!getenv("TROCAR_LONG")) {
        if (!data(&s, "liver_smooth_412_1336.msh", 0.13))
            skip();
        check(&s, "liver_smooth_412_1336 of 0.13 m", 1, one);
        specimen_free(&s);
        return;
    }
    specimen_ovoid(&s, 0.013);
    specimen_material(&s, "all", 4000, 0.45);
    specimen_clamp_end(&s, 0, 0.14);
    check(&s, "ovoid", 5, all);
    specimen_free(&s);
    static const char *const others[] = {"cylinder_8x30x6.msh", "liver_smooth_1665_6691.msh"};
    for (int k = 0; k < 2; k++) {
        if (!data(&s, others[k], 0.214))
            continue;
        check(&s, others[k], 5, all);
        specimen_free(&s);
    }
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quadratic_elements_are_too_stiff_by_few_percent_under_a_tool),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
