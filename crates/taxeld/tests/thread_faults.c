/* A process that has this preloaded can have all threads but number THREAD_AT; while there is a file THREAD_WHEN, none. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

static atomic_long threads;

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *with) {
    static int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    if (!real) real = (__typeof__(real))dlsym(RTLD_NEXT, "pthread_create");
    const char *at = getenv("THREAD_AT");
    if (at && ++threads == atol(at)) return EAGAIN;
    const char *when = getenv("THREAD_WHEN");
    if (when && access(when, F_OK) == 0) return EAGAIN;
    return real(thread, attributes, run, with);
}
