#include "clock.h"

void clock_begin(struct clock *clock)
{
    clock->late = 0;
    clock_gettime(CLOCK_MONOTONIC, &clock->deadline);
}

void clock_wait(struct clock *clock, uint32_t tick_us)
{
    struct timespec now, *deadline = &clock->deadline;
    deadline->tv_nsec += 1000L * (long)tick_us;
    deadline->tv_sec += deadline->tv_nsec / 1000000000L;
    deadline->tv_nsec %= 1000000000L;
    clock_gettime(CLOCK_MONOTONIC, &now);
    int64_t behind_us = (int64_t)(now.tv_sec - deadline->tv_sec) * 1000000 + (now.tv_nsec - deadline->tv_nsec) / 1000;
    clock->late += behind_us > (int64_t)tick_us;
    if (behind_us > CLOCK_FORGIVE_US)
        *deadline = now;
    else /* a signal may end the wait early: the next tick's deadline makes up for it */
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, deadline, NULL);
}
