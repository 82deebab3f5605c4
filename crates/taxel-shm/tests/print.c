/* Prints what the header reads of a page, in the form of the tests. */
#define _POSIX_C_SOURCE 200809L
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "taxel_force.h"

static void figures(const char *name, const double *figure, int count) {
    int i;
    printf("%s", name);
    for (i = 0; i < count; i++) {
        if (isfinite(figure[i])) printf(" %.3f", figure[i]);
        else printf(" -");
    }
    printf("\n");
}

int main(int argc, char **argv) {
    taxel_force_reader reader;
    taxel_force force;
    taxel_force_status status;
    if (argc < 2 || taxel_force_init(&reader, argv[1]) != 0) return 2;
    status = taxel_force_follow(&reader, 0, &force);
    printf("status %d\n", (int)status);
    printf("sequence %" PRIu64 " stamps %" PRId64 " %" PRId64 " %" PRId64 "\n", force.sequence, force.monotonic_ns,
           force.wall_ns, force.written_ns);
    printf("state %u simulated %u\n", force.state, force.simulated);
    figures("total", &force.total_n, 1);
    figures("sigma", &force.sigma_n, 1);
    figures("low", &force.low_n, 1);
    figures("high", &force.high_n, 1);
    figures("undetected", &force.undetected_n, 1);
    figures("step", &force.step_n, 1);
    printf("epoch %" PRIu64 "\n", force.zero_epoch);
    figures("resultant", force.resultant_n, 3);
    figures("moment", force.moment_nm, 3);
    figures("centre", force.centre_of_pressure_m, 3);
    printf("taxels %u %u %u %u\n", force.active, force.excluded, force.stale, force.out_of_range);
    printf("models %s\nreasons %s\n", force.model_set, force.reasons);
    taxel_force_close(&reader);
    return 0;
}
