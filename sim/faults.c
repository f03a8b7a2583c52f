#include "faults.h"

/* SplitMix64 (Steele, Lea, Flood 2014): any seed is good, one addition per draw. */
static uint64_t draw(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

static bool happens(uint64_t *state, double probability)
{
    return (double)(draw(state) >> 11) * 0x1p-53 < probability;
}

void faults_start(struct faults *faults, const struct bus_faults *setting)
{
    faults->setting = *setting;
    faults->choice_state = setting->seed;
    faults->bit_state = ~setting->seed;
}

struct fault faults_next(struct faults *faults, const struct can_frame_t *frame)
{
    const struct bus_faults *p = &faults->setting;
    const struct fault dropped = {.drop = true};
    struct fault fault = {0};
    if (frame->id < p->id_from || frame->id > p->id_to)
        return fault;
    fault.drop = happens(&faults->choice_state, p->drop);
    fault.duplicate = happens(&faults->choice_state, p->duplicate);
    fault.delay = happens(&faults->choice_state, p->delay);
    fault.corrupt = happens(&faults->choice_state, p->corrupt);
    fault.reorder = happens(&faults->choice_state, p->reorder) && !fault.delay;
    return fault.drop ? dropped : fault;
}

void faults_corrupt(struct faults *faults, struct can_frame_t *frame)
{
    const unsigned id_bits = frame->flags & CAN_FLAG_EXTENDED ? 29 : 11;
    const unsigned bits = id_bits + (frame->flags & CAN_FLAG_RTR ? 0 : 8u * frame->length);
    const unsigned flips = 1 + (unsigned)(draw(&faults->bit_state) % 3);
    unsigned done[3] = {0};
    for (unsigned n = 0; n < flips;) {
        const unsigned bit = (unsigned)(draw(&faults->bit_state) % bits);
        bool again = false;
        for (unsigned i = 0; i < n; i++)
            again |= done[i] == bit;
        if (again)
            continue;
        done[n++] = bit;
        if (bit < id_bits)
            frame->id ^= 1u << bit;
        else
            frame->data[(bit - id_bits) / 8] ^= (uint8_t)(1u << (bit - id_bits) % 8);
    }
}
