/*
 * The newest force of a patch of robot skin, from the shared memory of taxeld on the same machine.
 *
 * C11 or C++17 with GCC or Clang on 64-bit Linux; this header is all there is. Layout: shared-memory.md beside it.
 *
 *     taxel_force_reader reader;
 *     taxel_force_init(&reader, "/dev/shm/taxeld/left_forearm");   // need not be there yet
 *     for (;;) {                                                   // the control loop
 *         taxel_force force;
 *         if (taxel_force_follow(&reader, 0, &force) == TAXEL_FORCE_GOOD) act(force.total_n);
 *         else do_without();
 *     }
 *
 * taxel_force_read looks at the page that is open: no system call but clock_gettime, which Linux answers in user space.
 * taxel_force_follow does the same, and looks for a new page, at most every 50 ms, while the daemon does not live.
 * A reader belongs to one thread at a time.
 *
 * A page is refused if others may write in it or in its folder. A program in C11 defines _POSIX_C_SOURCE as 200809L before it
 * includes anything.
 */
#ifndef TAXEL_FORCE_H
#define TAXEL_FORCE_H

#include <fcntl.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TAXEL_FORCE_VERSION 1u
#define TAXEL_FORCE_BYTES 4096u

/* Why there is no force; TAXEL_FORCE_GOOD: there is one. */
typedef enum taxel_force_status {
    TAXEL_FORCE_GOOD = 0,
    TAXEL_FORCE_NO_PAGE = 1,     /* no daemon, another patch, or a page that may not be read or believed */
    TAXEL_FORCE_NOTHING_YET = 2, /* no sample was written yet */
    TAXEL_FORCE_CLOSED = 3,      /* the daemon has ended */
    TAXEL_FORCE_WRITER_GONE = 4, /* the daemon hangs or was killed */
    TAXEL_FORCE_STATE = 5,       /* the state carries no force: see `state` and `reasons` */
    TAXEL_FORCE_TOO_OLD = 6,     /* the newest frame is older than the limit: see `age_ns` */
    TAXEL_FORCE_OTHER_CLOCK = 7  /* stamps of the future: a container with a clock of its own */
} taxel_force_status;

/* How far a force can be trusted: the numbers of taxel.v1.ForceState. Only OK and DEGRADED carry one. */
typedef enum taxel_force_state {
    TAXEL_STATE_UNSPECIFIED = 0,
    TAXEL_STATE_OK = 1,
    TAXEL_STATE_DEGRADED = 2,
    TAXEL_STATE_STALE = 3,
    TAXEL_STATE_TARE_INVALID = 4,
    TAXEL_STATE_UNCALIBRATED = 5
} taxel_force_state;

/* A sample. Unless the status is TAXEL_FORCE_GOOD every figure of force is NaN. What is not known is NaN. */
typedef struct taxel_force {
    double total_n;              /* total normal force, N */
    double sigma_n;              /* its standard uncertainty, N */
    double low_n, high_n;        /* 95 % interval, N; high_n NaN: nothing bounds the force above */
    double undetected_n;         /* upper bound (95 %) of force that is present but not detected, N; part of high_n */
    double step_n;               /* by how much total_n jumped when zero or model set last changed, N */
    double resultant_n[3];       /* force on the skin, N, in the patch's frame */
    double moment_nm[3];         /* its moment about the frame's origin, N m */
    double centre_of_pressure_m[3];
    int64_t age_ns;              /* since the arrival of the newest frame in it; -1 if there is none */
    int64_t monotonic_ns;        /* that arrival, CLOCK_BOOTTIME; 0 if there is none */
    int64_t wall_ns;             /* the same since 1970: a label */
    int64_t written_ns;          /* when it was written, CLOCK_BOOTTIME */
    uint64_t sequence;           /* one more for each sample that was published */
    uint64_t zero_epoch;         /* one more for each zero taken or lost */
    uint32_t state;              /* taxel_force_state */
    uint32_t simulated;          /* 1: a simulator makes it, as in `taxeld demo`: no skin is touched */
    uint32_t active, excluded, stale, out_of_range; /* taxels */
    char model_set[65];          /* id of the model set, empty without one */
    char reasons[257];           /* why the state is not OK */
} taxel_force;

