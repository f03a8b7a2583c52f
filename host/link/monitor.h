/* What passes on a bus, counted: frames and rates by identifier, the load, and what the controllers say of themselves. */
#ifndef TROCAR_MONITOR_H
#define TROCAR_MONITOR_H

#include <json-c/json.h>
#include <stdint.h>
#include <stdio.h>

#include "dbc.h"
#include "link.h"
#include "mirror.h"

enum { MONITOR_IDS = 64, MONITOR_NODES = 4 };

struct monitor_id {
    uint32_t id; /* with bit 31 for 29-bit identifiers */
    uint64_t count, reported, last_us;
    double per_second; /* in the last window */
    struct can_frame_t last;
};

struct monitor {
    const struct dbc *dbc;
    double bit_rate;
    struct mirror *mirror;                /* NULL: no bank at hand */
    uint64_t first_us, now_us, window_us; /* first frame; newest time; where the window begins */
    uint64_t frames, errors, overflow;    /* errors: error frames; overflow: frames of identifiers beyond MONITOR_IDS */
    uint64_t bits, reported_bits, reported_frames, mirror_differed;
    /* of the last window */
    double load, per_second; /* 0..1; frames */
    uint64_t differed;       /* torque frames that the mirror did not have */
    size_t id_count, node_count;
    struct monitor_id id[MONITOR_IDS]; /* in rising order */
    struct link link[MONITOR_NODES];   /* one per node that sends as a controller or device */
};

void monitor_start(struct monitor *monitor, const struct dbc *dbc, double bit_rate, struct mirror *mirror);
void monitor_receive(struct monitor *monitor, const struct can_frame_t *frame, uint64_t time_us);
/* Time goes on without a frame. */
void monitor_idle(struct monitor *monitor, uint64_t time_us);
/* Close the window: rates and load are then those since the last call. False when it is shorter than a millisecond. */
bool monitor_window(struct monitor *monitor);

/* One line per window; a table for a terminal, at most `columns` wide; one JSON object. */
void monitor_line(FILE *out, const struct monitor *monitor);
void monitor_table(FILE *out, const struct monitor *monitor, unsigned columns);
struct json_object *monitor_json(const struct monitor *monitor);

#endif
