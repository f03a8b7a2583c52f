/* The backend "slcan:TTY" and "slcan:TTY@BAUD". */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "backend_kind.h"
#include "slcan.h"

enum {
    IN_BYTES = 4096,
    OUT_BYTES = 256, /* that the line has not taken yet: about eight frames, so that few stand before an urgent one */
    ANSWER_US = 300000, /* an adapter that has not answered by then is taken for one of those that never do */
    QUIET_US = 30000,   /* nothing for so long: the adapter has said all */
    LOOK_US = 200000    /* how often an adapter that was unplugged is looked for */
};

struct slcan {
    struct backend base;
    int tty;
    speed_t speed; /* B0: the line's own, as USB adapters have it */
    char path[128], digit;
    char in[IN_BYTES]; /* unread from in_first on */
    size_t in_first, in_count;
    char line[SLCAN_LINE]; /* under way */
    size_t line_count;     /* SLCAN_LINE: too long, to be refused at its end */
    char out[OUT_BYTES];
    size_t out_count;
};

/* ---- the line ---- */

static int gone(struct slcan *s, struct failure *why)
{
    const bool was_up = s->base.state == BACKEND_UP;
    s->base.counters.downs += was_up;
    s->base.state = BACKEND_GONE;
    s->in_first = s->in_count = s->line_count = s->out_count = 0;
    if (!was_up)
        return 0;
    return failure_set(why, STATUS_BUS_LOST, s->base.name, "plug the adapter in again", "the adapter has gone away");
}

/* More characters: 1, none wait: 0, else as gone(). */
static int fill(struct slcan *s, struct failure *why)
{
    const ssize_t n = read(s->tty, s->in, sizeof s->in);
    if (n < 0 && (errno == EAGAIN || errno == EINTR))
        return 0;
    if (n <= 0)
        return gone(s, why);
    s->in_first = 0;
    s->in_count = (size_t)n;
    return 1;
}

/* Let the line take what waits. */
static int flush(struct slcan *s, struct failure *why)
{
    while (s->out_count > 0) {
        const ssize_t n = write(s->tty, s->out, s->out_count);
        if (n < 0 && (errno == EAGAIN || errno == EINTR))
            return 0;
        if (n <= 0)
            return gone(s, why);
        s->out_count -= (size_t)n;
        memmove(s->out, s->out + n, s->out_count);
    }
    return 0;
}

/* The next character of the line ends it: what does it say? *bell: it was one. */
static enum slcan_meaning end_line(struct slcan *s, struct can_frame_t *frame)
{
    const size_t n = s->line_count;
    s->line_count = 0;
    return n == SLCAN_LINE ? SLCAN_MALFORMED : slcan_parse(s->line, n, frame);
}

/* Read on to the end of a line: true, and what it means; a bell is *bell. */
static bool next_line(struct slcan *s, enum slcan_meaning *meaning, struct can_frame_t *frame, bool *bell)
{
    *bell = false;
    while (s->in_count > 0) {
        const char c = s->in[s->in_first++];
        s->in_count--;
        if (c == '\r' || c == '\a') {
            *bell = c == '\a';
            *meaning = end_line(s, frame);
            return true;
        }
        if (c == '\n' && s->line_count == 0)
            continue; /* some adapters end a line with both */
        if (s->line_count < SLCAN_LINE)
            s->line[s->line_count++] = c;
    }
    return false;
}

/* ---- opening ---- */

/* Send a command and wait for its answer. 1 taken, or no answer; 0 refused; negative: the line fails. */
static int command(struct slcan *s, const char *text, struct failure *why)
{
    const uint64_t until_us = backend_monotonic_us() + ANSWER_US;
    struct can_frame_t frame;
    enum slcan_meaning meaning;
    bool bell;
    size_t sent = 0;
    const size_t length = strlen(text);
    for (;;) {
        if (sent < length) {
            const ssize_t n = write(s->tty, text + sent, length - sent);
            if (n < 0 && errno != EAGAIN && errno != EINTR)
                return gone(s, why);
            sent += n > 0 ? (size_t)n : 0;
        }
        const int status = fill(s, why);
        if (status < 0)
            return status;
        while (next_line(s, &meaning, &frame, &bell)) {
            if (bell)
                return 0;
            if (sent == length && (meaning == SLCAN_NOTHING || meaning == SLCAN_MALFORMED))
                return 1; /* what is no answer is a frame or command that passed meanwhile */
        }
        if (!backend_poll(s->tty, sent < length ? POLLIN | POLLOUT : POLLIN, until_us) &&
            backend_monotonic_us() >= until_us)
            return 1;
    }
}

