#include "state_hash.h"

static uint32_t mix(uint32_t hash, uint32_t word)
{
    return (hash ^ word) * 16777619u;
}

static uint32_t mix_real(uint32_t hash, float x)
{
    union {
        float value;
        uint32_t bits;
    } u = {.value = x};
    return mix(hash, u.bits);
}

static uint32_t mix_vector(uint32_t hash, const float v[3])
{
    for (int k = 0; k < 3; k++) /* bound: 3 */
        hash = mix_real(hash, v[k]);
    return hash;
}

static uint32_t mix_instrument(uint32_t hash, const struct instrument *i)
{
    hash = mix(hash, (uint32_t)i->safety.state);
    hash = mix(hash, i->safety.sequence);
    hash = mix(hash, i->safety.loss);
    hash = mix_vector(hash, i->kinematics.joint);
    hash = mix_vector(hash, i->kinematics.joint_speed);
    hash = mix_vector(hash, i->coupling.force_N);
    hash = mix_real(hash, i->coupling.gravity_share);
    hash = mix_real(hash, i->coupling.contact_share);
    return mix_real(hash, i->coupling.energy_J);
}

uint32_t state_hash(const struct controller *c)
{
    uint32_t hash = mix(2166136261u, c->tick_count);
    for (uint32_t t = 0; t < tick_instruments(c); t++) /* bound: TICK_INSTRUMENTS */
        hash = mix_instrument(hash, &c->instrument[t]);
    for (uint32_t i = 0; i < c->collide.count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        const struct collide_point *p = &c->collide.point[i];
        if (!p->touching)
            continue;
        hash = mix(mix(hash, i), p->triangle);
        hash = mix_vector(hash, p->weights);
        hash = mix_real(hash, p->depth_m);
    }
    return mix(hash, c->contact.active);
}
