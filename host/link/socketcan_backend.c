/* The backend "socketcan:IF". */
#include <errno.h>
#include <net/if.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>

#include "backend_kind.h"
#include "socketcan.h"

enum { DEFAULT_RECEIVE_BYTES = 4 << 20, LOOK_US = 100000 /* how often a missing interface is looked for */ };

struct socketcan {
    struct backend base;
    int socket;
    uint32_t dropped; /* as the kernel counts, modulo 2^32 */
};

static bool interface_up(int descriptor, const char *interface)
{
    struct ifreq request = {0};
    memcpy(request.ifr_name, interface, strlen(interface) + 1);
    return ioctl(descriptor, SIOCGIFFLAGS, &request) == 0 && request.ifr_flags & IFF_UP;
}

static int down(struct socketcan *s, struct failure *why)
{
    char remedy[120];
    snprintf(remedy, sizeof remedy, "as root: ip link set %s up%s", s->base.interface,
             strncmp(s->base.interface, "vcan", 4) ? " type can bitrate 1000000" : "");
    s->base.counters.downs += s->base.state == BACKEND_UP;
    s->base.state = BACKEND_DOWN;
    return failure_set(why, STATUS_BUS_DOWN, s->base.name, remedy, "the interface is down");
}

static int gone(struct socketcan *s, struct failure *why)
{
    s->base.counters.downs += s->base.state == BACKEND_UP;
    s->base.state = BACKEND_GONE;
    return failure_set(why, STATUS_BUS_LOST, s->base.name, "plug the adapter in again", "the interface has gone away");
}

/* ---- opening ---- */

static int no_socket(const char *name, int error, struct failure *why)
{
    if (error == EAFNOSUPPORT || error == EPROTONOSUPPORT)
        return failure_set(why, STATUS_BUS_KERNEL, name, NULL, "this kernel has no SocketCAN");
    if (error == EPERM || error == EACCES)
        return failure_set(why, STATUS_BUS_PERMISSION, name, NULL, "no CAN socket may be opened here");
    return failure_set(why, STATUS_BUS_OPEN, name, NULL, "a CAN socket cannot be opened: %s", strerror(error));
}

static int no_interface(const char *name, const char *interface, struct failure *why)
{
    char remedy[200];
    if (!strncmp(interface, "vcan", 4))
        snprintf(remedy, sizeof remedy, "as root: modprobe vcan; ip link add %s type vcan; ip link set %s up",
                 interface, interface);
    else
        snprintf(remedy, sizeof remedy, "ip -br link lists those that there are");
    return failure_set(why, STATUS_BUS_INTERFACE, name, remedy, "there is no interface %s", interface);
}

/* 0, or the errno. */
static int set_filters(const struct socketcan *s)
{
    struct can_filter kernel[BACKEND_MAX_FILTERS];
    const can_err_mask_t errors = CAN_ERR_MASK;
    const size_t n = s->base.options.filters;
    for (size_t i = 0; i < n; i++) /* with the EFF bit in the mask a filter takes one length of identifiers only */
        kernel[i] = (struct can_filter){s->base.filter[i].id, s->base.filter[i].mask | CAN_EFF_FLAG};
    if (n && setsockopt(s->socket, SOL_CAN_RAW, CAN_RAW_FILTER, kernel, (socklen_t)(n * sizeof kernel[0])))
        return errno;
    return setsockopt(s->socket, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) ? errno : 0;
}

