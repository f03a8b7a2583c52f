/* A bench for the controller without a bus: the fixture's sphere under one instrument, samples made from joint angles. */
#ifndef TROCAR_TICK_BENCH_H
#define TROCAR_TICK_BENCH_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bank_fixture.h"
#include "node.h"
#include "wire.h"

struct bench {
    unsigned char *bytes;
    void *rows;
    struct bank_view bank;
    struct node node;
    struct can_frame_t boot; /* what the node sent first */
    uint8_t sequence;
    struct wire_torques torques; /* of the last tick */
    unsigned frames;             /* that the node sent in the last tick */
};

static inline void bench_open(struct bench *b, const struct bank_fixture_options *options)
{
    size_t length;
    memset(b, 0, sizeof *b);
    b->bytes = bank_fixture(options, &length);
    if (bank_view_open(&b->bank, b->bytes, length) != STATUS_OK)
        abort();
    size_t rows = row_cache_memory(&b->bank);
    b->rows = rows ? malloc(rows) : NULL;
    if (node_start(&b->node, &b->bank, 1, b->rows, rows) != STATUS_OK)
        abort();
    node_transmit(&b->node, &b->boot);
}

static inline void bench_close(struct bench *b)
{
    free(b->bytes);
    free(b->rows);
}

/* Counts for joint angles and insertion. */
static inline struct wire_encoders bench_counts(const struct bench *b, double alpha, double beta, double insertion_m)
{
    const struct bank_axis *axis = b->bank.tools[0].axis;
    double q[3] = {alpha, beta, insertion_m};
    uint16_t c[3];
    for (int i = 0; i < 3; i++)
        c[i] = (uint16_t)(axis[i].count_zero + lround((q[i] - axis[i].zero) / axis[i].per_count));
    return (struct wire_encoders){.alpha = c[0], .beta = c[1], .insertion = c[2]};
}

static inline struct can_frame_t bench_frame(uint32_t id, uint8_t length)
{
    return (struct can_frame_t){.id = id, .length = length};
}

static inline void bench_send_sample(struct bench *b, struct wire_encoders sample)
{
    struct can_frame_t frame = bench_frame(WIRE_ENCODERS_ID + 1, WIRE_ENCODERS_LENGTH);
    sample.sequence = b->sequence++ & 15;
    wire_encoders_pack(frame.data, &sample);
    node_receive(&b->node, &frame);
}

static inline void bench_command(struct bench *b, uint8_t command)
{
    struct can_frame_t frame = bench_frame(WIRE_NMT_ID, WIRE_NMT_LENGTH);
    struct wire_nmt m = {.command = command, .node = 1};
    wire_nmt_pack(frame.data, &m);
    node_receive(&b->node, &frame);
}

static inline void bench_finish(struct bench *b)
{
    struct can_frame_t frame;
    node_finish_tick(&b->node);
    b->frames = 0;
    while (node_transmit(&b->node, &frame)) {
        b->frames++;
        if (frame.id == WIRE_TORQUES_ID + 1)
            wire_torques_unpack(&b->torques, frame.data, frame.length);
    }
}

/* One whole tick with a sample. */
static inline void bench_tick(struct bench *b, double alpha, double beta, double insertion_m)
{
    struct can_frame_t frame;
    node_begin_tick(&b->node);
    while (node_transmit(&b->node, &frame)) {
    }
    bench_send_sample(b, bench_counts(b, alpha, beta, insertion_m));
    bench_finish(b);
}

/* One tick without a sample. */
static inline void bench_silent_tick(struct bench *b)
{
    struct can_frame_t frame;
    node_begin_tick(&b->node);
    while (node_transmit(&b->node, &frame)) {
    }
    bench_finish(b);
}

/* Rest at this pose until RUN. */
static inline void bench_start(struct bench *b, double alpha, double beta, double insertion_m)
{
    for (int i = 0; i < SAFETY_READY_SAMPLES + 5; i++)
        bench_tick(b, alpha, beta, insertion_m);
    bench_command(b, 1);
    for (int i = 0; i < 150; i++)
        bench_tick(b, alpha, beta, insertion_m);
}

#endif
