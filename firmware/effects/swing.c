#include "effects/swing.h"

#include "real.h"

static const float *shapes(const struct bank_swing *b)
{
    return (const float *)(b + 1);
}

int swing_open(struct bank_view *view)
{
    const struct bank_section *section = bank_view_section(view, BANK_SWNG);
    const struct bank_swing *b = (const void *)((const char *)view->header + section->offset);
    if (section->length < sizeof *b || section->count < 1 || section->count > BANK_MAX_MODES ||
        section->length != sizeof *b + 12u * section->count * view->vertex_count)
        return STATUS_BANK_LENGTH;
    bool good = b->modes == section->count && b->reserved[0] == 0 && b->reserved[1] == 0 && b->reserved[2] == 0;
    for (uint32_t k = 0; k < BANK_MAX_MODES; k++) { /* bound: BANK_MAX_MODES */
        const struct bank_mode *m = &b->mode[k];
        const float turn[4] = {m->drive, m->glide, m->pull, m->drag};
        for (int i = 0; i < 4; i++) /* bound: 4 */
            good =
                good && turn[i] >= 0.0f && turn[i] <= 1.0f; /* a mode that takes several ticks to turn, and is damped */
        for (int i = 0; i < 12; i++)                        /* bound: 12 */
            good = good && real_finite(m->affine[i]);
    }
    const float *shape = shapes(b);
    for (uint32_t i = 0; i < 3 * section->count * view->vertex_count;
         i++) /* bound: BANK_MAX_MODES x BANK_MAX_VERTICES x 3 */
        good = good && real_finite(shape[i]);
    view->swing = b;
    return good ? STATUS_OK : STATUS_BANK_NONFINITE;
}

void swing_move(struct swing *s, const struct bank_view *bank, float (*points_m)[3], uint32_t count)
{
    const struct bank_swing *b = bank->swing;
    float map[12] = {0.0f};
    for (uint32_t k = 0; k < b->modes; k++) { /* bound: BANK_MAX_MODES */
        const struct bank_mode *m = &b->mode[k];
        s->free[k] = s->amplitude[k] - m->drive * s->amplitude[k] + m->glide * s->speed[k];
        for (int i = 0; i < 12; i++) /* bound: 12 */
            map[i] += s->free[k] * m->affine[i];
    }
    for (uint32_t i = 0; i < count; i++) { /* bound: BANK_MAX_TOOL_POINTS */
        float *x = points_m[i], *moved = s->moved_m[i];
        for (int a = 0; a < 3; a++) /* bound: 3 */
            moved[a] = map[4 * a] * x[0] + map[4 * a + 1] * x[1] + map[4 * a + 2] * x[2] + map[4 * a + 3];
        for (int a = 0; a < 3; a++) /* bound: 3 */
            x[a] -= moved[a];
    }
}

/* Depth below the surface as it has swung. */
void swing_place(struct swing *s, const struct bank_view *bank, struct contact_set *set)
{
    const struct bank_swing *b = bank->swing;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        struct contact *at = &set->contact[c];
        const uint16_t *vertex = bank->triangles[at->triangle].vertex;
        float off[3];
        for (int a = 0; a < 3; a++) /* bound: 3 */
            off[a] = -s->moved_m[at->point][a];
        for (uint32_t k = 0; k < b->modes; k++) /* bound: BANK_MAX_MODES */
            for (int i = 0; i < 3; i++) {       /* bound: 3 */
                const float *shape = shapes(b) + 3u * (k * bank->vertex_count + vertex[i]);
                for (int a = 0; a < 3; a++) /* bound: 3 */
                    off[a] += s->free[k] * at->weights[i] * shape[a];
            }
        at->depth_m += real_dot(at->normal, off);
    }
}

/* s and s . n at the anchors of the admitted contacts. */
static void shapes_at_contacts(struct swing *s, const struct bank_view *bank, const struct contact_set *set)
{
    const struct bank_swing *b = bank->swing;
    for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
        const struct contact *at = &set->contact[c];
        const uint16_t *vertex = bank->triangles[at->triangle].vertex;
        for (uint32_t k = 0; k < b->modes; k++) { /* bound: BANK_MAX_MODES */
            float *shape = s->shape[c][k];
            shape[0] = shape[1] = shape[2] = 0.0f;
            for (int i = 0; i < 3; i++) { /* bound: 3 */
                const float *at_vertex = shapes(b) + 3u * (k * bank->vertex_count + vertex[i]);
                for (int a = 0; a < 3; a++) /* bound: 3 */
                    shape[a] += at->weights[i] * at_vertex[a];
            }
            s->push[c][k] = real_dot(shape, at->normal);
        }
    }
}

