/* Whole arrays: the fingertip force of many samples, the paper's features of it, and states of
 * a finger with other limits.
 *
 * Rows are computed by themselves: a caller may cut an array into parts, in any order and in
 * several threads, and gets the same bits. The caller owns all memory; nothing is allocated.
 */
#ifndef HF_BATCH_H
#define HF_BATCH_H

#include <stddef.h>
#include <stdint.h>

enum { HOLDFAST_N_HAAR = 6 }; /* F_a, F_x, F_y, F_z, m, sigma */

/* The number of doubles that `holdfast_haar_features` needs as scratch memory. */
size_t holdfast_haar_scratch(size_t window);

/* Compute the paper's features at samples first <= k < stop.
 *
 * force: (stop or more, 3) F_tip [count or N].
 * window: N_w; even, at least 2.
 * out: (stop or more, 6); row k is NaN if the window that ends at sample k is not full or not
 *     finite.
 * scratch: is overwritten.
 */
void holdfast_haar_features(
    const double *force, size_t window, size_t first, size_t stop, double *out, double *scratch);

/* Compute F_tip = sum_i R_i (f_i - b_i) at n samples.
 *
 * readings: (n, n_taxels, 3) in taxel frames [count or N].
 * baseline: (n_taxels, 3) b_i, readings without contact.
 * rotations: (n_taxels, 3, 3) R_i, from the taxel frame to the fingertip frame.
 * force: (n, 3) in the fingertip frame; NaN where the force is not finite.
 */
void holdfast_fingertip_force(
    const double *readings, const double *baseline, const double *rotations, size_t n,
    size_t n_taxels, double *force);

/* Replace n log odds z by probabilities 1 / (1 + exp(-z)). */
void holdfast_logistic(double *values, size_t n);

/* Limits of `holdfast_replay`. */
enum {
    HOLDFAST_LIMIT_THRESHOLD = 0,
    HOLDFAST_LIMIT_HYSTERESIS = 1,
    HOLDFAST_LIMIT_HOLD = 2,         /* [s] */
    HOLDFAST_LIMIT_MIN_DURATION = 3, /* [s] */
    HOLDFAST_LIMIT_PERIOD = 4,       /* of the samples [s] */
    HOLDFAST_LIMIT_SWITCHING = 5,    /* of the forward filter [1/s]; 0 for none */
    HOLDFAST_N_LIMITS = 6
};

/* Decide the states of a finger by the steps of the detector.
 *
 * times, probability: (n) [s], of stability by each sample alone.
 * raw: (n) states without debouncing at the threshold 0: UNKNOWN, NO_CONTACT, STABLE, or UNSTABLE
 *     of a force that decides alone.
 * limits: (HOLDFAST_N_LIMITS).
 * out: (n) states.
 */
void holdfast_replay(
    const double *times, const double *probability, const int8_t *raw, size_t n,
    const double *limits, int8_t *out);

#endif
