/* A run on a synthetic bank, for the tests of the loop: session with device, hand, controller and host, and a listener
 * that checks every torque frame against what must always hold. */
#ifndef TROCAR_LOOP_FIXTURE_H
#define TROCAR_LOOP_FIXTURE_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "bank_fixture.h"
#include "crc.h"
#include "session.h"
#include "wire.h"

struct loop {
    struct bank_file bank;
    struct session *session;
    struct session_result result;
    /* of the torque frames as the controller sends them */
    struct wire_torques last;
    bool seen;
    uint32_t torques, emergencies;
    struct wire_emergency emergency;
    float last_force[3], largest_change_N; /* of the rendered force, from tick to tick */
};

static inline void loop_bank(struct loop *l, const struct bank_fixture_options *options)
{
    memset(l, 0, sizeof *l);
    l->bank.bytes = bank_fixture(options, &l->bank.length);
    assert_int_equal(bank_view_open(&l->bank.view, l->bank.bytes, l->bank.length), STATUS_OK);
}

/* What leaves the controller (frames that a fault touched are the bus's business): read from its queue's effect, the
 * listener, so only whole frames are judged. */
static inline void loop_listen(void *context, const struct can_frame_t *frame, uint64_t time_us)
{
    struct loop *l = context;
    (void)time_us;
    struct wire_torques t;
    if (frame->id == WIRE_TORQUES_ID + SESSION_NODE && wire_torques_unpack(&t, frame->data, frame->length) &&
        t.crc == crc8_frame(frame->id, frame->data, 7)) {
        l->torques++;
        l->last = t;
        l->seen = true;
    }
    if (frame->id == WIRE_EMERGENCY_ID + SESSION_NODE &&
        wire_emergency_unpack(&l->emergency, frame->data, frame->length))
        l->emergencies++;
}

static inline void loop_open(struct loop *l, const struct session_options *options)
{
    struct failure why = {0};
    int status = session_create(&l->bank, NULL, options, &l->session, &why);
    if (status)
        failure_print(stderr, &why);
    assert_int_equal(status, STATUS_OK);
    bus_listen(session_bus(l->session), loop_listen, l);
}

static inline float loop_length(const float v[3])
{
    return sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* One tick, and what must hold after every tick whatever happens: finite; the force within the clamp and the rate limit;
 * the torques within the motors' limits, zero unless enabled, and enabled only in RUN and SAFE. */
static inline bool loop_tick(struct loop *l)
{
    if (!session_tick(l->session))
        return false;
    const struct node *node = session_node(l->session);
    const struct controller *c = &node->controller;
    const struct bank_contact *limits = l->bank.view.contact;
    const struct bank_tool *tool = &l->bank.view.tools[0];
    const float *f = c->instrument[0].coupling.force_N;
    float change[3] = {f[0] - l->last_force[0], f[1] - l->last_force[1], f[2] - l->last_force[2]};
    memcpy(l->last_force, f, sizeof l->last_force);
    assert_true(isfinite(f[0]) && isfinite(f[1]) && isfinite(f[2]));
    const float rounding = 1 + 1e-5f; /* of three products, a sum and a root in single precision */
    assert_true(loop_length(f) <= limits->force_limit_N * rounding);
    float step = loop_length(change);
    l->largest_change_N = step > l->largest_change_N ? step : l->largest_change_N;
    /* in RUN the rate limit; the decay takes at most 1/decay_s of what is left; READY and INIT are silent at once, but
     * are reached only from SAFE at rest */
    float decay = limits->force_limit_N * 1e-3f / limits->decay_s, rate = limits->force_rate_N_s * 1e-3f;
    assert_true(step <= (rate > decay ? rate : decay) * rounding);
    for (int k = 0; k < 3; k++) {
        assert_true(fabsf(node->instrument[0].output.torque[k]) <= tool->axis[k].effort_limit);
        if (!node->instrument[0].output.enable)
            assert_true(node->instrument[0].output.torque[k] == 0);
    }
    if (node->instrument[0].output.enable)
        assert_true(c->instrument[0].safety.state == SAFETY_RUN || c->instrument[0].safety.state == SAFETY_SAFE);
    return true;
}

static inline void loop_run(struct loop *l, uint64_t ticks)
{
    for (uint64_t t = 0; t < ticks; t++)
        assert_true(loop_tick(l));
}

static inline void loop_close(struct loop *l)
{
    struct failure why = {0};
    assert_int_equal(session_finish(l->session, &l->result, &why), STATUS_OK);
    session_free(l->session);
    l->session = NULL;
}

static inline void loop_end(struct loop *l)
{
    session_free(l->session);
    free(l->bank.bytes);
}

static inline enum safety_state loop_state(const struct loop *l)
{
    return session_node(l->session)->controller.instrument[0].safety.state;
}

static inline float loop_force(const struct loop *l)
{
    return loop_length(session_node(l->session)->controller.instrument[0].coupling.force_N);
}

#endif