/* Fields are the header's own. */
typedef struct taxel_force_reader {
    char path[512];
    const uint64_t *page; /* NULL: none */
    dev_t device;
    ino_t inode;
    int64_t look_at_ns;
} taxel_force_reader;

/* Where things are in the page, in words of eight bytes. */
enum {
    TAXEL_AT_VERSION = 1, TAXEL_AT_AGE_LIMIT = 4, TAXEL_AT_BEAT_LIMIT = 5, TAXEL_AT_WRITES = 16, TAXEL_AT_BEAT = 17,
    TAXEL_AT_CLOSED = 18, TAXEL_AT_SAMPLES = 32, TAXEL_SAMPLE_WORDS = 64
};

/* A relaxed load, ordered by taxel_fence_: all that is defined for atomics in memory that is mapped read-only. */
static inline uint64_t taxel_load_(const uint64_t *word) { return __atomic_load_n(word, __ATOMIC_RELAXED); }
static inline void taxel_fence_(void) { __atomic_thread_fence(__ATOMIC_ACQUIRE); }

static inline double taxel_double_(uint64_t word) {
    double number;
    memcpy(&number, &word, sizeof number);
    return number;
}

static inline uint32_t taxel_half_(uint64_t word, int second) {
    uint32_t halves[2];
    memcpy(halves, &word, sizeof halves);
    return halves[second];
}

/* CLOCK_BOOTTIME, ns. */
static inline int64_t taxel_force_now_ns(void) {
    struct timespec now;
    if (clock_gettime(CLOCK_BOOTTIME, &now) != 0) return INT64_MIN;
    return (int64_t)now.tv_sec * 1000000000 + (int64_t)now.tv_nsec;
}

/* Names the page to read, which need not be there yet. -1 if the path is too long. */
static inline int taxel_force_init(taxel_force_reader *reader, const char *path) {
    memset(reader, 0, sizeof *reader);
    reader->look_at_ns = INT64_MIN;
    if (strlen(path) >= sizeof reader->path) return -1;
    strcpy(reader->path, path);
    return 0;
}

/* Whether nobody but its owner can write in the open page, nor in its folder. */
static inline int taxel_private_(const char *path, const struct stat *page) {
    struct stat about;
    char folder[512], *end;
    strcpy(folder, path);
    end = strrchr(folder, '/');
    if (end == NULL) strcpy(folder, ".");
    else end[end == folder] = '\0';
    return stat(folder, &about) == 0 && ((page->st_mode | about.st_mode) & (S_IWGRP | S_IWOTH)) == 0;
}

/* Lets the page go. */
static inline void taxel_force_close(taxel_force_reader *reader) {
    if (reader->page != NULL) munmap((void *)(uintptr_t)reader->page, TAXEL_FORCE_BYTES);
    reader->page = NULL;
}

