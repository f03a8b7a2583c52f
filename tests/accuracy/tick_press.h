/* A tool driven into a body by the controller's tick, along any line, and what a neo-Hookean body answers to the very contacts that
 * it made. The instrument of a bank is moved to the line: the trocar behind the site, the shaft along it. */
#ifndef TROCAR_TICK_PRESS_H
#define TROCAR_TICK_PRESS_H

#include <unistd.h>

#include "across.h"
#include "bank.h"
#include "nonlinear.h"
#include "specimen.h"
#include "tick.h"

struct tick_press {
    struct bank_file bank;
    struct body body;
    struct nonlinear *nonlinear;
    struct controller controller;
    struct tick_input in[TICK_INSTRUMENTS];
    void *rows;
    size_t row_bytes;
    double stand_m; /* the tip meets the site at this insertion */
    double depth_m; /* of the device beyond it, as the encoder of the last sample says */
    double *u;      /* of the neo-Hookean body, at the last answer */
};

/* A bank without compression, built from the text of a scene. */
static inline void tick_press_open(struct tick_press *p, const char *scene_text)
{
    struct failure why;
    struct build_result result;
    char path[] = "/tmp/trocar-press-XXXXXX";
    int file = mkstemp(path);
    struct scene *scene = room(sizeof *scene);
    memset(p, 0, sizeof *p);
    assert_true(file >= 0);
    close(file);
    must(scene_parse(scene_text, strlen(scene_text), "", scene, &why), &why);
    must(bank_build(scene, path, &(struct compression){.plain = true}, INFINITY, true, &result, &why), &why);
    must(bank_load(path, &p->bank, &why), &why);
    unlink(path);
    must(body_from_scene(scene, &p->body, NULL, &why), &why);
    free(scene);
    if (nonlinear_create(p->body.model, &p->nonlinear, &why) == STATUS_OK)
        p->u = room(model_unknowns(p->body.model) * sizeof *p->u);
    p->row_bytes = row_cache_memory(&p->bank.view);
    p->rows = room(p->row_bytes);
}

static inline void tick_press_close(struct tick_press *p)
{
    nonlinear_free(p->nonlinear);
    body_close(&p->body);
    bank_unload(&p->bank);
    free(p->rows);
    free(p->u);
}

static inline struct bank_tool *tick_press_tool(struct tick_press *p)
{
    return (struct bank_tool *)p->bank.view.tools; /* in the bytes that the bench owns */
}

static inline void tick_press_sample(struct tick_press *p, double depth_m)
{
    struct tick_output out[TICK_INSTRUMENTS];
    const struct bank_axis *axis = &tick_press_tool(p)->axis[2];
    p->in[0].fresh = true;
    p->in[0].sequence = (p->in[0].sequence + 1) & 15;
    for (int k = 0; k < 2; k++)
        p->in[0].counts[k] = tick_press_tool(p)->axis[k].count_zero;
    double counts = axis->count_zero + (p->stand_m + depth_m - (double)axis->zero) / (double)axis->per_count;
    p->in[0].counts[2] = (uint16_t)lround(counts);
    p->depth_m =
        (double)axis->zero + ((double)p->in[0].counts[2] - axis->count_zero) * (double)axis->per_count - p->stand_m;
    tick(&p->controller, &p->bank.view, p->in, out);
}

/* Stand before the site, 20 mm off, with no contact. */
static inline void tick_press_begin(struct tick_press *p, const double site_m[3], const double direction[3])
{
    struct bank_tool *tool = tick_press_tool(p);
    int least = fabs(direction[0]) < fabs(direction[1]) ? (fabs(direction[0]) < fabs(direction[2]) ? 0 : 2)
                                                        : (fabs(direction[1]) < fabs(direction[2]) ? 1 : 2);
    double x[3], size = 0;
    for (int a = 0; a < 3; a++) {
        x[a] = (a == least) - direction[least] * direction[a];
        size += x[a] * x[a];
    }
    p->stand_m = ((double)tool->axis[2].minimum + (double)tool->axis[2].maximum) / 2;
    for (int a = 0; a < 3; a++) {
        double y = direction[(a + 1) % 3] * x[(a + 2) % 3] - direction[(a + 2) % 3] * x[(a + 1) % 3];
        tool->rotation[3 * a] = (float)(x[a] / sqrt(size));
        tool->rotation[3 * a + 1] = (float)(y / sqrt(size));
        tool->rotation[3 * a + 2] = (float)direction[a];
        tool->trocar_m[a] = (float)(site_m[a] - p->stand_m * direction[a]);
    }
    assert_int_equal(controller_start(&p->controller, &p->bank.view, p->rows, p->row_bytes), STATUS_OK);
    memset(p->in, 0, sizeof p->in);
    for (int k = 0; k < SAFETY_READY_SAMPLES + 5; k++)
        tick_press_sample(p, -0.02);
}

