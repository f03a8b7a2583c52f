/* What a kind of backend implements. Only the backends' own files include this; backend.h is for everybody. */
#ifndef TROCAR_BACKEND_KIND_H
#define TROCAR_BACKEND_KIND_H

#include "backend.h"

struct backend_kind {
    int (*receive)(struct backend *backend, struct backend_received *received, int64_t wait_us, struct failure *why);
    int (*send)(struct backend *backend, const struct can_frame_t *frame, int64_t wait_us, struct failure *why);
    int (*descriptor)(const struct backend *backend);
    void (*close)(struct backend *backend); /* all but freeing the backend itself */
};

/* The first member of every kind's own struct, which backend_close frees. */
struct backend {
    const struct backend_kind *kind;
    struct backend_options options; /* `filter` points to the copy below */
    struct backend_filter filter[BACKEND_MAX_FILTERS];
    struct backend_counters counters;
    enum backend_state state;
    char name[128], interface[16];
    uint64_t newest_us; /* no time before this is handed out */
};

/* Fill the common part. STATUS_USAGE for too many filters or a name that is too long. */
int backend_begin(struct backend *backend, const struct backend_kind *kind, const char *name, const char *interface,
                  const struct backend_options *options, struct failure *why);

/* Is the frame one that the options ask for? For kinds whose kernel does not filter. */
bool backend_wanted(const struct backend *backend, const struct can_frame_t *frame);

/* The time, or the newest so far when that is later. */
uint64_t backend_time(struct backend *backend, uint64_t time_us);

/* us since 1970; us of the monotonic clock. */
uint64_t backend_wall_us(void);
uint64_t backend_monotonic_us(void);

/* Wait until a descriptor has one of `events` or `until_us` (of the monotonic clock, UINT64_MAX: for ever) has come; true when
 * it has. False too when a signal came. */
bool backend_poll(int descriptor, short events, uint64_t until_us);
/* wait_us from now, as backend_poll takes it. */
uint64_t backend_until(int64_t wait_us);

int socketcan_open(const char *interface, const struct backend_options *options, struct backend **backend,
                   struct failure *why);
int slcan_open(const char *tty, const struct backend_options *options, struct backend **backend, struct failure *why);

#endif