/* End a line that was begun, close the channel, and let pass what the adapter says to that: a bell, when it was closed
 * already, or frames that were under way. */
static int quieten(struct slcan *s, struct failure *why)
{
    const uint64_t end_us = backend_monotonic_us() + ANSWER_US;
    if (write(s->tty, "\r\r\rC\r", 5) < 0 && errno != EAGAIN)
        return gone(s, why);
    while (backend_monotonic_us() < end_us && backend_poll(s->tty, POLLIN, backend_until(QUIET_US))) {
        const int status = fill(s, why);
        if (status < 0)
            return status;
        s->in_count = 0;
    }
    return STATUS_OK;
}

static int set_line(struct slcan *s, struct failure *why)
{
    struct termios t;
    if (tcgetattr(s->tty, &t))
        return failure_set(why, STATUS_BUS_INTERFACE, s->base.name,
                           "name the adapter's serial line, such as /dev/ttyUSB0", "%s is not a serial line", s->path);
    cfmakeraw(&t);
    t.c_cflag |= CLOCAL | CREAD;
    t.c_cflag &= ~(tcflag_t)(CRTSCTS | CSTOPB);
    t.c_cc[VMIN] = 1; /* so that a read of nothing says EAGAIN, and 0 only a line that hung up */
    t.c_cc[VTIME] = 0;
    if (s->speed != B0)
        cfsetspeed(&t, s->speed);
    if (tcsetattr(s->tty, TCSANOW, &t) || tcflush(s->tty, TCIFLUSH))
        return failure_set(why, STATUS_BUS_OPEN, s->base.name, NULL, "the serial line does not take its settings: %s",
                           strerror(errno));
    return STATUS_OK;
}

static int open_line(struct slcan *s, struct failure *why)
{
    char rate[] = {'S', s->digit, '\r', 0};
    s->tty = open(s->path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (s->tty < 0 && (errno == EACCES || errno == EPERM))
        return failure_set(why, STATUS_BUS_PERMISSION, s->base.name,
                           "as root: adduser YOUR_NAME dialout; then log in again", "you may not use the serial line");
    if (s->tty < 0)
        return failure_set(why, STATUS_BUS_INTERFACE, s->base.name, "ls /dev/tty* lists those that there are",
                           "there is no serial line %s: %s", s->path, strerror(errno));
    int status = set_line(s, why);
    s->base.state = BACKEND_UP;
    if (!status)
        status = quieten(s, why);
    if (status >= 0 && (status = command(s, rate, why)) == 0)
        return failure_set(why, STATUS_BUS_OPEN, s->base.name, "choose another bit rate",
                           "the adapter refuses the bit rate");
    if (status > 0 && (status = command(s, "O\r", why)) == 0)
        return failure_set(why, STATUS_BUS_OPEN, s->base.name, "look at its cable, or restart it",
                           "the adapter does not open its channel");
    return status < 0 ? status : STATUS_OK;
}

static void close_line(struct backend *b)
{
    struct slcan *s = (struct slcan *)b;
    if (s->tty < 0)
        return;
    if (s->base.state == BACKEND_UP && write(s->tty, "C\r", 2) < 0)
        s->base.state = BACKEND_GONE; /* it has closed the channel by itself */
    close(s->tty);
    s->tty = -1;
}

/* An adapter that was unplugged: look whether it is back. */
static void look(struct slcan *s)
{
    struct failure ignored = {0};
    close_line(&s->base);
    if (open_line(s, &ignored))
        s->base.state = BACKEND_GONE;
}

/* ---- frames ---- */

static int take(struct slcan *s, struct backend_received *received, struct failure *why)
{
    enum slcan_meaning meaning;
    bool bell;
    for (;;) {
        while (next_line(s, &meaning, &received->frame, &bell)) {
            s->base.counters.refused += bell;
            s->base.counters.malformed += meaning == SLCAN_MALFORMED || (bell && meaning == SLCAN_FRAME);
            if (meaning != SLCAN_FRAME || bell || !backend_wanted(&s->base, &received->frame))
                continue;
            received->own = false;
            received->time_us = backend_time(&s->base, backend_wall_us());
            return 1;
        }
        const int status = fill(s, why);
        if (status <= 0)
            return status;
    }
}

static int receive(struct backend *b, struct backend_received *received, int64_t wait_us, struct failure *why)
{
    struct slcan *s = (struct slcan *)b;
    const uint64_t until_us = backend_until(wait_us);
    for (;;) {
        if (s->base.state == BACKEND_UP) {
            int status = take(s, received, why);
            if (status == 0)
                status = flush(s, why);
            if (status != 0)
                return status;
        }
        if (wait_us == 0)
            return 0;
        if (s->base.state != BACKEND_UP) {
            const uint64_t next_us = backend_monotonic_us() + LOOK_US;
            backend_poll(-1, 0, until_us < next_us ? until_us : next_us);
            look(s);
            if (s->base.state != BACKEND_UP && until_us < next_us)
                return 0;
        } else if (!backend_poll(s->tty, s->out_count ? POLLIN | POLLOUT : POLLIN, until_us)) {
            return 0;
        }
    }
}

static int send_frame(struct backend *b, const struct can_frame_t *frame, int64_t wait_us, struct failure *why)
{
    struct slcan *s = (struct slcan *)b;
    char line[SLCAN_LINE];
    const size_t n = slcan_format(frame, line);
    uint64_t until_us = 0;
    for (bool waited = false;; waited = true) {
        if (s->base.state != BACKEND_UP)
            return 0;
        int status = flush(s, why);
        if (status < 0)
            return status;
        if (s->out_count + n <= OUT_BYTES) {
            memcpy(s->out + s->out_count, line, n);
            s->out_count += n;
            status = flush(s, why);
            return status < 0 ? status : 1;
        }
        if (wait_us == 0)
            return 0;
        if (!waited) {
            s->base.counters.waits++;
            until_us = backend_until(wait_us);
        }
        if (!backend_poll(s->tty, POLLOUT, until_us))
            return 0;
    }
}

static int descriptor(const struct backend *b)
{
    return ((const struct slcan *)b)->tty;
}

static speed_t speed_of(const char *text)
{
    static const struct {
        const char *text;
        speed_t speed;
    } speeds[] = {{"9600", B9600},     {"19200", B19200},     {"38400", B38400},     {"57600", B57600},
                  {"115200", B115200}, {"230400", B230400},   {"460800", B460800},   {"500000", B500000},
                  {"921600", B921600}, {"1000000", B1000000}, {"2000000", B2000000}, {"3000000", B3000000}};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++)
        if (!strcmp(text, speeds[i].text))
            return speeds[i].speed;
    return B0;
}

