#include "effects/quasi_nonlinear.h"

#include "real.h"

enum { LOOKS = 64 }; /* places at which a curve is seen to rise */

float quasi_nonlinear_value(const struct bank_curve *curve, float x, float *slope)
{
    const float s = x / curve->range, at = s < 1.0f ? s : 1.0f;
    float y = 0.0f, rise = 0.0f;
    for (uint32_t k = BANK_CURVE_DEGREE; k >= 1; k--) { /* bound: BANK_CURVE_DEGREE; Horner */
        rise = rise * at + (float)k * curve->coefficient[k - 1];
        y = (y + curve->coefficient[k - 1]) * at;
    }
    *slope = rise / curve->range;
    return s < 1.0f ? y : y + rise * (s - 1.0f);
}

static bool rises(const struct bank_curve *curve)
{
    bool good = curve->range > 0.0f && real_finite(curve->range) && curve->range <= BANK_MAX_CURVE;
    for (int k = 0; k < BANK_CURVE_DEGREE; k++) /* bound: BANK_CURVE_DEGREE */
        good = good && curve->coefficient[k] >= -BANK_MAX_CURVE && curve->coefficient[k] <= BANK_MAX_CURVE;
    for (int k = 0; k <= LOOKS; k++) { /* bound: LOOKS */
        float slope;
        (void)quasi_nonlinear_value(curve, curve->range * (float)k / (float)LOOKS, &slope);
        good = good && slope > 0.0f && real_finite(slope);
    }
    return good;
}

int quasi_nonlinear_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_QNLC);
    const struct bank_quasi_nonlinear *b = (const void *)((const char *)view->header + section->offset);
    if (view->header->effects &
        (EFFECT_FRICTION | EFFECT_SWING | EFFECT_VISCOELASTIC | EFFECT_GRASP | EFFECT_RIGID | EFFECT_NEO_HOOKEAN))
        return STATUS_BANK_SECTION;
    if (section->count != 1 || section->length != sizeof *b)
        return STATUS_BANK_LENGTH;
    bool good = b->has_across <= 1 && b->sample_per_tool > 0.0f && b->sample_per_tool <= BANK_MAX_CURVE && rises(&b->Q);
    if (good && b->has_across)
        good = rises(&b->P);
    view->quasi_nonlinear = b;
    return good ? STATUS_OK : STATUS_BANK_NONFINITE;
}

/* l: the root of l (1 - z) + z Q(l x) / x = 1, x in newtons of the sample; it lies in 0 .. 1 / (1 - z). */
static float balance(const struct bank_curve *Q, float x, float z)
{
    float low = 0.0f, high = 1.0f / (1.0f - z), l = 1.0f;
    for (int step = 0; step < QUASI_NONLINEAR_STEPS; step++) { /* bound: QUASI_NONLINEAR_STEPS */
        float slope, off = l * (1.0f - z) + z * quasi_nonlinear_value(Q, l * x, &slope) / x - 1.0f;
        if (off > 0.0f)
            high = l;
        else
            low = l;
        l -= off / (1.0f - z + z * slope);
        if (!(l >= low && l <= high))
            l = 0.5f * (low + high);
    }
    return l;
}

static void correct_tool(struct quasi_nonlinear *q, const struct bank_view *bank, struct contact_set *set,
                         uint32_t tool)
{
    const struct bank_quasi_nonlinear *b = bank->quasi_nonlinear;
    const float softness = 1.0f / bank->contact->coupling_stiffness_N_m;
    float F[3] = {0.0f, 0.0f, 0.0f}, all_J = 0.0f;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        if (contact_tool(at) != tool)
            continue;
        for (int a = 0; a < 3; a++) /* bound: 3 */
            F[a] += at->pressure_N * at->normal[a];
        for (uint32_t e = 0; e < set->count; e++) /* bound: CONTACT_MAX */
            if (contact_tool(&set->contact[e]) == tool)
                all_J += at->pressure_N * set->system[c][e] * set->contact[e].pressure_N;
    }
    const float squared = real_dot(F, F), x = b->sample_per_tool * real_sqrt(squared);
    if (!(x > 0.0f && all_J > 0.0f))
        return;
    float slope, z = real_clamp(softness * squared / all_J, 0.0f, 0.999f);
    const float l = balance(&b->Q, x, z), more = quasi_nonlinear_value(&b->Q, l * x, &slope) / x;
    q->beyond += l * x > b->Q.range;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        if (contact_tool(at) != tool)
            continue;
        for (int a = 0; a < 3; a++) {                    /* bound: 3 */
            for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
                set->force_N[t][a] += (more - 1.0f) * at->pressure_N * contact_pull(at, t)[a];
            at->displacement_m[a] *= l;
        }
        at->pressure_N *= more;
    }
}

void quasi_nonlinear_correct(struct quasi_nonlinear *q, const struct bank_view *bank, struct contact_set *set)
{
    const float softness = 1.0f / bank->contact->coupling_stiffness_N_m;
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
        for (int a = 0; a < 3; a++)              /* bound: 3 */
            q->linear_N[t][a] = set->force_N[t][a];
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
        correct_tool(q, bank, set, t);
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
        for (int a = 0; a < 3; a++)              /* bound: 3 */
            set->proxy_offset_m[t][a] = softness * set->force_N[t][a];
}
