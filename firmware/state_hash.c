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

uint32_t state_hash(const struct controller *c)
{
    uint32_t hash = mix(2166136261u, c->tick_count);
    hash = mix(hash, (uint32_t)c->safety.state);
    hash = mix(hash, c->safety.sequence);
    hash = mix(hash, c->safety.loss);
    hash = mix_vector(hash, c->kinematics.joint);
    hash = mix_vector(hash, c->kinematics.joint_speed);
    hash = mix_vector(hash, c->coupling.force_N);
    hash = mix_real(hash, c->coupling.gravity_share);
    hash = mix_real(hash, c->coupling.contact_share);
    hash = mix_real(hash, c->coupling.energy_J);
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