/* Whether n . B n without `part` of the modes is positive definite by more than a part in 2^16 of its diagonal. */
static bool positive(const struct swing *s, const struct bank_swing *b, const struct contact_set *set, float part)
{
    float L[CONTACT_MAX][CONTACT_MAX], pivot[CONTACT_MAX];
    for (uint32_t i = 0; i < set->count; i++) /* bound: CONTACT_MAX */
        for (uint32_t j = 0; j <= i; j++) {   /* bound: CONTACT_MAX */
            float moved[3];
            contact_multiply(set, i, j, set->contact[j].normal, moved);
            float a = real_dot(set->contact[i].normal, moved), whole = a, sum;
            for (uint32_t k = 0; k < b->modes; k++) /* bound: BANK_MAX_MODES */
                a -= part * (1.0f - b->mode[k].drive) * s->push[i][k] * s->push[j][k];
            sum = a;
            for (uint32_t k = 0; k < j; k++) /* bound: CONTACT_MAX */
                sum -= L[i][k] * L[j][k] * pivot[k];
            if (i == j) {
                pivot[i] = sum;
                if (!(sum > -1.52587890625e-5f * whole))
                    return false;
                /* points in one spot: what is left of the later one is rounding */
                pivot[i] = sum > 1.52587890625e-5f * whole ? sum : 1.52587890625e-5f * whole;
            } else {
                L[i][j] = sum / pivot[j];
            }
        }
    return true;
}

void swing_respond(struct swing *s, const struct bank_view *bank, struct contact_set *set)
{
    const struct bank_swing *b = bank->swing;
    shapes_at_contacts(s, bank, set);
    s->part = positive(s, b, set, 1.0f) ? 1.0f : positive(s, b, set, 0.5f) ? 0.5f : 0.0f;
    s->withheld += s->part < 1.0f;
    for (uint32_t k = 0; k < b->modes; k++) { /* bound: BANK_MAX_MODES */
        float taken = s->part * (1.0f - b->mode[k].drive);
        for (uint32_t c = 0; c < set->count; c++) /* bound: CONTACT_MAX */
            for (uint32_t d = 0; d <= c; d++)     /* bound: CONTACT_MAX */
                for (int e = 0; e < 9; e++)       /* bound: 9 */
                    set->block[contact_pair(c, d)][e] -= taken * s->shape[c][k][e / 3] * s->shape[d][k][e % 3];
    }
}

/* The load of this tick moves the modes on. Contacts then report depth and displacement as they would be at rest under the same
 * forces, so that who listens and has the static compliance finds the forces again. */
void swing_follow(struct swing *s, const struct bank_view *bank, struct contact_set *set)
{
    const struct bank_swing *b = bank->swing;
    for (uint32_t k = 0; k < b->modes; k++) { /* bound: BANK_MAX_MODES */
        const struct bank_mode *m = &b->mode[k];
        float load = 0.0f;
        for (uint32_t c = 0; c < set->count; c++) /* bound: CONTACT_MAX */
            load -= set->contact[c].pressure_N * s->push[c][k];
        float rest = s->part * (1.0f - m->drive) * load;
        for (uint32_t c = 0; c < set->count; c++) { /* bound: CONTACT_MAX */
            set->contact[c].depth_m -= s->push[c][k] * rest;
            for (int a = 0; a < 3; a++) /* bound: 3 */
                set->contact[c].displacement_m[a] += s->shape[c][k][a] * rest;
        }
        float behind = load - s->amplitude[k];
        s->amplitude[k] += m->drive * behind + m->glide * s->speed[k];
        s->speed[k] += m->pull * behind - m->drag * s->speed[k];
    }
}

void swing_forget(struct swing *s)
{
    for (uint32_t k = 0; k < BANK_MAX_MODES; k++) /* bound: BANK_MAX_MODES */
        if (!real_finite(s->amplitude[k]) || !real_finite(s->speed[k]))
            s->amplitude[k] = s->speed[k] = 0.0f;
}