static int set_options(const struct socketcan *s)
{
    const struct backend_options *o = &s->base.options;
    const int on = 1, smallest = 0, bytes = o->receive_bytes ? (int)o->receive_bytes : DEFAULT_RECEIVE_BYTES;
    const int error = set_filters(s);
    if (error)
        return error;
    if (o->own && setsockopt(s->socket, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on))
        return errno;
    if (o->fd && setsockopt(s->socket, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on))
        return errno;
    if (setsockopt(s->socket, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes)) /* past the limit needs privilege */
        setsockopt(s->socket, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    if (setsockopt(s->socket, SOL_SOCKET, SO_SNDBUF, &smallest, sizeof smallest) ||
        setsockopt(s->socket, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) ||
        setsockopt(s->socket, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on))
        return errno;
    return 0;
}

/* Socket, options, filters before bind: no frame is received that nobody wants. */
static int attach(struct socketcan *s, struct failure *why)
{
    const char *name = s->base.name, *interface = s->base.interface;
    s->socket = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (s->socket < 0)
        return no_socket(name, errno, why);
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(interface)};
    if (address.can_ifindex == 0)
        return no_interface(name, interface, why);
    const int error = set_options(s);
    if (error)
        return failure_set(why, STATUS_BUS_OPEN, name, NULL, "the CAN socket does not take its options: %s",
                           strerror(error));
    if (bind(s->socket, (struct sockaddr *)&address, sizeof address)) {
        if (errno == ENODEV)
            return failure_set(why, STATUS_BUS_INTERFACE, name, "ip -br link lists those that there are",
                               "%s is not a CAN interface", interface);
        return failure_set(why, STATUS_BUS_OPEN, name, NULL, "the CAN socket cannot be bound: %s", strerror(errno));
    }
    s->dropped = 0;
    if (!interface_up(s->socket, interface))
        return down(s, why);
    s->base.state = BACKEND_UP;
    return STATUS_OK;
}

/* ---- going away and coming back ---- */

/* While it is down or gone: look once whether it is back. */
static void look(struct socketcan *s)
{
    struct failure ignored = {0};
    if (s->base.state == BACKEND_DOWN && interface_up(s->socket, s->base.interface))
        s->base.state = BACKEND_UP;
    if (s->base.state != BACKEND_GONE || if_nametoindex(s->base.interface) == 0)
        return;
    close(s->socket);
    if (attach(s, &ignored) && s->base.state == BACKEND_UP)
        s->base.state = BACKEND_GONE;
}

/* What an error of the socket means. A signal or nothing to read is none. */
static int lost(struct socketcan *s, int error, struct failure *why)
{
    const bool was_up = s->base.state == BACKEND_UP;
    int status;
    if (error == ENETDOWN)
        status = down(s, why);
    else if (error == ENODEV || error == ENXIO || error == EBADF)
        status = gone(s, why);
    else
        return failure_set(why, STATUS_BUS_OPEN, s->base.name, NULL, "the CAN socket fails: %s", strerror(error));
    return was_up ? status : 0;
}

/* ---- frames ---- */

static uint64_t stamp_us(struct socketcan *s, struct msghdr *message)
{
    uint64_t time_us = 0;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c; c = CMSG_NXTHDR(message, c)) {
        if (c->cmsg_level != SOL_SOCKET)
            continue;
        if (c->cmsg_type == SCM_TIMESTAMPNS) {
            struct timespec t;
            memcpy(&t, CMSG_DATA(c), sizeof t);
            time_us = (uint64_t)t.tv_sec * 1000000 + (uint64_t)t.tv_nsec / 1000;
        } else if (c->cmsg_type == SO_RXQ_OVFL) {
            uint32_t dropped;
            memcpy(&dropped, CMSG_DATA(c), sizeof dropped);
            s->base.counters.dropped += (uint32_t)(dropped - s->dropped);
            s->dropped = dropped;
        }
    }
    return backend_time(&s->base, time_us ? time_us : backend_wall_us());
}

/* One frame that waits: 1 wanted, 0 none waits, 2 one that is not for the caller, or an error as lost() has it. */
static int take(struct socketcan *s, struct backend_received *received, struct failure *why)
{
    unsigned char bytes[SOCKETCAN_FD_BYTES];
    union {
        struct cmsghdr align;
        char room[CMSG_SPACE(sizeof(struct timespec)) + CMSG_SPACE(sizeof(uint32_t))];
    } control;
    struct iovec data = {.iov_base = bytes, .iov_len = sizeof bytes};
    struct msghdr message = {
        .msg_iov = &data, .msg_iovlen = 1, .msg_control = &control, .msg_controllen = sizeof control};
    const ssize_t n = recvmsg(s->socket, &message, MSG_DONTWAIT);
    if (n < 0)
        return errno == EAGAIN || errno == EINTR ? 0 : lost(s, errno, why);
    received->own = message.msg_flags & MSG_CONFIRM;
    received->time_us = stamp_us(s, &message);
    if (!socketcan_unpack(bytes, (size_t)n, &received->frame)) {
        s->base.counters.malformed++;
        return 2;
    }
    if (!(received->frame.flags & CAN_FLAG_ERROR))
        return 1;
    socketcan_count_error(&received->frame, &s->base.counters);
    return s->base.options.errors ? 1 : 2;
}

