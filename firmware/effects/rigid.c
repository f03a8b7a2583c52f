#include "effects/rigid.h"

#include "real.h"

/* A body as it meets others: now, as the device has it, and as the proxy was. */
struct piece {
    bool there;
    float radius_m;
    struct convex now, was;
};

struct body {
    float now_m[3][3], was_m[3][3]; /* of an instrument: trocar, where the shaft leaves the cannula, tip */
    struct piece piece[RIGID_PIECES];
    uint32_t pieces;
};

/* How deep two pieces touch, and where: on the cores of the proxies. */
struct touch {
    float depth_m, normal[3], on_a_m[3], on_b_m[3];
};

/* The candidate of two bodies that would push the hands most. */
struct best {
    float push2;
    struct contact contact;
};

float rigid_stop(const struct bank_view *bank, uint32_t tool)
{
    const struct bank_rigid *b = bank->rigid;
    float tip = bank->tools[tool].tip_radius_m, cannula = b->cannula_radius_m;
    if (cannula == 0.0f || tip <= cannula)
        return 0.0f;
    return b->cannula_inside_m + real_sqrt(tip * tip - cannula * cannula);
}

uint32_t rigid_most(const struct bank_view *bank)
{
    uint32_t most = bank->tool_count == 2;
    for (uint32_t t = 0; t < bank->tool_count; t++) /* bound: BANK_MAX_INSTRUMENTS */
        most += bank->rigid->obstacles + (rigid_stop(bank, t) > 0.0f);
    return most;
}

static bool within(float x, float low, float high)
{
    return x >= low && x <= high;
}

static bool obstacle_good(const struct bank_obstacle *o)
{
    bool good = within(o->radius_m, 0.0f, 1.0f) && o->points >= 1 && o->points <= BANK_MAX_OBSTACLE_POINTS &&
                o->reserved[0] == 0 && o->reserved[1] == 0;
    for (uint32_t i = 0; i < BANK_MAX_OBSTACLE_POINTS; i++) /* bound: BANK_MAX_OBSTACLE_POINTS */
        for (int k = 0; k < 3; k++)                         /* bound: 3 */
            good = good && within(o->point_m[i][k], -BANK_MAX_POSITION_M, BANK_MAX_POSITION_M);
    return good;
}

int rigid_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_RIGD);
    const struct bank_rigid *b = (const void *)((const char *)view->header + section->offset);
    const struct bank_obstacle *obstacle = (const void *)(b + 1);
    if (section->count > BANK_MAX_OBSTACLES || section->length != sizeof *b + section->count * sizeof *obstacle)
        return STATUS_BANK_LENGTH;
    const uint32_t apart = EFFECT_NEO_HOOKEAN | EFFECT_QUASI_NONLINEAR;
    bool good = b->obstacles == section->count && !(view->header->effects & apart) && b->reserved[0] == 0 &&
                b->reserved[1] == 0 && b->reserved[2] == 0;
    for (uint32_t t = 0; t < BANK_MAX_INSTRUMENTS; t++) /* bound: BANK_MAX_INSTRUMENTS */
        good = good && within(b->shaft_radius_m[t], BANK_MIN_SHAFT_M, 1.0f);
    good = good && within(b->cannula_radius_m, 0.0f, 1.0f) && within(b->cannula_inside_m, 0.0f, 1.0f);
    uint32_t points = 0;
    for (uint32_t t = 0; t < view->tool_count; t++) { /* bound: BANK_MAX_INSTRUMENTS */
        good = good && (b->cannula_radius_m == 0.0f || b->cannula_radius_m >= b->shaft_radius_m[t]);
        points += view->tools[t].point_count;
    }
    view->rigid = b;
    if (!good || points + rigid_most(view) > CONTACT_MAX)
        return STATUS_BANK_NONFINITE;
    for (uint32_t i = 0; i < b->obstacles; i++) { /* bound: BANK_MAX_OBSTACLES */
        view->fault_record = i;
        if (!obstacle_good(&obstacle[i]))
            return STATUS_BANK_NONFINITE;
    }
    view->fault_record = 0;
    return STATUS_OK;
}

static void place(const struct bank_rigid *b, const struct bank_tool *tool, const float tip_m[3], float point_m[3][3])
{
    float axis[3];
    real_subtract(tip_m, tool->trocar_m, axis);
    float length = real_sqrt(real_dot(axis, axis));
    float share = length > b->cannula_inside_m ? b->cannula_inside_m / length : 1.0f;
    for (int k = 0; k < 3; k++) { /* bound: 3 */
        point_m[0][k] = tool->trocar_m[k];
        point_m[1][k] = tool->trocar_m[k] + share * axis[k];
        point_m[2][k] = tip_m[k];
    }
}

static struct piece piece_of(const struct body *body, uint32_t first, uint32_t count, float radius_m, bool there)
{
    return (struct piece){there,
                          radius_m,
                          {(const float(*)[3])body->now_m + first, count},
                          {(const float(*)[3])body->was_m + first, count}};
}

