/* The native port, a process of its own on two pipes, answers a recording with the same torque frames, bit for bit, as
 * the same objects inside this test; and refuses a damaged bank by frame and exit code. */
#include <fcntl.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "ports/lockstep.h"
#include "random.h"
#include "tick_bench.h"

static const char *const program = "build/firmware/native/controller.elf";

struct process {
    pid_t id;
    int to, from;
};

static void start(struct process *p, const char *bank)
{
    int down[2], up[2];
    assert_int_equal(pipe(down), 0);
    assert_int_equal(pipe(up), 0);
    p->id = fork();
    if (p->id == 0) {
        dup2(down[0], 0);
        dup2(up[1], 1);
        close(down[1]);
        close(up[0]);
        int quiet = open("/dev/null", O_WRONLY);
        dup2(quiet, 2);
        execl(program, program, bank, (char *)NULL);
        _exit(127);
    }
    close(down[0]);
    close(up[1]);
    p->to = down[1];
    p->from = up[0];
}

static bool get(struct process *p, struct lockstep_record *r)
{
    size_t have = 0;
    while (have < sizeof *r) {
        ssize_t n = read(p->from, (char *)r + have, sizeof *r - have);
        if (n <= 0)
            return false;
        have += (size_t)n;
    }
    return true;
}

static void put(struct process *p, const struct lockstep_record *r)
{
    assert_int_equal(write(p->to, r, sizeof *r), sizeof *r);
}

static int finish(struct process *p)
{
    int status;
    close(p->to);
    close(p->from);
    assert_int_equal(waitpid(p->id, &status, 0), p->id);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void write_bank(char *path, const unsigned char *bytes, size_t length)
{
    int file = mkstemp(path);
    assert_true(file >= 0);
    assert_int_equal(write(file, bytes, length), length);
    close(file);
}

static void torque_frames_equal_those_of_the_same_objects_here(void **state)
{
    (void)state;
    struct bench b;
    bench_open(&b, NULL);
    char path[] = "/tmp/trocar-port-XXXXXX";
    write_bank(path, b.bytes, b.bank.header->total_bytes);
    struct process p;
    start(&p, path);
    random_seed("recording", 30);

    struct lockstep_record r;
    struct can_frame_t torque = {.id = 0};
    uint64_t time_us = 0;
    unsigned ticks = 0, compared = 0, pushing = 0;
    double depth = 0.1;
    uint8_t sequence = 0;
    while (ticks < 5000) {
        assert_true(get(&p, &r));
        if (r.kind == LOCKSTEP_FRAME && r.id == WIRE_TORQUES_ID + 1) { /* of the tick that began with the last SYNC */
            struct can_frame_t mine;
            node_finish_tick(&b.node);
            while (node_transmit(&b.node, &mine))
                if (mine.id == r.id)
                    torque = mine;
            assert_memory_equal(torque.data, r.u.data, 8);
            compared++;
            pushing += b.node.controller.contact.count > 0;
        }
        if (r.kind == LOCKSTEP_FRAME && r.id == WIRE_SYNC_ID) {
            struct can_frame_t drop;
            node_begin_tick(&b.node);
            while (node_transmit(&b.node, &drop)) {
            }
            ticks++;
        }
        if (r.kind != LOCKSTEP_TIME)
            continue;
        time_us = r.u.time_us;
        if (time_us % 1000 == 500 && !b.node.instrument[0].answered &&
            random_below(50)) { /* the device answers, but for 2 % */
            if (ticks > 100)
                depth = 0.112 + 0.012 * sin(ticks / 150.0);
            struct wire_encoders m = bench_counts(&b, 0.05 * sin(ticks / 300.0), 0.02, depth);
            m.sequence = sequence++ & 15;
            struct can_frame_t f = bench_frame(WIRE_ENCODERS_ID + 1, 8);
            wire_encoders_pack(f.data, &m);
            node_receive(&b.node, &f);
            struct lockstep_record s = {.id = f.id, .length = f.length};
            memcpy(s.u.data, f.data, 8);
            put(&p, &s);
            time_us -= 300;
        }
        if (ticks % 100 == 50 && time_us % 1000 == 0) { /* the host goes on whenever it may */
            struct can_frame_t f = bench_frame(WIRE_NMT_ID, 2);
            struct wire_nmt m = {.command = 1, .node = 0};
            wire_nmt_pack(f.data, &m);
            node_receive(&b.node, &f);
            struct lockstep_record s = {.id = f.id, .length = f.length};
            memcpy(s.u.data, f.data, 8);
            put(&p, &s);
        }
        put(&p, &(struct lockstep_record){.kind = LOCKSTEP_TIME, .u.time_us = time_us});
    }
    printf("# %u torque frames compared, %u in contact\n", compared, pushing);
    assert_true(compared > 4900 && pushing > 1000);
    assert_int_equal(finish(&p), 0);
    unlink(path);
    bench_close(&b);
}

static void a_damaged_bank_is_refused_by_frame_and_exit_code(void **state)
{
    (void)state;
    size_t length;
    unsigned char *bytes = bank_fixture(NULL, &length);
    bytes[length / 2] ^= 1;
    char path[] = "/tmp/trocar-port-XXXXXX";
    write_bank(path, bytes, length);
    struct process p;
    struct lockstep_record r;
    struct wire_emergency m;
    start(&p, path);
    assert_true(get(&p, &r));
    assert_int_equal(r.id, WIRE_EMERGENCY_ID + 1);
    assert_true(wire_emergency_unpack(&m, r.u.data, r.length));
    assert_int_equal(m.error_code, 0x6300);
    assert_int_equal(m.reason, STATUS_BANK_CRC);
    assert_int_equal(finish(&p), 6);
    unlink(path);
    free(bytes);
}

int main(void)
{
    cmocka_set_message_output(CM_OUTPUT_TAP);
    signal(SIGPIPE, SIG_IGN);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(torque_frames_equal_those_of_the_same_objects_here),
        cmocka_unit_test(a_damaged_bank_is_refused_by_frame_and_exit_code),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
