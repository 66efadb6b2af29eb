/* Read packets of a XELA server, one JSON document a line, and print the changes of state.
 *
 *     holdfast export builtin:any model.h --sensor uskin-curved --fingers 2
 *     cc -std=c99 -O2 -I. xela_states.c -o xela_states -lm
 *     websocat ws://127.0.0.1:5000 | ./xela_states
 *
 * Sensor n of the server is finger n of the header; all are alike.
 */
#include "model.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_SIZE 65536

enum { N_TAXELS = HOLDFAST_N_TAXELS / HOLDFAST_N_FINGERS }; /* of a finger */

static const char *const NAMES[] = {"UNKNOWN", "NO_CONTACT", "UNSTABLE", "STABLE"};

/* Return what follows a key, its colon and a quotation mark, if there is one; NULL without it. */
static const char *value_of(const char *text, const char *key)
{
    text = text == NULL ? NULL : strstr(text, key);
    return text == NULL ? NULL : text + strlen(key) + strspn(text + strlen(key), ": \"");
}

/* Copy the readings "804D,8276,8F6A,..." of a finger. Return whether there were enough. */
static bool copy_readings(const char *data, holdfast_real (*readings)[3])
{
    for (int i = 0; i < 3 * N_TAXELS; ++i) {
        char *end;
        readings[i / 3][i % 3] = (holdfast_real)strtol(data, &end, 16);
        if (end == data) {
            return false;
        }
        data = end + (*end == ',');
    }
    return true;
}

/* Fill the readings of a packet; NaN where it has none. Return its time, or NaN. */
static double read_packet(const char *line, holdfast_real (*readings)[3])
{
    const char *time = value_of(line, "\"time\"");
    for (int i = 0; i < HOLDFAST_N_TAXELS; ++i) {
        readings[i][0] = readings[i][1] = readings[i][2] = HF_NAN;
    }
    while ((line = value_of(line, "\"sensor\"")) != NULL) {
        const long finger = strtol(line, NULL, 10) - 1;
        const char *data = value_of(line, "\"data\"");
        if (finger >= 0 && finger < HOLDFAST_N_FINGERS && data != NULL) {
            copy_readings(data, readings + N_TAXELS * finger);
        }
    }
    return time == NULL ? (double)NAN : strtod(time, NULL);
}

int main(void)
{
    static holdfast_detector detector;
    static holdfast_real readings[HOLDFAST_N_TAXELS][3];
    static char line[LINE_SIZE];
    int states[HOLDFAST_N_FINGERS] = {0};
    holdfast_estimate estimate;
    holdfast_init(&detector);
    while (fgets(line, sizeof line, stdin) != NULL) {
        const double time = read_packet(line, readings);
        if (holdfast_update(&detector, time, readings, &estimate) != HOLDFAST_OK) {
            fprintf(stderr, "packet without a later time ignored\n");
            continue;
        }
        for (int f = 0; f < HOLDFAST_N_FINGERS; ++f) {
            if (estimate.finger[f].state != states[f]) {
                states[f] = estimate.finger[f].state;
                printf("%.3f finger %d %s\n", time, f + 1, NAMES[states[f]]);
            }
        }
    }
    return 0;
}