/* `body` must stay where it is: its pieces point into it. */
static void instrument(struct body *body, const struct bank_view *bank, uint32_t t, const struct kinematics *pose,
                       const float proxy_m[3])
{
    const struct bank_rigid *b = bank->rigid;
    const struct bank_tool *tool = &bank->tools[t];
    bool out = pose->joint[2] > b->cannula_inside_m;
    place(b, tool, pose->tip_m, body->now_m);
    place(b, tool, proxy_m, body->was_m);
    body->pieces = RIGID_PIECES;
    body->piece[RIGID_CANNULA] = piece_of(body, 0, 2, b->cannula_radius_m, b->cannula_radius_m > 0.0f);
    body->piece[RIGID_SHAFT] = piece_of(body, 1, 2, b->shaft_radius_m[t], out);
    body->piece[RIGID_TIP] = piece_of(body, 2, 1, tool->tip_radius_m, out && tool->tip_radius_m > b->shaft_radius_m[t]);
}

static void obstacle(struct body *body, const struct bank_obstacle *o)
{
    struct convex hull = {o->point_m, o->points};
    body->pieces = 1;
    body->piece[0] = (struct piece){true, o->radius_m, hull, hull};
}

/* Whether and where two pieces touch, and on which side they are. */
static bool meet(struct rigid_side *side, const struct piece *a, const struct piece *b, struct touch *touch)
{
    static const float any[3] = {0.0f, 0.0f, 1.0f};
    float reach = a->radius_m + b->radius_m, on_a_m[3], on_b_m[3], away[3];
    struct convex_closest now, was;
    if (!a->there || !b->there) {
        side->known = false;
        return false;
    }
    if (side->known && convex_gap(a->now, b->now, side->normal) > reach + RIGID_NEAR_m)
        return false;
    convex_closest(a->now, b->now, side->known ? side->normal : any, &now);
    if (!side->known && !now.apart)
        return false; /* one inside the other from the start: there is no way out to point to */
    if (side->known)
        convex_closest(a->was, b->was, side->normal, &was);
    else
        was = now;
    bool clear = now.apart && now.distance_m >= reach;
    if (clear && (!side->known || convex_gap(a->was, b->was, now.normal) > 0.0f))
        was = now;
    for (int k = 0; k < 3 && was.apart; k++) /* bound: 3 */
        side->normal[k] = was.normal[k];
    side->known = true;
    convex_points(&was.feature, a->was, b->was, touch->on_a_m, touch->on_b_m);
    convex_points(&was.feature, a->now, b->now, on_a_m, on_b_m);
    real_subtract(on_a_m, on_b_m, away);
    touch->depth_m = reach - real_dot(side->normal, away);
    for (int k = 0; k < 3; k++) /* bound: 3 */
        touch->normal[k] = side->normal[k];
    return touch->depth_m > 0.0f;
}

/* The force at the proxy's tip that does the work of a unit push along sign n at a point of its axis: what is across the axis by the
 * lever of the trocar, what is along it as it is; but the trocar holds a cannula along its axis. */
static void pull(const struct body *body, uint32_t piece, const float at_m[3], const float normal[3], float sign,
                 float out[3])
{
    float axis[3], from[3];
    real_subtract(body->was_m[2], body->was_m[0], axis);
    real_subtract(at_m, body->was_m[0], from);
    float length2 = real_dot(axis, axis), lever = real_dot(from, axis) / length2;
    float along = real_dot(normal, axis) / length2, kept = piece == RIGID_CANNULA ? 0.0f : along;
    for (int k = 0; k < 3; k++) /* bound: 3 */
        out[k] = sign * (kept * axis[k] + lever * (normal[k] - along * axis[k]));
}

static float pull2(const struct contact *c)
{
    float sum = 0.0f;
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) /* bound: CONTACT_TOOLS */
        sum += real_dot(c->pull[t], c->pull[t]);
    return sum;
}

/* Depth over lever is how far the tips would have to give way. */
static void offer(struct best *best, const struct contact *c)
{
    float lever2 = pull2(c);
    if (lever2 < RIGID_LEAST_PULL2 || c->depth_m * c->depth_m <= best->push2 * lever2)
        return;
    best->push2 = c->depth_m * c->depth_m / lever2;
    best->contact = *c;
}

/* Behind the tissue's contacts. */
static void add(struct contact_set *set, const struct bank_view *bank, const struct best *best, uint32_t place)
{
    if (best->push2 == 0.0f || set->count + set->rigid == CONTACT_MAX)
        return;
    struct contact *c = &set->contact[set->count + set->rigid++];
    *c = best->contact;
    c->point = CONTACT_MAX + place;
    c->pad_m_N = RIGID_GIVE * pull2(c) / bank->contact->coupling_stiffness_N_m;
}

static void against(struct rigid *r, const struct bank_obstacle *o, uint32_t number, const struct body *body,
                    uint32_t t, struct best *best)
{
    struct body other;
    obstacle(&other, o);
    for (uint32_t i = 0; i < body->pieces; i++) { /* bound: RIGID_PIECES */
        struct touch touch;
        if (!meet(&r->tool[t].side[number][i], &body->piece[i], &other.piece[0], &touch))
            continue;
        struct contact c = {.depth_m = touch.depth_m};
        IF_SECOND(c.tool = t;)
        for (int k = 0; k < 3; k++) /* bound: 3 */
            c.normal[k] = touch.normal[k];
        pull(body, i, touch.on_a_m, touch.normal, 1.0f, c.pull[t]);
        offer(best, &c);
    }
}

