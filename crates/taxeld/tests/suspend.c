/* A machine that was suspended for an hour, for a process that has this preloaded: as soon as the file SUSPENDED_AN_HOUR is
 * there, CLOCK_BOOTTIME has gone on by an hour. The wall clock goes on as it does everywhere else.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

int clock_gettime(clockid_t clock, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    const char *path = getenv("SUSPENDED_AN_HOUR");
    int result;
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    result = real(clock, now);
    if (clock == CLOCK_BOOTTIME && path && access(path, F_OK) == 0) now->tv_sec += 3600;
    return result;
}
