/* A machine that has slept for an hour, for a process that has this preloaded: CLOCK_BOOTTIME and CLOCK_REALTIME have gone on,
 * CLOCK_MONOTONIC has not. So it is as soon as the file SLEPT_AN_HOUR is there, and for the thread `service` alone, which so is
 * the first to run after it, as soon as SERVICE_WOKE is there.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

static int is_there(const char *variable) {
    const char *path = getenv(variable);
    return path && access(path, F_OK) == 0;
}

static int is_the_service(void) {
    char name[16] = "";
    return prctl(PR_GET_NAME, name) == 0 && strcmp(name, "service") == 0;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(clock, now);
    if (clock == CLOCK_MONOTONIC) return result;
    if (is_there("SLEPT_AN_HOUR") || (is_the_service() && is_there("SERVICE_WOKE"))) now->tv_sec += 3600;
    return result;
}
