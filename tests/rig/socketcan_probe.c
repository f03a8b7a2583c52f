/* socketcan_probe COMMAND: what the rig's tests need of the program's own objects.
 *
 *   bank FILE [2]              a small synthetic bank; for two instruments
 *   record BANK GESTURE LOG    a run on the simulated bus, every frame of it as a candump log
 *   probe IF                   the backend "socketcan:IF" against the kernel; TAP. As root: it takes IF down and up,
 *                              and IF2 (the name with its last digit one higher) it removes and makes again
 *   slcan TTY IF               the backend "slcan:TTY" against slcanpty of can-utils, which joins TTY to IF
 *   squeeze IF                 the same interface behind a queue of six frames that lets 500 frames pass per second: none is lost */
#include <linux/can.h>
#include <linux/can/error.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "backend.h"
#include "bank_fixture.h"
#include "candump.h"
#include "session.h"

static int tests, failures;
static struct failure why;

static void result(bool good, const char *claim)
{
    tests++;
    failures += !good;
    printf("%sok %d - %s\n", good ? "" : "not ", tests, claim);
    if (!good && why.status)
        failure_print(stdout, &why);
    fflush(stdout);
}

static bool command(const char *format, const char *interface)
{
    char text[200];
    snprintf(text, sizeof text, format, interface);
    return system(text) == 0;
}

static struct backend *end(const char *interface, const struct backend_options *options)
{
    char name[40];
    struct backend *b = NULL;
    snprintf(name, sizeof name, "socketcan:%s", interface);
    if (backend_open(name, options, &b, &why)) {
        failure_print(stdout, &why);
        exit(1);
    }
    return b;
}

static struct can_frame_t frame(uint32_t id, uint8_t byte)
{
    return (struct can_frame_t){.id = id, .length = 2, .data = {byte, (uint8_t)~byte}};
}

static bool send(struct backend *b, struct can_frame_t f)
{
    return backend_send(b, &f, 1000000, &why) == 1;
}

static bool hears(struct backend *b, struct can_frame_t f, bool own)
{
    struct backend_received r;
    return backend_receive(b, &r, 1000000, &why) == 1 && memcmp(&r.frame, &f, sizeof f) == 0 && r.own == own;
}

static bool silent(struct backend *b)
{
    struct backend_received r;
    return backend_receive(b, &r, 0, &why) == 0;
}

static void frames(const char *interface)
{
    const struct backend_filter two[] = {{0x200, 0x780}, {0x80000123, 0x1fffffff}};
    struct backend *a = end(interface, NULL), *b = end(interface, &(struct backend_options){.own = true}),
                   *c = end(interface, &(struct backend_options){.filter = two, .filters = 2}),
                   *d = end(interface, &(struct backend_options){.fd = true});
    struct can_frame_t torque = frame(0x201, 1), sync = frame(0x80, 2), extended = frame(0x123, 3),
                       remote = {.id = 0x281, .length = 4, .flags = CAN_FLAG_RTR}, fd = frame(0x202, 4);
    extended.flags = CAN_FLAG_EXTENDED;
    fd.flags = CAN_FLAG_FD;
    fd.length = 64;
    result(send(a, torque) && send(a, sync) && send(a, extended) && send(a, remote), "frames are sent");
    result(hears(b, torque, false) && hears(b, sync, false) && hears(b, extended, false) && hears(b, remote, false),
           "frames arrive whole and in order");
    result(hears(c, torque, false) && hears(c, extended, false) && silent(c), "the kernel filters");
    result(silent(a), "an end does not hear itself unless it asks to");
    result(send(b, sync) && hears(b, sync, true) && hears(a, sync, false) && silent(b), "own frames are told apart");
    result(hears(d, torque, false) && hears(d, sync, false), "an FD end hears classic frames");
    result(send(d, fd) && silent(a), "an FD frame does not reach a classic end");
    result(backend_send(a, &fd, 0, &why) == STATUS_BUS_FRAME, "and is not sent by one");
    struct backend_received r = {.time_us = 0};
    uint64_t before = 0;
    bool forward = true;
    for (int i = 0; i < 100 && forward; i++) {
        forward =
            send(a, frame(0x201, (uint8_t)i)) && backend_receive(c, &r, 1000000, &why) == 1 && r.time_us >= before;
        before = r.time_us;
    }
    result(forward, "the kernel's times do not go back");
    backend_close(a);
    backend_close(b);
    backend_close(c);
    backend_close(d);
}

/* What the driver of a controller would say; the kernel loops back what a program writes with CAN_ERR_FLAG to those
 * whose filter has the class. */
