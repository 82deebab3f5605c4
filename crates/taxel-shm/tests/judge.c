/* Judges each case of taxel-proto's judge.csv by the header: judge FILE. Exit code 1 where it says otherwise. */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "taxel_force.h"

static uint32_t state_of(const char *name) {
    static const char *names[] = {"UNSPECIFIED", "OK", "DEGRADED", "STALE", "TARE_INVALID", "UNCALIBRATED"};
    uint32_t state;
    for (state = 0; state < 6; state++)
        if (strcmp(name, names[state]) == 0) return state;
    return 99;
}

/* The next cell of a row, which is cut off. */
static char *cell(char **rest) {
    char *text = *rest, *end = text + strcspn(text, ",\n");
    *rest = end + 1;
    *end = '\0';
    return text;
}

static double number(const char *text) { return text[0] == '\0' ? (double)NAN : atof(text); }

int main(int argc, char **argv) {
    char line[256], shown[256];
    int cases = 0;
    FILE *file = argc == 2 ? fopen(argv[1], "r") : NULL;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) return 2;
    while (fgets(line, sizeof line, file) != NULL) {
        char *rest = strcpy(shown, line);
        uint32_t state;
        double figures[5];
        const char *verdict, *said;
        int i;
        rest = line;
        state = state_of(cell(&rest));
        for (i = 0; i < 5; i++) figures[i] = number(cell(&rest));
        verdict = cell(&rest);
        /* total_n, age_s, max_age_s, waited_s, own_s */
        switch (taxel_force_judge(state, figures[0], figures[1], figures[3], figures[2], figures[4])) {
        case TAXEL_FORCE_GOOD: said = "FORCE"; break;
        case TAXEL_FORCE_TOO_OLD: said = "TOO_OLD"; break;
        default: said = "STATE";
        }
        if (strcmp(said, verdict) != 0) {
            fprintf(stderr, "%s, and not: %s", said, shown);
            return 1;
        }
        cases++;
    }
    printf("%d cases\n", cases);
    return 0;
}
