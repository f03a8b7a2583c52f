#include "native.h"

#include <errno.h>
#include <sched.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

enum { PRIORITY = 80 }; /* above the kernel's interrupt threads (50), below its watchdogs (99) */

static bool fifo, locked;

uint64_t realtime_now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

int64_t realtime_sleep(uint64_t until_ns)
{
    const struct timespec t = {.tv_sec = (time_t)(until_ns / 1000000000u), .tv_nsec = (long)(until_ns % 1000000000u)};
    if (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) != 0)
        return -1;
    const uint64_t now_ns = realtime_now_ns();
    return now_ns > until_ns ? (int64_t)(now_ns - until_ns) : 0;
}

void realtime_enter(void)
{
    const struct sched_param parameter = {.sched_priority = PRIORITY};
    fifo = sched_setscheduler(0, SCHED_FIFO, &parameter) == 0;
    const int no_fifo = errno;
    locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    const int no_lock = errno;
    prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL); /* for what is not SCHED_FIFO; else the kernel adds up to 50 us */
    if (!fifo || !locked)
        fprintf(stderr,
                "controller: not in real time: %s%s%s; run it as root, or give it the right once: "
                "setcap cap_sys_nice,cap_ipc_lock+ep controller.elf\n",
                fifo     ? "memory cannot be locked"
                : locked ? "SCHED_FIFO is not allowed"
                         : "SCHED_FIFO is not allowed and memory cannot be locked",
                ": ", strerror(fifo ? no_lock : no_fifo));
}

void realtime_print(FILE *out)
{
    struct utsname system;
    const bool known = uname(&system) == 0;
    fprintf(out, "%s, memory %slocked; %s %s (%sPREEMPT_RT), %ld processors\n", fifo ? "SCHED_FIFO 80" : "SCHED_OTHER",
            locked ? "" : "not ", known ? system.sysname : "", known ? system.release : "",
            known && strstr(system.version, "PREEMPT_RT") ? "" : "not ", sysconf(_SC_NPROCESSORS_ONLN));
}

void realtime_bare(uint32_t seconds, struct lateness *l)
{
    uint64_t until_ns = realtime_now_ns();
    for (uint32_t i = 0; i < 1000 * seconds && native_running(); i++) { /* bound: 1000 per second */
        until_ns += 1000000;
        const int64_t late_ns = realtime_sleep(until_ns);
        if (late_ns >= 0)
            lateness_add(l, late_ns);
        if (late_ns > 1000000) /* as the loop: a tick that was lost is not caught up */
            until_ns = realtime_now_ns();
    }
}

void lateness_add(struct lateness *l, int64_t ns)
{
    const uint64_t late_ns = ns > 0 ? (uint64_t)ns : 0, bin = late_ns / 1000;
    l->count++;
    l->total_ns += late_ns;
    l->worst_ns = late_ns > l->worst_ns ? late_ns : l->worst_ns;
    if (bin < LATENESS_BINS)
        l->bin[bin]++;
    else
        l->beyond++;
}

double lateness_quantile_us(const struct lateness *l, double share)
{
    uint64_t below = 0;
    for (uint32_t i = 0; i < LATENESS_BINS; i++) { /* bound: LATENESS_BINS */
        below += l->bin[i];
        if ((double)below >= share * (double)l->count)
            return i + 1.0;
    }
    return 1e-3 * (double)l->worst_ns;
}

void lateness_print(FILE *out, const char *name, const struct lateness *l)
{
    fprintf(out, "%s: max %.0f us, 99.9 %% below %.0f us, mean %.1f us, of %llu\n", name, 1e-3 * (double)l->worst_ns,
            lateness_quantile_us(l, 0.999), l->count ? 1e-3 * (double)l->total_ns / (double)l->count : 0.0,
            (unsigned long long)l->count);
}