/* Wait for events of the socket, waking now and then while the interface is away. False: the time is over. */
static bool wait_for(struct socketcan *s, short events, uint64_t until_us)
{
    for (;;) {
        if (s->base.state == BACKEND_UP)
            return backend_poll(s->socket, events, until_us);
        const uint64_t next_us = backend_monotonic_us() + LOOK_US;
        const uint64_t slice_us = until_us < next_us ? until_us : next_us;
        /* a socket whose interface is away answers at once with an error, which is known already: wait without it */
        if (backend_poll(s->base.state == BACKEND_GONE ? -1 : s->socket, events, slice_us))
            return true;
        look(s);
        if (until_us <= next_us && s->base.state != BACKEND_UP)
            return false;
    }
}

static int receive(struct backend *b, struct backend_received *received, int64_t wait_us, struct failure *why)
{
    struct socketcan *s = (struct socketcan *)b;
    int status;
    if (s->base.state != BACKEND_UP)
        look(s);
    do {
        status = s->base.state == BACKEND_GONE ? 0 : take(s, received, why);
    } while (status == 2); /* at most what the buffer holds; then the wait below */
    if (status != 0)
        return status;
    if (wait_us == 0)
        return 0;
    const uint64_t until_us = backend_until(wait_us);
    while (wait_for(s, POLLIN, until_us)) {
        status = take(s, received, why);
        if (status != 2 && status != 0)
            return status;
    }
    return 0;
}

static int send_frame(struct backend *b, const struct can_frame_t *frame, int64_t wait_us, struct failure *why)
{
    struct socketcan *s = (struct socketcan *)b;
    unsigned char bytes[SOCKETCAN_FD_BYTES];
    const size_t n = socketcan_pack(frame, bytes);
    uint64_t until_us = 0;
    for (bool waited = false;; waited = true) {
        if (s->base.state != BACKEND_UP)
            look(s);
        if (s->base.state == BACKEND_GONE)
            return 0;
        if (send(s->socket, bytes, n, MSG_DONTWAIT) == (ssize_t)n)
            return 1;
        const int error = errno;
        if (error == EINVAL && n == SOCKETCAN_FD_BYTES)
            return failure_set(why, STATUS_BUS_FRAME, s->base.name, "as root: ip link set IF mtu 72, where it has FD",
                               "the interface takes no FD frames");
        if (error != EAGAIN && error != ENOBUFS && error != EINTR)
            return lost(s, error, why);
        if (wait_us == 0)
            return 0;
        if (!waited) {
            s->base.counters.waits++;
            until_us = backend_until(wait_us);
        }
        /* After ENOBUFS poll answers at once when it was others who filled the interface's queue: then this turns until
         * one of their frames has gone. */
        if (!backend_poll(s->socket, POLLOUT, until_us) || backend_monotonic_us() >= until_us)
            return 0;
    }
}

static int descriptor(const struct backend *b)
{
    return ((const struct socketcan *)b)->socket;
}

static void close_socket(struct backend *b)
{
    struct socketcan *s = (struct socketcan *)b;
    if (s->socket >= 0)
        close(s->socket);
}

int socketcan_open(const char *interface, const struct backend_options *options, struct backend **backend,
                   struct failure *why)
{
    static const struct backend_kind kind = {receive, send_frame, descriptor, close_socket};
    char name[200];
    if (strlen(interface) >= IFNAMSIZ)
        return failure_set(why, STATUS_BUS_INTERFACE, NULL, "ip -br link lists those that there are",
                           "there is no interface %.60s: no name is so long", interface);
    struct socketcan *s = calloc(1, sizeof *s);
    if (!s)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the bus");
    s->socket = -1;
    snprintf(name, sizeof name, "socketcan:%s", interface);
    int status = backend_begin(&s->base, &kind, name, interface, options, why);
    if (!status)
        status = attach(s, why);
    if (status) {
        backend_close(&s->base);
        return status;
    }
    *backend = &s->base;
    return STATUS_OK;
}
