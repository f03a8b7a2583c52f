/* A plugin of QEMU that counts the instructions of each tick.
 *
 *   -plugin FILE.so,begin=ADDRESS,end=ADDRESS,ticks=OUT[,profile=OUT[,first=N][,last=N]]
 *
 * A tick is from the arrival at `begin` to the next arrival at `end`: entries of functions. `ticks` gets one line per tick:
 * its instructions, on the processor that arrived. `profile` gets, for each block of translated code that ran in ticks first .. last (counted from 0), its
 * address and the instructions executed in it. Skipped instructions of an IT block count. No interrupts, no devices: the
 * counts of two runs are the same.
 *
 * What it uses of QEMU's plugin interface, version 1 (docs/devel/tcg-plugins.rst of QEMU 4.2 and later), is declared
 * here: Debian ships the header only with QEMU's sources. QEMU refuses a plugin whose version it does not know. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PLUGIN_INTERFACE 1
#define EXPORT           __attribute__((visibility("default")))

struct qemu_info_t;
struct qemu_plugin_tb; /* a block of translated code */
enum qemu_plugin_cb_flags { QEMU_PLUGIN_CB_NO_REGS };

size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *block);
uint64_t qemu_plugin_tb_vaddr(const struct qemu_plugin_tb *block);
void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t plugin, void (*translated)(uint64_t, struct qemu_plugin_tb *));
void qemu_plugin_register_vcpu_tb_exec_cb(struct qemu_plugin_tb *block, void (*executed)(unsigned, void *),
                                          enum qemu_plugin_cb_flags flags, void *context);
void qemu_plugin_register_atexit_cb(uint64_t plugin, void (*ending)(uint64_t, void *), void *context);

extern EXPORT int qemu_plugin_version;
int qemu_plugin_version = PLUGIN_INTERFACE;
EXPORT int qemu_plugin_install(uint64_t plugin, const struct qemu_info_t *info, int argc, char **argv);

struct block {
    struct block *next;
    uint64_t address, instructions, inside; /* inside: executed within the ticks that are profiled */
};

static struct block *blocks;
static uint64_t begin_address, end_address, first_tick, last_tick = UINT64_MAX;
static uint64_t executed, started_at, tick;
static int inside;
static unsigned runner; /* the processor whose tick it is */
static FILE *ticks;
static const char *profile_path;

static void on_execution(unsigned processor, void *context)
{
    struct block *b = context;
    if (inside && processor != runner) /* another one got its turn */
        return;
    if (inside && b->address == end_address) {
        fprintf(ticks, "%llu\n", (unsigned long long)(executed - started_at));
        inside = 0;
        tick++;
    } else if (!inside && b->address == begin_address) {
        started_at = executed;
        runner = processor;
        inside = 1;
    }
    executed += b->instructions;
    if (inside && tick >= first_tick && tick <= last_tick)
        b->inside += b->instructions;
}

static void on_translation(uint64_t plugin, struct qemu_plugin_tb *translated)
{
    (void)plugin;
    struct block *b = calloc(1, sizeof *b);
    if (!b)
        abort();
    b->address = qemu_plugin_tb_vaddr(translated);
    b->instructions = qemu_plugin_tb_n_insns(translated);
    b->next = blocks;
    blocks = b;
    qemu_plugin_register_vcpu_tb_exec_cb(translated, on_execution, QEMU_PLUGIN_CB_NO_REGS, b);
}

static void on_end(uint64_t plugin, void *context)
{
    (void)plugin;
    (void)context;
    int bad = fclose(ticks);
    FILE *profile = profile_path ? fopen(profile_path, "w") : NULL;
    for (const struct block *b = blocks; profile && b; b = b->next)
        if (b->inside)
            fprintf(profile, "%llx,%llu\n", (unsigned long long)b->address, (unsigned long long)b->inside);
    if (profile_path)
        bad |= !profile || fclose(profile);
    if (bad)
        fputs("ticks plugin: the counts cannot be written\n", stderr);
}

static const char *value(const char *argument, const char *key)
{
    size_t length = strlen(key);
    return strncmp(argument, key, length) == 0 && argument[length] == '=' ? argument + length + 1 : NULL;
}

int qemu_plugin_install(uint64_t plugin, const struct qemu_info_t *info, int argc, char **argv)
{
    (void)info;
    const char *ticks_path = NULL, *v;
    for (int i = 0; i < argc; i++)
        if ((v = value(argv[i], "begin")))
            begin_address = strtoull(v, NULL, 0);
        else if ((v = value(argv[i], "end")))
            end_address = strtoull(v, NULL, 0);
        else if ((v = value(argv[i], "first")))
            first_tick = strtoull(v, NULL, 0);
        else if ((v = value(argv[i], "last")))
            last_tick = strtoull(v, NULL, 0);
        else if ((v = value(argv[i], "ticks")))
            ticks_path = v;
        else if ((v = value(argv[i], "profile")))
            profile_path = v;
        else
            return -1;
    ticks = ticks_path ? fopen(ticks_path, "w") : NULL;
    if (!ticks)
        return -1;
    qemu_plugin_register_vcpu_tb_trans_cb(plugin, on_translation);
    qemu_plugin_register_atexit_cb(plugin, on_end, NULL);
    return 0;
}
