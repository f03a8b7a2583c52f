#include "safety.h"

bool safety_sequence(struct safety *s, uint8_t sequence)
{
    uint8_t step = (uint8_t)(sequence - s->sequence) & 15u;
    if (s->sequence_known && step == 0) {
        s->duplicates++;
        s->discarded_run++;
        return false;
    }
    if (s->sequence_known && step > 8) { /* more than half the circle ahead is behind */
        s->out_of_sequence++;
        s->discarded_run++;
        return false;
    }
    s->sequence = sequence & 15u;
    s->sequence_known = true;
    return true;
}

void safety_doubt(struct safety *s, enum status reason)
{
    if (s->state == SAFETY_RUN) {
        s->state = SAFETY_SAFE;
        s->reason = reason;
        s->safe_entries++;
    } else if (s->state == SAFETY_READY) {
        s->state = SAFETY_INIT;
    }
    s->good_run = 0;
    s->loss = 0;
    s->sequence_known = false; /* a device that restarted may begin anywhere */
}

void safety_update(struct safety *s, bool fresh, bool plausible, bool overrun)
{
    if (fresh && plausible) {
        s->since_sample = 0;
        s->stale_run = s->implausible_run = 0;
        if (s->good_run < SAFETY_READY_SAMPLES)
            s->good_run++;
    } else if (fresh) {
        s->implausible++;
        s->implausible_run++;
        s->good_run = 0;
        if (s->implausible_run >= SAFETY_IMPLAUSIBLE_TICKS)
            safety_doubt(s, STATUS_LOOP_IMPLAUSIBLE);
    } else {
        if (s->state != SAFETY_INIT)
            s->missed++;
        s->stale_run++;
        s->loss += 3;
        s->since_sample++;
        s->good_run = 0;
        if (s->stale_run >= SAFETY_STALE_TICKS || s->loss > SAFETY_LOSS)
            safety_doubt(s, s->discarded_run ? STATUS_LOOP_SEQUENCE : STATUS_LOOP_STALE);
    }
    if (fresh)
        s->discarded_run = 0;

    s->loss -= s->loss > 0;
    s->overrun_run = overrun ? s->overrun_run + 1 : 0;
    if (overrun)
        s->overruns++;
    if (s->overrun_run >= SAFETY_OVERRUN_TICKS) {
        s->overrun_run = 0;
        safety_doubt(s, STATUS_LOOP_OVERRUN);
    }

    if (s->state == SAFETY_INIT && s->good_run >= SAFETY_READY_SAMPLES)
        s->state = SAFETY_READY;
}

void safety_acknowledge(struct safety *s, bool settled)
{
    if (s->state == SAFETY_READY && s->good_run >= SAFETY_READY_SAMPLES) {
        s->state = SAFETY_RUN;
    } else if (s->state == SAFETY_SAFE && settled && s->good_run >= SAFETY_READY_SAMPLES) {
        s->state = SAFETY_READY;
        s->reason = 0;
    }
}

bool safety_torque(const struct safety *s)
{
    return s->state == SAFETY_RUN || s->state == SAFETY_SAFE;
}