/* Opens the page that has the name now: 1 if it is another one than before, 0 if there is none or it is the same. */
static inline int taxel_force_open(taxel_force_reader *reader) {
    struct stat about;
    int file = open(reader->path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (file < 0) return 0;
    if (fstat(file, &about) == 0 && S_ISREG(about.st_mode) && about.st_size >= (off_t)TAXEL_FORCE_BYTES &&
        !(reader->page != NULL && about.st_dev == reader->device && about.st_ino == reader->inode) &&
        taxel_private_(reader->path, &about)) {
        void *mapped = mmap(NULL, TAXEL_FORCE_BYTES, PROT_READ, MAP_SHARED, file, 0);
        if (mapped != MAP_FAILED) {
            const uint64_t *page = (const uint64_t *)mapped;
            const uint64_t version = taxel_load_(page + TAXEL_AT_VERSION);
            if (memcmp(page, "TAXELFRC", 8) == 0 && taxel_half_(version, 0) == TAXEL_FORCE_VERSION &&
                taxel_half_(version, 1) == TAXEL_FORCE_BYTES) {
                taxel_force_close(reader);
                reader->page = page;
                reader->device = about.st_dev;
                reader->inode = about.st_ino;
                close(file);
                return 1;
            }
            munmap(mapped, TAXEL_FORCE_BYTES);
        }
    }
    close(file);
    return 0;
}

/* `count` figures, if all of them are numbers; else NaN. */
static inline void taxel_figures_(const uint64_t *words, int count, double *figures) {
    int i, there = 1;
    for (i = 0; i < count; i++) figures[i] = taxel_double_(words[i]);
    for (i = 0; i < count; i++) there = there && isfinite(figures[i]);
    for (i = 0; i < count && !there; i++) figures[i] = (double)NAN;
}

/* No force, whatever else is known. */
static inline void taxel_no_figures_(taxel_force *force) {
    int i;
    force->total_n = force->sigma_n = force->low_n = force->high_n = force->undetected_n = force->step_n = (double)NAN;
    for (i = 0; i < 3; i++)
        force->resultant_n[i] = force->moment_nm[i] = force->centre_of_pressure_m[i] = (double)NAN;
}

static inline void taxel_decode_(const uint64_t *words, taxel_force *force) {
    const uint32_t flags = taxel_half_(words[4], 1);
    force->sequence = words[0];
    force->monotonic_ns = (flags & 1u) ? (int64_t)words[1] : 0;
    force->wall_ns = (int64_t)words[2];
    force->written_ns = (int64_t)words[3];
    force->state = taxel_half_(words[4], 0);
    force->simulated = (flags >> 1) & 1u;
    taxel_figures_(words + 5, 1, &force->total_n);
    taxel_figures_(words + 6, 1, &force->sigma_n);
    taxel_figures_(words + 7, 1, &force->low_n);
    taxel_figures_(words + 8, 1, &force->high_n);
    taxel_figures_(words + 9, 1, &force->undetected_n);
    taxel_figures_(words + 10, 1, &force->step_n);
    force->zero_epoch = words[11];
    taxel_figures_(words + 12, 3, force->resultant_n);
    taxel_figures_(words + 15, 3, force->moment_nm);
    taxel_figures_(words + 18, 3, force->centre_of_pressure_m);
    force->active = taxel_half_(words[21], 0);
    force->excluded = taxel_half_(words[21], 1);
    force->stale = taxel_half_(words[22], 0);
    force->out_of_range = taxel_half_(words[22], 1);
    memcpy(force->model_set, words + 23, 64);
    memcpy(force->reasons, words + 31, 256);
}

/* The newest sample, whole; 0 if there is none yet. */
static inline int taxel_take_(const uint64_t *page, uint64_t *words) {
    int attempt, i;
    for (attempt = 0; attempt < 16; attempt++) {
        const uint64_t number = taxel_load_(page + TAXEL_AT_WRITES);
        const uint64_t *place = page + TAXEL_AT_SAMPLES + (number & 1u) * TAXEL_SAMPLE_WORDS;
        if (number == 0) return 0;
        taxel_fence_();
        for (i = 0; i < TAXEL_SAMPLE_WORDS; i++) words[i] = taxel_load_(place + i);
        taxel_fence_();
        if (taxel_load_(page + TAXEL_AT_WRITES) == number) return 1;
    }
    return 0;
}

/*
 * Whether a sample is a force: the rule that the daemon and all its readers share. It is one while its state is OK or DEGRADED,
 * its total is a number and its age has not passed the daemon's limit or the caller's own, if that is stricter. All times in s;
 * `age_s`: when it was sent, `waited_s`: since then, `own_s`: NaN without an own limit.
 */
static inline taxel_force_status taxel_force_judge(uint32_t state, double total_n, double age_s, double waited_s,
                                                   double max_age_s, double own_s) {
    double limit_s = isfinite(max_age_s) && max_age_s > 0.0 ? max_age_s : 0.0;
    if ((state != TAXEL_STATE_OK && state != TAXEL_STATE_DEGRADED) || !isfinite(total_n) || isnan(age_s))
        return TAXEL_FORCE_STATE;
    if (own_s < limit_s) limit_s = own_s;
    return age_s >= 0.0 && age_s + waited_s <= limit_s ? TAXEL_FORCE_GOOD : TAXEL_FORCE_TOO_OLD;
}

/*
 * The newest force of the open page, judged now. `age_limit_ns`: the caller's own limit, in force if it is stricter than
 * the page's; 0: the page's. Anything but TAXEL_FORCE_GOOD is no force.
 */
static inline taxel_force_status taxel_force_read(const taxel_force_reader *reader, int64_t age_limit_ns,
                                                  taxel_force *force) {
    uint64_t words[TAXEL_SAMPLE_WORDS];
    taxel_force_status status = TAXEL_FORCE_GOOD;
    const uint64_t *page = reader->page;
    uint64_t limit, beat_limit, closed;
    int64_t beat, now;
    int taken;

    memset(force, 0, sizeof *force);
    taxel_no_figures_(force);
    force->age_ns = -1;
    if (page == NULL) return TAXEL_FORCE_NO_PAGE;
    taken = taxel_take_(page, words);
    beat = (int64_t)taxel_load_(page + TAXEL_AT_BEAT);
    closed = taxel_load_(page + TAXEL_AT_CLOSED);
    limit = taxel_load_(page + TAXEL_AT_AGE_LIMIT);
    beat_limit = taxel_load_(page + TAXEL_AT_BEAT_LIMIT);
    taxel_fence_();
    now = taxel_force_now_ns(); /* last: nothing that was found can be of a later moment on the same clock */

    if (taken) {
        taxel_decode_(words, force);
        if (force->monotonic_ns != 0 && now >= force->monotonic_ns) force->age_ns = now - force->monotonic_ns;
    }
    if (closed != 0) status = TAXEL_FORCE_CLOSED;
    else if (!taken) status = TAXEL_FORCE_NOTHING_YET;
    else if (now < beat) status = TAXEL_FORCE_OTHER_CLOCK;
    else if ((uint64_t)now - (uint64_t)beat > beat_limit) status = TAXEL_FORCE_WRITER_GONE;
    else if (force->monotonic_ns != 0 && now < force->monotonic_ns) status = TAXEL_FORCE_OTHER_CLOCK;
    else
        status = taxel_force_judge(force->state, force->total_n, force->age_ns < 0 ? (double)NAN : (double)force->age_ns * 1e-9,
                                   0.0, (double)limit * 1e-9, age_limit_ns > 0 ? (double)age_limit_ns * 1e-9 : (double)NAN);
    if (status != TAXEL_FORCE_GOOD) taxel_no_figures_(force);
    return status;
}

/* As taxel_force_read; while no daemon is behind the page it looks for a new one, at most every 50 ms. */
static inline taxel_force_status taxel_force_follow(taxel_force_reader *reader, int64_t age_limit_ns,
                                                    taxel_force *force) {
    taxel_force_status status = taxel_force_read(reader, age_limit_ns, force);
    int64_t now;
    /* A page without a sample may be that of a daemon that was killed as it started. */
    if (status != TAXEL_FORCE_NO_PAGE && status != TAXEL_FORCE_NOTHING_YET && status != TAXEL_FORCE_CLOSED &&
        status != TAXEL_FORCE_WRITER_GONE)
        return status;
    now = taxel_force_now_ns();
    if (now < reader->look_at_ns) return status;
    reader->look_at_ns = now + 50000000;
    return taxel_force_open(reader) ? taxel_force_read(reader, age_limit_ns, force) : status;
}

/* A status in words. */
static inline const char *taxel_force_words(taxel_force_status status) {
    switch (status) {
    case TAXEL_FORCE_GOOD: return "good";
    case TAXEL_FORCE_NO_PAGE:
        return "there is no page to be read: no daemon runs, it has another patch, this account is not in the page's group, "
               "or others may write in it or in its folder";
    case TAXEL_FORCE_NOTHING_YET: return "no sample yet";
    case TAXEL_FORCE_CLOSED: return "the daemon has ended";
    case TAXEL_FORCE_WRITER_GONE: return "the daemon's engine does not run";
    case TAXEL_FORCE_STATE: return "the state carries no force";
    case TAXEL_FORCE_TOO_OLD: return "too old";
    case TAXEL_FORCE_OTHER_CLOCK: return "stamps of the future: reader and daemon do not have the same clock";
    }
    return "unknown";
}

#ifdef __cplusplus
}
#endif

#endif
