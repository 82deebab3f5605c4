/* A disk that fails, for a process that has this preloaded: at call number FAULT_AT that changes a file below FAULT_DIR, or
 * at the calls that are named.
 *
 * FAULT is what happens:
 *   eio         that call fails
 *   full        that call fails, for want of room
 *   enospc      that one and all after it fail
 *   erofs       the same with another reason
 *   readonly    the same, and no file can be opened for writing, as on a disk that was mounted so
 *   kill        the process dies before it
 *   torn        half of what is written, then the process dies
 *   hold        each call waits as long as the file FAULT_WHEN is there
 *   slow        each call takes FAULT_MS milliseconds as long as the file FAULT_WHEN is there
 *   unflushed   every flush of a file whose path ends with FAULT_OF does nothing
 *   unreadable  page FAULT_AT, of 4096 bytes, of the file that is FAULT_OF at the start cannot be read, under whatever name
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
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static atomic_long calls;

static int below(const char *path) {
    const char *dir = getenv("FAULT_DIR");
    return dir && path && strncmp(path, dir, strlen(dir)) == 0;
}

/* The path of a file, of 4096 bytes at most; empty if it has none. */
static const char *path_of(int fd, char *path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, 4095);
    path[length < 0 ? 0 : length] = 0;
    return path;
}

static int below_fd(int fd) {
    char path[4096];
    return below(path_of(fd, path));
}

/* Whether a flush of this file is to do nothing. */
static int unflushed(int fd) {
    const char *fault = getenv("FAULT"), *end = getenv("FAULT_OF");
    if (!fault || !end || strcmp(fault, "unflushed") != 0) return 0;
    char path[4096];
    size_t length = strlen(path_of(fd, path)), end_length = strlen(end);
    return below(path) && length >= end_length && strcmp(path + length - end_length, end) == 0;
}

static void hold(void) {
    const char *when = getenv("FAULT_WHEN");
    for (int waited_ms = 0; waited_ms < 60000 && when && access(when, F_OK) == 0; waited_ms += 5) usleep(5000);
}

static void drag(void) {
    const char *when = getenv("FAULT_WHEN"), *ms = getenv("FAULT_MS");
    if (when && ms && access(when, F_OK) == 0) usleep(1000 * atol(ms));
}

/* What happens to this call: 0 nothing, else an error, or -1 for half of it and then the end. */
static int strike(void) {
    const char *fault = getenv("FAULT"), *at = getenv("FAULT_AT");
    long call = ++calls, number = at ? atol(at) : 0;
    if (!fault || call < number) return 0;
    if (strcmp(fault, "slow") == 0) drag();
    if (strcmp(fault, "enospc") == 0) return ENOSPC;
    if (strcmp(fault, "erofs") == 0 || strcmp(fault, "readonly") == 0) return EROFS;
    if (call != number) return 0;
    if (strcmp(fault, "eio") == 0) return EIO;
    if (strcmp(fault, "full") == 0) return ENOSPC;
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

static struct stat bad; /* the file with the page that cannot be read; none if its inode is 0 */

__attribute__((constructor)) static void find_bad(void) {
    const char *fault = getenv("FAULT"), *path = getenv("FAULT_OF");
    if (!fault || !path || strcmp(fault, "unreadable") != 0 || stat(path, &bad) != 0) bad.st_ino = 0;
}

/* How much of what is to be read from here can be: none of it if it begins in the bad page. */
static ssize_t readable(int fd, size_t length, off_t at) {
    struct stat file;
    if (bad.st_ino == 0 || fstat(fd, &file) != 0 || file.st_ino != bad.st_ino || file.st_dev != bad.st_dev) return length;
    off_t begin = atol(getenv("FAULT_AT")) * 4096;
    if (at >= begin + 4096 || at + (off_t)length <= begin) return length;
    return at >= begin ? 0 : begin - at;
}

#define READ(name, type) \
    ssize_t name(int fd, void *data, size_t length, type at) { \
        ssize_t some = readable(fd, length, at); \
        return length && !some ? refuse(EIO) : REAL(name)(fd, data, some, at); \
    }

READ(pread, off_t)
READ(pread64, off64_t)

ssize_t read(int fd, void *data, size_t length) {
    ssize_t some = readable(fd, length, bad.st_ino ? lseek(fd, 0, SEEK_CUR) : 0);
    return length && !some ? refuse(EIO) : REAL(read)(fd, data, some);
}

/* Whoever copies with these reads instead. */
ssize_t copy_file_range(int from, off64_t *from_at, int to, off64_t *to_at, size_t length, unsigned flags) {
    return bad.st_ino ? refuse(ENOSYS) : REAL(copy_file_range)(from, from_at, to, to_at, length, flags);
}

ssize_t sendfile64(int to, int from, off64_t *at, size_t length) {
    return bad.st_ino ? refuse(ENOSYS) : REAL(sendfile64)(to, from, at, length);
}

#define FLUSH(name) \
    int name(int fd) { \
        int error = below_fd(fd) ? strike() : 0; \
        return error ? refuse(error) : unflushed(fd) ? 0 : REAL(name)(fd); \
    }

FLUSH(fsync)
FLUSH(fdatasync)
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

/* Whether this file is opened to be changed, on a disk that is mounted read-only. */
static int is_barred(const char *path, int flags) {
    const char *fault = getenv("FAULT");
    return fault && strcmp(fault, "readonly") == 0 && (flags & O_ACCMODE) != O_RDONLY && below(path);
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        va_list list; \
        va_start(list, flags); \
        mode_t mode = flags & O_CREAT ? va_arg(list, mode_t) : 0; \
        va_end(list); \
        int makes = flags & O_CREAT && below(path) && access(path, F_OK) != 0; \
        int error = makes ? strike() : is_barred(path, flags) ? EROFS : 0; \
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