/* Its own cannula's rim stops a tip that is thicker. */
static void stop(const struct body *body, float at_m, uint32_t t, struct best *best)
{
    float was[3], now[3];
    real_subtract(body->was_m[2], body->was_m[0], was);
    real_subtract(body->now_m[2], body->now_m[0], now);
    float length = real_sqrt(real_dot(was, was));
    struct contact c = {.depth_m = at_m - real_dot(was, now) / length};
    if (!(c.depth_m > 0.0f))
        return;
    IF_SECOND(c.tool = t;)
    for (int k = 0; k < 3; k++) /* bound: 3 */
        c.normal[k] = c.pull[t][k] = was[k] / length;
    offer(best, &c);
}

IF_SECOND(static void each_other(struct rigid *r, const struct body *body, struct best *best) {
    for (uint32_t i = 0; i < RIGID_PIECES; i++)       /* bound: RIGID_PIECES */
        for (uint32_t j = 0; j < RIGID_PIECES; j++) { /* bound: RIGID_PIECES */
            struct touch touch;
            if (!meet(&r->across[i][j], &body[0].piece[i], &body[1].piece[j], &touch))
                continue;
            struct contact c = {.depth_m = touch.depth_m};
            for (int k = 0; k < 3; k++) /* bound: 3 */
                c.normal[k] = touch.normal[k];
            pull(&body[0], i, touch.on_a_m, touch.normal, 1.0f, c.pull[0]);
            pull(&body[1], j, touch.on_b_m, touch.normal, -1.0f, c.pull[1]);
            offer(best, &c);
        }
})

void rigid_respond(struct rigid *r, const struct bank_view *bank, struct contact_set *set,
                   const struct kinematics *const pose[CONTACT_TOOLS])
{
    const struct bank_rigid *b = bank->rigid;
    const struct bank_obstacle *obstacles = (const void *)(b + 1);
    struct body body[CONTACT_TOOLS];
    uint32_t number = 0; /* of the pairs of bodies, always in the same order */
    bool all = true;
    set->rigid = 0;
    for (uint32_t t = 0; t < CONTACT_TOOLS && t < bank->tool_count; t++) { /* bound: CONTACT_TOOLS */
        float at_m = rigid_stop(bank, t);
        all = all && pose[t];
        if (!pose[t]) {
            number += b->obstacles + (at_m > 0.0f);
            continue;
        }
        instrument(&body[t], bank, t, pose[t], r->tool[t].known ? r->tool[t].proxy_m : pose[t]->tip_m);
        for (uint32_t i = 0; i < b->obstacles; i++, number++) { /* bound: BANK_MAX_OBSTACLES */
            struct best best = {.push2 = 0.0f};
            against(r, &obstacles[i], i, &body[t], t, &best);
            add(set, bank, &best, number);
        }
        if (at_m > 0.0f) {
            struct best best = {.push2 = 0.0f};
            stop(&body[t], at_m, t, &best);
            add(set, bank, &best, number++);
        }
    }
    (void)all;
    IF_SECOND(if (all && bank->tool_count == 2) {
        struct best best = {.push2 = 0.0f};
        each_other(r, body, &best);
        add(set, bank, &best, number);
    })
}

void rigid_stiffen(struct contact_set *set, float stiffening)
{
    for (uint32_t c = set->count; c < contact_all(set); c++) { /* bound: CONTACT_MAX */
        set->contact[c].depth_m *= stiffening;
        set->contact[c].pad_m_N *= stiffening;
    }
}

void rigid_follow(struct rigid *r, const struct contact_set *set, const struct kinematics *const pose[CONTACT_TOOLS])
{
    for (uint32_t t = 0; t < CONTACT_TOOLS; t++) { /* bound: CONTACT_TOOLS */
        r->tool[t].known = pose[t] != NULL;
        for (int k = 0; k < 3 && pose[t]; k++) /* bound: 3 */
            r->tool[t].proxy_m[k] = pose[t]->tip_m[k] + set->proxy_offset_m[t][k];
    }
}

void rigid_forget(struct rigid *r, uint32_t tool)
{
    r->tool[tool].known = false;
    for (uint32_t i = 0; i < BANK_MAX_OBSTACLES; i++) /* bound: BANK_MAX_OBSTACLES */
        for (uint32_t p = 0; p < RIGID_PIECES; p++)   /* bound: RIGID_PIECES */
            r->tool[tool].side[i][p].known = false;
    IF_SECOND(for (uint32_t i = 0; i < RIGID_PIECES; i++) /* bound: RIGID_PIECES */
              for (uint32_t j = 0; j < RIGID_PIECES; j++) /* bound: RIGID_PIECES */
              r->across[i][j]
                  .known = false;)
}
