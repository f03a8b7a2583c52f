/* Real time: what this process may have, and how late the machine wakes it. */
#include "doctor.h"

#include <errno.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

enum { PRIORITY = 80, LOCKED_MiB = 32, SLEEPS = 200 }; /* what the native controller asks for; its memory */

static const char *user(void)
{
    const char *name = getlogin();
    return name ? name : "$USER";
}

static void scheduling(struct doctor *doctor)
{
    struct doctor_check *check = doctor_add(doctor, "time", "sched_fifo", "the native controller in real time", false);
    const int policy = sched_getscheduler(0);
    struct sched_param own, wanted = {.sched_priority = PRIORITY};
    sched_getparam(0, &own);
    if (policy >= 0 && sched_setscheduler(0, SCHED_FIFO, &wanted) == 0) {
        sched_setscheduler(0, policy, &own);
        doctor_yes(check, "priority %d is allowed", (int)PRIORITY);
        return;
    }
    struct rlimit limit = {0};
    getrlimit(RLIMIT_RTPRIO, &limit);
    snprintf(check->found, sizeof check->found, "priority %d is not allowed (at most %llu): %s", (int)PRIORITY,
             (unsigned long long)limit.rlim_cur, strerror(errno));
    snprintf(
        check->fix, sizeof check->fix,
        "as root: setcap cap_sys_nice,cap_ipc_lock+ep build/firmware/native/controller.elf; or: echo '%s - rtprio 90' "
        ">/etc/security/limits.d/trocar.conf, then log in again",
        user());
}

static void locked_memory(struct doctor *doctor)
{
    struct doctor_check *check = doctor_add(doctor, "time", "memlock", "memory that is never paged out", false);
    struct rlimit limit = {0};
    getrlimit(RLIMIT_MEMLOCK, &limit);
    const bool all = limit.rlim_cur == RLIM_INFINITY || geteuid() == 0;
    const unsigned long long MiB = (unsigned long long)limit.rlim_cur >> 20;
    if (all)
        doctor_yes(check, "as much as there is");
    else
        doctor_yes(check, "%llu MiB", MiB);
    if (!all && MiB < LOCKED_MiB) {
        check->answer = DOCTOR_NO;
        snprintf(check->fix, sizeof check->fix,
                 "as root: echo '%s - memlock %d' >>/etc/security/limits.d/trocar.conf, then log in again", user(),
                 (int)LOCKED_MiB * 1024);
    }
}

static void clock_step(struct doctor *doctor)
{
    char source[60] = "?";
    struct timespec step = {0};
    struct doctor_check *check = doctor_add(doctor, "time", "clock", "ticks of a millisecond", false);
    doctor_line(doctor, "/sys/devices/system/clocksource/clocksource0/current_clocksource", source, sizeof source);
    clock_getres(CLOCK_MONOTONIC, &step);
    const long long ns = (long long)step.tv_sec * 1000000000 + step.tv_nsec;
    doctor_yes(check, "steps of %lld ns (%s)", ns, source);
    if (ns > 1000) {
        check->answer = DOCTOR_NO;
        snprintf(check->fix, sizeof check->fix, "boot with highres=on (add it to GRUB_CMDLINE_LINUX; update-grub)");
    }
}

/* How late sleeps of a millisecond end: a figure of this machine as it is now, no judgement. */
static void wake(struct doctor *doctor)
{
    struct doctor_check *check = doctor_add(doctor, "time", "wake_up", "the jitter to expect", false);
    struct utsname system = {0};
    struct timespec deadline, now;
    int64_t worst_ns = 0, sum_ns = 0;
    clock_gettime(CLOCK_MONOTONIC, &deadline);
    for (int i = 0; i < SLEEPS; i++) {
        deadline.tv_nsec += 1000000;
        if (deadline.tv_nsec >= 1000000000) {
            deadline.tv_nsec -= 1000000000;
            deadline.tv_sec++;
        }
        if (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, NULL) != 0)
            break;
        clock_gettime(CLOCK_MONOTONIC, &now);
        const int64_t late_ns = (int64_t)(now.tv_sec - deadline.tv_sec) * 1000000000 + now.tv_nsec - deadline.tv_nsec;
        worst_ns = late_ns > worst_ns ? late_ns : worst_ns;
        sum_ns += late_ns;
    }
    uname(&system);
    doctor_yes(check, "%d sleeps of 1 ms: %.0f us late on average, %.0f us at worst; %sPREEMPT_RT, %ld processors",
               (int)SLEEPS, 1e-3 * (double)sum_ns / SLEEPS, 1e-3 * (double)worst_ns,
               strstr(system.version, "PREEMPT_RT") ? "" : "not ", sysconf(_SC_NPROCESSORS_ONLN));
}

static void governor(struct doctor *doctor)
{
    char line[60];
    if (!doctor_line(doctor, "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", line, sizeof line))
        return; /* a virtual machine: nothing to choose */
    struct doctor_check *check = doctor_add(doctor, "time", "governor", "an even clock of the processor", false);
    doctor_yes(check, "%s", line);
    if (strcmp(line, "performance") != 0) {
        check->answer = DOCTOR_PARTLY;
        snprintf(check->fix, sizeof check->fix,
                 "as root: echo performance | tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor");
    }
}

void doctor_time(struct doctor *doctor)
{
    scheduling(doctor);
    locked_memory(doctor);
    clock_step(doctor);
    governor(doctor);
    wake(doctor);
}