static int parse_name(struct slcan *s, const char *tty, struct failure *why)
{
    const uint32_t bit_rate = s->base.options.bit_rate ? s->base.options.bit_rate : 1000000;
    snprintf(s->path, sizeof s->path, "%s", tty);
    char *at = strrchr(s->path, '@');
    if (at)
        *at++ = '\0';
    s->speed = at ? speed_of(at) : B0;
    if (at && s->speed == B0)
        return failure_set(why, STATUS_BUS_NAME, s->base.name, "9600 to 3000000, such as 115200",
                           "a serial line has no speed \"%.20s\"", at);
    if (slcan_rate(bit_rate) < 0)
        return failure_set(why, STATUS_BUS_OPEN, s->base.name, "10, 20, 50, 100, 125, 250, 500, 800 or 1000 kbit/s",
                           "SLCAN has no bit rate of %u bit/s", (unsigned)bit_rate);
    s->digit = (char)('0' + slcan_rate(bit_rate));
    if (s->base.options.fd)
        return failure_set(why, STATUS_BUS_FRAME, s->base.name, "leave FD out", "SLCAN has no FD frames");
    const char *slash = strrchr(s->path, '/');
    snprintf(s->base.interface, sizeof s->base.interface, "%.15s", slash && slash[1] ? slash + 1 : s->path);
    return STATUS_OK;
}

int slcan_open(const char *tty, const struct backend_options *options, struct backend **backend, struct failure *why)
{
    static const struct backend_kind kind = {receive, send_frame, descriptor, close_line};
    char name[160];
    struct slcan *s = calloc(1, sizeof *s);
    if (!s)
        return failure_set(why, STATUS_MEMORY, NULL, NULL, "no memory for the bus");
    s->tty = -1;
    snprintf(name, sizeof name, "slcan:%s", tty);
    int status = backend_begin(&s->base, &kind, name, "slcan", options, why);
    if (!status)
        status = parse_name(s, tty, why);
    if (!status)
        status = open_line(s, why);
    if (status) {
        backend_close(&s->base);
        return status;
    }
    *backend = &s->base;
    return STATUS_OK;
}
