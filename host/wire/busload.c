#include "busload.h"

#include <math.h>
#include <string.h>

#include "framebits.h"
#include "telemetry.h"

enum { HOST_HEARTBEAT_TICKS = 100 }; /* host/run/session.c */

/* Frames of contacts per tick, of an instrument with `points` that may all push. */
static double contact_frames(const struct telemetry_pace *pace, unsigned points)
{
    const double frames = 2.0 * (points ? points : 1);
    return frames / fmax(frames * pace->contact, pace->set);
}

/* Frames per tick of one instrument, or of all for what is sent once; negative: not known. */
static double frames_per_tick(const char *name, const struct busload_use *use)
{
    const struct telemetry_pace *pace = &telemetry_paces[use->instruments > 1];
    double contacts = 0;
    for (unsigned i = 0; i < use->instruments; i++)
        contacts += contact_frames(pace, use->points[i]);
    const struct {
        const char *name;
        double frames;
    } known[] = {
        {"Nmt", 0},
        {"Emergency", 0},
        {"Sync", 1},
        {"Encoders", use->instruments},
        {"Torques", use->instruments},
        {"Contact", contacts},
        {"ForcePose", 2.0 * use->instruments / pace->pose},
        {"Health", 1.0 * use->instruments / pace->health},
        {"Heartbeat", 1.0 * use->instruments / pace->heartbeat},
        {"HostHeartbeat", 1.0 / HOST_HEARTBEAT_TICKS},
    };
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (!strcmp(known[i].name, name))
            return known[i].frames;
    return -1;
}

static double tick_bits(const struct busload *load, const char *name)
{
    for (size_t i = 0; i < load->count; i++)
        if (!strcmp(load->row[i].message->name, name))
            return load->row[i].bits;
    return 0;
}

int busload(const struct dbc *dbc, const struct busload_use *use, struct busload *load, struct failure *why)
{
    *load = (struct busload){.count = dbc->message_count};
    for (size_t i = 0; i < dbc->message_count; i++) {
        const struct dbc_message *m = &dbc->message[i];
        struct busload_row *row = &load->row[i];
        const double frames = frames_per_tick(m->name, use);
        if (frames < 0)
            return failure_at(why, STATUS_BUS_DBC, "wire.dbc", m->line,
                              "say in host/wire/busload.c how often it is sent",
                              "the rate of the frame %s is not known", m->name);
        row->message = m;
        row->per_second = frames * TICK_RATE_HZ;
        row->bits = framebits_worst(m->length, false);
        row->fd_bits = framebits_fd_worst(m->length);
        row->share = row->per_second * row->bits / use->bit_rate;
        row->fd_share = 1e-6 * row->per_second * framebits_fd_us(row->fd_bits, use->bit_rate, use->data_rate);
        load->share += row->share;
        load->fd_share += row->fd_share;
    }
    const double bits = tick_bits(load, "Sync") + 2 * tick_bits(load, "ForcePose") +
                        use->instruments * (tick_bits(load, "Encoders") + tick_bits(load, "Torques"));
    load->worst_tick_us = 1e6 * bits / use->bit_rate;
    return STATUS_OK;
}
