/* Instruments beside a body, with a bank that names the effect rigid, for tests: placed anywhere, moved joint by joint through the
 * whole tick. The body is far away unless a test goes there. */
#ifndef TROCAR_RIGID_FIXTURE_H
#define TROCAR_RIGID_FIXTURE_H

#include <math.h>
#include <string.h>

#include "bank_fixture.h"
#include "random.h"
#include "tick.h"

struct rigid_section {
    struct bank_rigid head;
    struct bank_obstacle obstacle[BANK_MAX_OBSTACLES];
};

struct rigid_rig {
    unsigned char *bytes;
    size_t length;
    struct bank_view bank;
    struct controller c;
    uint8_t sequence;
    bool silent[2]; /* its samples do not come */
    double joint[2][3];
};

static const double RIG_SHAFT_m = 0.003;

static inline void rig_unit(double v[3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int k = 0; k < 3; k++)
        v[k] /= length;
}

/* An instrument of one point, the tip, with fine encoders: 40 urad, 12 um. */
static inline struct bank_tool rig_tool(const double trocar[3], const double axis[3], double tip_radius_m)
{
    struct bank_fixture_options o = bank_fixture_default;
    o.tip_points = 1;
    o.tip_radius_m = tip_radius_m;
    struct bank_tool t = fixture_tool(&o, 0);
    double z[3] = {axis[0], axis[1], axis[2]}, x[3] = {fabs(z[0]) < 0.9, fabs(z[0]) >= 0.9, 0};
    rig_unit(z);
    double along = x[0] * z[0] + x[1] * z[1];
    for (int k = 0; k < 3; k++)
        x[k] -= along * z[k];
    rig_unit(x);
    double y[3] = {z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]};
    for (int k = 0; k < 3; k++) {
        t.trocar_m[k] = (float)trocar[k];
        t.rotation[3 * k] = (float)x[k];
        t.rotation[3 * k + 1] = (float)y[k];
        t.rotation[3 * k + 2] = (float)z[k];
    }
    t.axis[0].per_count = t.axis[1].per_count = 4e-5f;
    t.axis[2].per_count = 1.2e-5f;
    return t;
}

static inline struct rigid_section rig_section(void)
{
    return (struct rigid_section){.head = {.shaft_radius_m = {(float)RIG_SHAFT_m, (float)RIG_SHAFT_m}}};
}

static inline void rig_obstacle(struct rigid_section *s, unsigned points, const double (*point)[3], double radius_m)
{
    struct bank_obstacle *o = &s->obstacle[s->head.obstacles++];
    *o = (struct bank_obstacle){.radius_m = (float)radius_m, .points = points};
    for (unsigned i = 0; i < points; i++)
        for (int k = 0; k < 3; k++)
            o->point_m[i][k] = (float)point[i][k];
}

static inline void rig_open(struct rigid_rig *r, unsigned instruments, const struct bank_tool *tool,
                            const struct rigid_section *section)
{
    struct bank_fixture_options o = bank_fixture_default;
    o.subdivisions = 1;
    o.instruments = instruments;
    o.tip_points = 1;
    o.tool = tool;
    o.rigid = &section->head;
    memset(r, 0, sizeof *r);
    r->bytes = bank_fixture(&o, &r->length);
    if (bank_view_open(&r->bank, r->bytes, r->length) != STATUS_OK ||
        controller_start(&r->c, &r->bank, NULL, 0) != STATUS_OK)
        abort();
    for (unsigned t = 0; t < 2; t++)
        r->joint[t][2] = 0.1;
}

static inline void rig_close(struct rigid_rig *r)
{
    free(r->bytes);
}

static inline void rig_tick(struct rigid_rig *r)
{
    struct tick_input in[TICK_INSTRUMENTS] = {{.fresh = false}};
    struct tick_output out[TICK_INSTRUMENTS];
    for (unsigned t = 0; t < r->bank.tool_count; t++) {
        const struct bank_axis *axis = r->bank.tools[t].axis;
        in[t].fresh = !r->silent[t];
        in[t].sequence = r->sequence & 15;
        for (int i = 0; i < 3; i++)
            in[t].counts[i] = (uint16_t)(axis[i].count_zero +
                                         lround((r->joint[t][i] - (double)axis[i].zero) / (double)axis[i].per_count));
    }
    r->sequence++;
    tick(&r->c, &r->bank, in, out);
}

/* An instrument in `ticks` to these joints. */
static inline void rig_go(struct rigid_rig *r, unsigned t, double alpha, double beta, double insertion_m, int ticks)
{
    double from[3], to[3] = {alpha, beta, insertion_m};
    memcpy(from, r->joint[t], sizeof from);
    for (int n = 1; n <= ticks; n++) {
        for (int i = 0; i < 3; i++)
            r->joint[t][i] = from[i] + (to[i] - from[i]) * n / ticks;
        rig_tick(r);
    }
}

static inline void rig_force(const struct rigid_rig *r, unsigned t, double f[3])
{
    for (int k = 0; k < 3; k++)
        f[k] = (double)r->c.contact.force_N[t][k];
}

static inline double rig_length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Joints that point the instrument at a place, its tip `insertion_m` from the trocar. */
static inline void rig_aim(const struct rigid_rig *r, unsigned t, const double at[3], double q[2])
{
    const struct bank_tool *tool = &r->bank.tools[t];
    double d[3], local[2] = {0, 0};
    for (int k = 0; k < 3; k++)
        d[k] = at[k] - (double)tool->trocar_m[k];
    rig_unit(d);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 2; i++)
            local[i] += (double)tool->rotation[3 * k + i] * d[k];
    for (int i = 0; i < 2; i++)
        q[i] = asin(local[i]);
}

#endif
