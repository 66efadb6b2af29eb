/* Read samples (time and readings) from stdin, and write the code and the estimate of each. */
#include "model.h"

#include <stdio.h>

int main(void)
{
    static holdfast_detector detector;
    static holdfast_real readings[HOLDFAST_N_TAXELS][3];
    holdfast_estimate estimate;
    double time;
    holdfast_init(&detector);
    while (fread(&time, sizeof time, 1, stdin) == 1 &&
           fread(readings, sizeof readings, 1, stdin) == 1) {
        const int code = holdfast_update(&detector, time, readings, &estimate);
        fprintf(stdout, "%d %.17g %d", code, estimate.time, estimate.state);
        for (int f = 0; f < HOLDFAST_N_FINGERS; ++f) {
            fprintf(stdout, " %d %.17g", estimate.finger[f].state,
                    (double)estimate.finger[f].stable_probability);
        }
        fprintf(stdout, "\n");
    }
    return 0;
}