static void errors(const char *interface)
{
    struct backend *b = end(interface, NULL);
    const bool sent = command("cansend %s 20000040#0000000000000000 && true", interface) &&
                      command("cansend %s 20000004#0020000000008000", interface);
    struct backend_received r;
    while (backend_receive(b, &r, 100000, &why) == 1) {
    }
    result(sent && backend_counters(b)->bus_off == 1 && backend_counters(b)->passive == 1 &&
               backend_counters(b)->received == 0,
           "error frames are counted, and given only to those who ask");
    backend_close(b);
}

static void losses(const char *interface)
{
    struct backend *a = end(interface, NULL), *b = end(interface, &(struct backend_options){.receive_bytes = 20000});
    unsigned arrived = 0;
    struct backend_received r;
    for (unsigned i = 0; i < 1000; i++)
        send(a, frame(0x100, (uint8_t)i));
    while (backend_receive(b, &r, 0, &why) == 1)
        arrived++;
    send(a, frame(0x100, 0)); /* the count comes with the next frame */
    arrived += backend_receive(b, &r, 1000000, &why) == 1;
    printf("# %u of 1001 arrived in a buffer that is too small\n", arrived);
    result(arrived < 1001 && backend_counters(b)->dropped == 1001 - arrived,
           "what the buffer could not hold is counted, to the frame");
    backend_close(a);
    backend_close(b);
}

static void down_and_up(const char *interface)
{
    struct backend *a = end(interface, NULL), *b = end(interface, NULL), *late = NULL;
    struct backend_received r;
    char name[40];
    snprintf(name, sizeof name, "socketcan:%s", interface);
    bool good = command("ip link set %s down", interface);
    const struct can_frame_t f = frame(0x201, 7);
    result(good && backend_receive(b, &r, 1000000, &why) == STATUS_BUS_DOWN && backend_state(b) == BACKEND_DOWN,
           "an interface that goes down is reported");
    result(strstr(why.remedy, "ip link set") && strstr(why.remedy, interface), "with the command that takes it up");
    result(backend_receive(b, &r, 0, &why) == 0 && backend_send(a, &f, 0, &why) == STATUS_BUS_DOWN &&
               backend_send(a, &f, 0, &why) == 0,
           "once");
    result(backend_open(name, NULL, &late, &why) == STATUS_BUS_DOWN && !late, "one that is down is not opened");
    result(command("ip link set %s up", interface) && send(a, f) && hears(b, f, false) &&
               backend_state(b) == BACKEND_UP && backend_counters(b)->downs == 1,
           "frames pass again when it is up");
    backend_close(a);
    backend_close(b);
}

static void gone_and_back(const char *interface)
{
    struct backend *b = end(interface, NULL);
    struct backend_received r;
    const struct can_frame_t f = frame(0x201, 8);
    const bool removed = command("ip link del %s", interface);
    int status = backend_receive(b, &r, 1000000, &why);
    while (status == STATUS_BUS_DOWN || (status == 0 && backend_state(b) != BACKEND_GONE))
        status = backend_receive(b, &r, 1000000, &why);
    result(removed && (status == STATUS_BUS_LOST || backend_state(b) == BACKEND_GONE),
           "an interface that is taken away is reported");
    const bool made = command("ip link add %s type vcan", interface) && command("ip link set %s up", interface);
    while (made && backend_state(b) != BACKEND_UP)
        backend_receive(b, &r, 10000, &why);
    struct backend *a = end(interface, NULL);
    result(send(a, f) && hears(b, f, false), "and used again when it is back");
    backend_close(a);
    backend_close(b);
}

static void names(void)
{
    static const struct {
        const char *name;
        int status;
    } cases[] = {{"socketcan:nosuch0", STATUS_BUS_INTERFACE}, {"socketcan:lo", STATUS_BUS_INTERFACE}};
    for (size_t i = 0; i < 2; i++) {
        struct backend *b = NULL;
        result(backend_open(cases[i].name, NULL, &b, &why) == cases[i].status && !b, cases[i].name);
    }
}

/* Two senders, of which each alone could fill the queue. The first meets its own full socket (EAGAIN), the second the
 * interface's full queue (ENOBUFS). */
