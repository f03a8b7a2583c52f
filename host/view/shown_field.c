#include "shown_field.h"

#include <string.h>

#include "across.h"
#include "bank.h"

enum { MAX_SHOWN = BANK_MAX_INSTRUMENTS * LINK_MAX_CONTACTS };

struct shown {
    size_t count;
    uint32_t triangle[MAX_SHOWN];
    double weights[2 * MAX_SHOWN], displacement[3 * MAX_SHOWN], force[3 * MAX_SHOWN];
};

static void gather(const struct bank_view *bank, const struct link *link, struct shown *s)
{
    for (size_t c = 0; c < link->contact_count && c < LINK_MAX_CONTACTS; c++) {
        const struct link_contact *contact = &link->contact[c];
        if (contact->triangle >= bank->triangle_count)
            continue;
        s->triangle[s->count] = contact->triangle;
        memcpy(s->weights + 2 * s->count, contact->weights, sizeof contact->weights);
        memcpy(s->displacement + 3 * s->count, contact->displacement_m, sizeof contact->displacement_m);
        s->count++;
    }
}

/* What the modes are ahead of their load. */
static void swing(const struct bank_view *bank, const struct shown *s, const float *amplitude, double *u)
{
    const float *shape = (const float *)(bank->swing + 1);
    for (uint32_t k = 0; k < bank->swing->modes; k++, shape += 3 * (size_t)bank->vertex_count) {
        double ahead = (double)amplitude[k];
        for (size_t c = 0; c < s->count; c++) {
            const uint16_t *vertex = bank->triangles[s->triangle[c]].vertex;
            const double *w = s->weights + 2 * c, weight[3] = {1 - w[0] - w[1], w[0], w[1]};
            for (int i = 0; i < 9; i++)
                ahead -= weight[i / 3] * (double)shape[3 * vertex[i / 3] + i % 3] * s->force[3 * c + (size_t)(i % 3)];
        }
        for (size_t i = 0; i < 3 * (size_t)bank->vertex_count; i++)
            u[i] += (double)shape[i] * ahead;
    }
}

int shown_field(const struct bank_view *bank, const struct link *links, uint32_t count, const float *amplitude,
                double *u, struct failure *why)
{
    struct shown s = {.count = 0};
    for (uint32_t t = 0; t < count && t < BANK_MAX_INSTRUMENTS; t++)
        gather(bank, &links[t], &s);
    int status = field_from_contacts(bank, s.count, s.triangle, s.weights, s.displacement, u, s.force, why);
    if (status < 0)
        memset(u, 0, 3 * sizeof *u * bank->vertex_count);
    else if (bank->swing && amplitude)
        swing(bank, &s, amplitude, u);
    else
        across_apply(bank, s.count, s.displacement, u);
    return status;
}
