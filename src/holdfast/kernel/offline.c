/* The detector, and its rules for whole arrays: probabilities, and states with other limits.
 *
 * Exported headers have no functions of whole arrays: they join the files of holdfast.c. */
#include "holdfast.c"

#include "batch.h"

void holdfast_logistic(double *values, size_t n)
{
    for (size_t k = 0; k < n; ++k) {
        values[k] = hf_probability(values[k]);
    }
}

void holdfast_replay(
    const double *times, const double *probability, const int8_t *raw, size_t n,
    const double *limits, int8_t *out)
{
    const double threshold = limits[HOLDFAST_LIMIT_THRESHOLD];
    const double period = limits[HOLDFAST_LIMIT_PERIOD];
    const double switching = limits[HOLDFAST_LIMIT_SWITCHING];
    holdfast_decision d;
    hf_start_decision(&d);
    for (size_t k = 0; k < n; ++k) {
        int32_t state = HOLDFAST_NO_CONTACT;
        if (raw[k] == HOLDFAST_UNKNOWN) {
            d.state = d.candidate = HOLDFAST_UNKNOWN;
            d.last_unstable = d.filtered = NAN;
        } else {
            if (raw[k] == HOLDFAST_NO_CONTACT) {
                d.filtered = NAN;
            } else {
                double p = probability[k];
                if (switching > 0) {
                    p = hf_filter(&d, p, threshold, switching, times[k]);
                }
                state = hf_classify(p, threshold, limits[HOLDFAST_LIMIT_HYSTERESIS], d.state);
                if (raw[k] == HOLDFAST_UNSTABLE) {
                    state = HOLDFAST_UNSTABLE;
                }
                state = hf_hold(&d, state, limits[HOLDFAST_LIMIT_HOLD], times[k], period);
            }
            hf_debounce(&d, state, limits[HOLDFAST_LIMIT_MIN_DURATION], times[k], period);
        }
        out[k] = (int8_t)d.state;
    }
}