/* To this depth of the device, at 50 mm/s, and 20 ms of rest; the contacts are in controller.contact. */
static inline const struct contact_set *tick_press_to(struct tick_press *p, double from_m, double depth_m)
{
    double step = depth_m < from_m ? -5e-5 : 5e-5;
    for (double at = from_m; fabs(at - depth_m) > 5e-5; at += step)
        tick_press_sample(p, at);
    for (int k = 0; k < 20; k++)
        tick_press_sample(p, depth_m);
    return &p->controller.contact;
}

/* The neo-Hookean body's force on the tool under the contacts of the set that push, at the place of the proxy. False: no
 * equilibrium, or one of them would pull. u goes on from the last answer when `same`: contacts that were there before. */
static inline bool tick_press_truth(struct tick_press *p, const struct contact_set *set, const float force_N[3],
                                    double truth_N[3])
{
    struct failure why;
    struct nonlinear_report report;
    size_t start[CONTACT_MAX + 1] = {0}, count = 0;
    uint32_t vertex[3 * CONTACT_MAX];
    double weight[3 * CONTACT_MAX], direction[3 * CONTACT_MAX], d[CONTACT_MAX], q[CONTACT_MAX] = {0}, pad = 0;
    const double k = (double)p->bank.view.contact->coupling_stiffness_N_m;
    for (uint32_t c = 0; c < set->count; c++) {
        const struct contact *at = &set->contact[c];
        if (!(at->pressure_N > 0))
            continue;
        d[count] = (double)at->depth_m;
        for (int a = 0; a < 3; a++) {
            vertex[3 * count + (size_t)a] = p->bank.view.triangles[at->triangle].vertex[a];
            weight[3 * count + (size_t)a] = (double)at->weights[a];
            direction[3 * count + (size_t)a] = -(double)at->normal[a];
            d[count] -= (double)at->normal[a] * (double)force_N[a] / k;
        }
        pad += (double)at->pad_m_N;
        count++;
        start[count] = 3 * count;
    }
    memset(truth_N, 0, 3 * sizeof *truth_N);
    memset(p->u, 0, model_unknowns(p->body.model) * sizeof *p->u);
    if (count == 0)
        return true;
    const struct nonlinear_rows rows = {count, start, vertex, weight, direction};
    if (nonlinear_press(p->nonlinear, &rows, pad / (double)count, d, p->u, q, &report, &why))
        return false;
    bool pushes = true;
    for (size_t r = 0; r < count; r++) {
        pushes = pushes && q[r] >= 0;
        for (size_t a = 0; a < 3; a++)
            truth_N[a] -= q[r] * direction[3 * r + a];
    }
    return pushes;
}

/* Growth of the radius of a body around the z axis at a height, in parts of it, in the field that the page would show. */
static inline double tick_press_bulge(const struct tick_press *p, const struct contact_set *set, double height_m,
                                      bool curved)
{
    struct failure why;
    const struct bank_view *bank = &p->bank.view;
    uint32_t triangle[CONTACT_MAX];
    double weights[2 * CONTACT_MAX], displacement[3 * CONTACT_MAX], sum = 0;
    double *u = room(3 * bank->vertex_count * sizeof *u);
    size_t count = 0;
    for (uint32_t c = 0; c < set->count; c++) {
        triangle[c] = set->contact[c].triangle;
        for (int k = 0; k < 2; k++)
            weights[2 * c + (uint32_t)k] = (double)set->contact[c].weights[k + 1];
        for (uint32_t a = 0; a < 3; a++)
            displacement[3 * c + a] = (double)set->contact[c].displacement_m[a];
    }
    assert_true(field_from_contacts(bank, set->count, triangle, weights, displacement, u, NULL, &why) >= 0);
    if (curved)
        across_apply(bank, set->count, displacement, u);
    for (uint32_t v = 0; v < bank->vertex_count; v++) {
        double x = (double)bank->positions[3 * v], y = (double)bank->positions[3 * v + 1], r = sqrt(x * x + y * y);
        if (fabs((double)bank->positions[3 * v + 2] - height_m) > 1e-6)
            continue;
        sum += (u[3 * v] * x + u[3 * v + 1] * y) / (r * r);
        count++;
    }
    free(u);
    return sum / (double)count;
}

#endif
