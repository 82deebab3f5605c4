/* A machine that has slept for an hour as soon as the file SLEPT_AN_HOUR is there, for a process that has this preloaded:
 * CLOCK_BOOTTIME and CLOCK_REALTIME have gone on, CLOCK_MONOTONIC has not.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

int clock_gettime(clockid_t clock, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(clock, now);
    const char *slept = getenv("SLEPT_AN_HOUR");
    if (clock != CLOCK_MONOTONIC && slept && access(slept, F_OK) == 0) now->tv_sec += 3600;
    return result;
}
