/* A disk that fails, for a process that has this preloaded: at call number FAULT_AT that changes a file below FAULT_DIR.
 *
 * FAULT is what happens: eio (that call fails), enospc or erofs (that one and all after it), kill (the process dies before
 * it), torn (half of what is written, then the process dies), hold (the call waits until the file FAULT_RELEASE is there).
 * Without FAULT nothing does. How many calls there were is written to FAULT_COUNT when the process ends.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static atomic_long calls;

static int below(const char *path) {
    const char *dir = getenv("FAULT_DIR");
    return dir && path && strncmp(path, dir, strlen(dir)) == 0;
}

static int below_fd(int fd) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return below(path);
}

static void hold(void) {
    const char *release = getenv("FAULT_RELEASE");
    for (int waited_ms = 0; waited_ms < 60000 && release && access(release, F_OK) != 0; waited_ms += 5) usleep(5000);
}

/* What happens to this call: 0 nothing, else an error, or -1 for half of it and then the end. */
static int strike(void) {
    const char *fault = getenv("FAULT"), *at = getenv("FAULT_AT");
    long call = ++calls, number = at ? atol(at) : 0;
    if (!fault || call < number) return 0;
    if (strcmp(fault, "enospc") == 0) return ENOSPC;
    if (strcmp(fault, "erofs") == 0) return EROFS;
    if (call != number) return 0;
    if (strcmp(fault, "eio") == 0) return EIO;
    if (strcmp(fault, "torn") == 0) return -1;
    if (strcmp(fault, "hold") == 0) hold();
    if (strcmp(fault, "kill") == 0) raise(SIGKILL);
    return 0;
}

static int refuse(int error) {
    if (error < 0) raise(SIGKILL);
    errno = error;
    return -1;
}

ssize_t write(int fd, const void *data, size_t length) {
    int error = below_fd(fd) ? strike() : 0;
    if (error < 0) REAL(write)(fd, data, length / 2);
    return error ? refuse(error) : REAL(write)(fd, data, length);
}

ssize_t pwrite(int fd, const void *data, size_t length, off_t at) {
    int error = below_fd(fd) ? strike() : 0;
    if (error < 0) REAL(pwrite)(fd, data, length / 2, at);
    return error ? refuse(error) : REAL(pwrite)(fd, data, length, at);
}

ssize_t pwrite64(int fd, const void *data, size_t length, off64_t at) {
    int error = below_fd(fd) ? strike() : 0;
    if (error < 0) REAL(pwrite64)(fd, data, length / 2, at);
    return error ? refuse(error) : REAL(pwrite64)(fd, data, length, at);
}

#define ON_FD(name, declared, passed) \
    int name declared { \
        int error = below_fd(fd) ? strike() : 0; \
        return error ? refuse(error) : REAL(name) passed; \
    }

ON_FD(fsync, (int fd), (fd))
ON_FD(fdatasync, (int fd), (fd))
ON_FD(ftruncate, (int fd, off_t length), (fd, length))
ON_FD(ftruncate64, (int fd, off64_t length), (fd, length))

int unlink(const char *path) {
    int error = below(path) ? strike() : 0;
    return error ? refuse(error) : REAL(unlink)(path);
}

int rename(const char *from, const char *to) {
    int error = below(to) ? strike() : 0;
    return error ? refuse(error) : REAL(rename)(from, to);
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        va_list list; \
        va_start(list, flags); \
        mode_t mode = flags & O_CREAT ? va_arg(list, mode_t) : 0; \
        va_end(list); \
        int makes = flags & O_CREAT && below(path) && access(path, F_OK) != 0; \
        int error = makes ? strike() : 0; \
        return error ? refuse(error) : REAL(name)(path, flags, mode); \
    }

OPEN(open)
OPEN(open64)

__attribute__((destructor)) static void tell(void) {
    const char *path = getenv("FAULT_COUNT");
    FILE *out = path ? fopen(path, "w") : NULL;
    if (!out) return;
    fprintf(out, "%ld\n", (long)calls);
    fclose(out);
}
