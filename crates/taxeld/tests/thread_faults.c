/* A process that can have all threads but one: thread number THREAD_AT, of a process that has this preloaded, is not to be had. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

static atomic_long threads;

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *with) {
    static int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    if (!real) real = (__typeof__(real))dlsym(RTLD_NEXT, "pthread_create");
    const char *at = getenv("THREAD_AT");
    if (at && ++threads == atol(at)) return EAGAIN;
    return real(thread, attributes, run, with);
}
