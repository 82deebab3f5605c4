/*
 * A controller in C that reads the force from shared memory a thousand times a second.
 *
 * usage: controller [PAGE [SECONDS]]      (/dev/shm/taxeld/left_forearm; for ever)
 * It shows what it has twice a second. Exit code 3 if the last reading was no force.
 */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>

#include "taxel_force.h"

int main(int argc, char **argv) {
    const char *page = argc > 1 ? argv[1] : "/dev/shm/taxeld/left_forearm";
    const double seconds = argc > 2 ? atof(argv[2]) : INFINITY;
    const struct timespec period = {0, 1000000};
    taxel_force_reader reader;
    taxel_force_status status = TAXEL_FORCE_NO_PAGE;
    unsigned long cycle;

    if (taxel_force_init(&reader, page) != 0) return 2;
    for (cycle = 0; (double)cycle < seconds * 1000.0; cycle++) {
        taxel_force force;
        status = taxel_force_follow(&reader, 0, &force);
        /* Here the controller acts on force.total_n, if the status is TAXEL_FORCE_GOOD, and does without if it is not. */
        if (cycle % 500 == 0) {
            const double age_ms = (double)force.age_ns * 1e-6;
            if (status == TAXEL_FORCE_GOOD && isnan(force.high_n))
                printf("%6.2f N (%.2f N or more), %3.0f ms old\n", force.total_n, force.low_n, age_ms);
            else if (status == TAXEL_FORCE_GOOD)
                printf("%6.2f N (%.2f to %.2f N), %3.0f ms old\n", force.total_n, force.low_n, force.high_n, age_ms);
            else
                printf("no force: %s%s%s\n", taxel_force_words(status), status == TAXEL_FORCE_STATE ? ": " : "",
                       status == TAXEL_FORCE_STATE ? force.reasons : "");
            fflush(stdout);
        }
        nanosleep(&period, NULL);
    }
    taxel_force_close(&reader);
    return status == TAXEL_FORCE_GOOD ? 0 : 3;
}