static void squeeze(const char *interface)
{
    enum { FRAMES = 200 };
    struct backend *a = end(interface, NULL), *b = end(interface, NULL), *c = end(interface, NULL);
    struct backend_received r;
    unsigned sent = 0, heard = 0;
    bool order = true;
    for (unsigned i = 0; i < FRAMES; i++) {
        sent += send(a, frame(0x100, (uint8_t)i));
        sent += send(b, frame(0x101, (uint8_t)i));
    }
    unsigned last[2] = {255, 255};
    while (heard < sent && backend_receive(c, &r, 1000000, &why) == 1) {
        unsigned *from = &last[r.frame.id - 0x100];
        order = order && r.frame.data[0] == ((*from + 1) & 255);
        *from = r.frame.data[0];
        heard++;
    }
    const struct backend_counters *ca = backend_counters(a), *cb = backend_counters(b);
    printf("# %llu and %llu of %d frames had to wait\n", (unsigned long long)ca->waits, (unsigned long long)cb->waits,
           FRAMES);
    result(sent == 2 * FRAMES && heard == sent && order && ca->waits + cb->waits > FRAMES / 4,
           "a full queue is waited for, and no frame is lost or overtaken");
    unsigned refused = 0;
    for (unsigned i = 0; i < 50; i++)
        refused += backend_send(a, &(struct can_frame_t){.id = 0x102}, 0, &why) == 0;
    result(refused > 0 && ca->no_room == refused, "who does not wait is told that there is no room");
    backend_close(a);
    backend_close(b);
    backend_close(c);
}

/* An adapter that somebody else wrote. No remote frames: of these slcanpty takes the length for a command. */
static void slcan(const char *tty, const char *interface)
{
    char name[100];
    struct backend *a = NULL, *b = end(interface, NULL);
    snprintf(name, sizeof name, "slcan:%s", tty);
    result(backend_open(name, NULL, &a, &why) == STATUS_OK, "the channel opens");
    if (!a)
        return;
    struct can_frame_t extended = frame(0x12345678, 3);
    extended.flags = CAN_FLAG_EXTENDED;
    bool out = true, in = true;
    for (unsigned i = 0; i < 200; i++) {
        out = out && send(a, frame(0x201, (uint8_t)i)) && hears(b, frame(0x201, (uint8_t)i), false);
        in = in && send(b, frame(0x181, (uint8_t)i)) && hears(a, frame(0x181, (uint8_t)i), false);
    }
    result(out && send(a, extended) && hears(b, extended, false), "what is sent arrives on the bus");
    result(in && send(b, extended) && hears(a, extended, false), "what is on the bus arrives");
    result(backend_counters(a)->malformed == 0 && backend_counters(a)->refused == 0, "no line is refused by either");
    backend_close(a);
    backend_close(b);
}

static void heard(void *log, const struct can_frame_t *f, uint64_t time_us)
{
    candump_write(log, "soft", f, time_us, &why);
}

static int record(const char *bank_path, const char *gesture, const char *log_path)
{
    static struct bank_file bank;
    struct session *session;
    struct session_result r;
    const struct session_options options = {.gesture = {gesture}};
    FILE *log = fopen(log_path, "w");
    if (!log || bank_load(bank_path, &bank, &why) || session_create(&bank, NULL, &options, &session, &why)) {
        failure_print(stderr, &why);
        return 1;
    }
    bus_listen(session_bus(session), heard, log);
    while (session_tick(session)) {
    }
    const int status = session_finish(session, &r, &why);
    session_free(session);
    bank_unload(&bank);
    fprintf(stderr, "%llu ticks, %llu in contact, %.3f N\n", (unsigned long long)r.ticks,
            (unsigned long long)r.contact_ticks, r.peak_force_N);
    return fclose(log) != 0 || status || why.status;
}

int main(int argc, char **argv)
{
    if ((argc == 3 || argc == 4) && !strcmp(argv[1], "bank")) {
        size_t length;
        struct bank_fixture_options options = bank_fixture_default;
        options.instruments = argc == 4 ? 2 : 1;
        unsigned char *bytes = bank_fixture(&options, &length);
        FILE *file = fopen(argv[2], "wb");
        const bool good = file && fwrite(bytes, 1, length, file) == length;
        free(bytes);
        return file && fclose(file) == 0 && good ? 0 : 1;
    }
    if (argc == 5 && !strcmp(argv[1], "record"))
        return record(argv[2], argv[3], argv[4]);
    if (argc == 4 && !strcmp(argv[1], "slcan")) {
        slcan(argv[2], argv[3]);
        printf("1..%d\n", tests);
        return failures ? 1 : 0;
    }
    if (argc != 3 || (strcmp(argv[1], "probe") && strcmp(argv[1], "squeeze")))
        return 2;
    if (!strcmp(argv[1], "squeeze")) {
        squeeze(argv[2]);
    } else {
        char second[20];
        snprintf(second, sizeof second, "%s", argv[2]);
        second[strlen(second) - 1]++;
        names();
        frames(argv[2]);
        errors(argv[2]);
        losses(argv[2]);
        down_and_up(argv[2]);
        gone_and_back(second);
    }
    printf("1..%d\n", tests);
    return failures ? 1 : 0;
}
