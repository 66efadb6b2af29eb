/* Heads: linear functions of features and of their squares, and what heads make of them. */
#include "detector.h"

#include "finger.h"

/* Return output k of a head, without squares: w_k0 + sum_j w_kj phi_j, in the order of j. */
static hf_real hf_linear(
    const holdfast_head *head, const hf_real *weights, size_t k, const hf_real *phi)
{
    const hf_real *const w = weights + head->first + k * (head->n_features + 1);
    hf_real z = w[0];
    for (size_t j = 0; j < head->n_features; ++j) {
        z += w[j + 1] * phi[j];
    }
    return z;
}

/* Return the output of a head that has one, with its squares. */
static hf_real hf_head_value(const holdfast_head *head, const hf_real *weights, const hf_real *phi)
{
    hf_real z = hf_linear(head, weights, 0, phi);
    if (head->has_squares) {
        /* z + sum_j q_j min(|u_j|, 5)^2, u_j = (phi_j - mean_j) / scale_j. */
        const size_t n = head->n_features;
        const hf_real *const mean = weights + head->first + n + 1;
        for (size_t j = 0; j < n; ++j) {
            const hf_real u = hf_min(hf_abs((phi[j] - mean[j]) * mean[n + j]), HF_MAX_DEVIATION);
            z += mean[2 * n + j] * (u * u);
        }
    }
    return z;
}

static hf_real hf_probability(hf_real log_odds)
{
    return 1 / (1 + hf_exp(-log_odds));
}

/* Add the outputs of a sample to the sums. Return the cause with the largest sum. */
static int32_t hf_add_scores(
    const holdfast_head *head, const hf_real *weights, const hf_real *phi, hf_real *scores)
{
    size_t best = 0;
    for (size_t k = 0; k < head->n_outputs; ++k) {
        scores[k] += hf_linear(head, weights, k, phi);
        if (scores[k] > scores[best]) {
            best = k;
        }
    }
    return head->causes[best];
}

static void hf_forget_cause(holdfast_decision *d)
{
    d->cause = HOLDFAST_NO_CAUSE;
    hf_fill(d->scores, HOLDFAST_N_CAUSES, 0);
}

/* Return whether a state is held: half a period of tolerance, so that the rounding of times does
 * not move the end. False while `last` is NaN. */
static bool hf_is_held(double time, double last, hf_real hold, hf_real period)
{
    return (hf_real)(time - last) + period / 2 < hold;
}

/* Decide whether a finger slides, from the log odds z of its last sample. */
static void hf_decide_slip(
    const holdfast_head *head, holdfast_decision *d, hf_real z, double time, hf_real period)
{
    /* s(k) = s(k-1) + gain (z(k) - s(k-1)), p = 1 / (1 + exp(-s)). */
    d->slip_log_odds =
        isnan(d->slip_log_odds) ? z : d->slip_log_odds + head->gain * (z - d->slip_log_odds);
    d->slip_probability = hf_probability(d->slip_log_odds);
    /* It slides while p >= threshold, and until t - t_last reaches the hold time. A threshold of 1
     * is never reached, also not by a p that is rounded to 1. */
    d->slips = head->threshold < 1 && d->slip_probability >= head->threshold;
    if (d->slips) {
        d->last_slip = time;
    } else {
        d->slips = hf_is_held(time, d->last_slip, head->hold, period);
    }
}

/* Report speed and distance of the slip of a finger; both are 0 while it does not slide. */
static void hf_follow_slip(
    const holdfast_head *head, const hf_real *weights, const hf_real *phi, holdfast_decision *d,
    double time, hf_real period)
{
    if (!d->slips) {
        d->speed = d->distance = 0;
        d->slid_at = NAN;
        return;
    }
    /* v = min(max(z, 0)^2, highest), s = sum_k v(k) (t(k) - t(k-1)), the first step one period. */
    const hf_real root = hf_max(hf_head_value(head, weights, phi), 0);
    d->speed = hf_min(root * root, head->highest);
    if (isnan(d->slid_at)) {
        d->distance = d->speed * period;
    } else {
        d->distance += d->speed * (hf_real)(time - d->slid_at);
    }
    d->slid_at = time;
}

/* Report no slip, with a probability, speed and distance of 0 without contact, or NaN without an
 * estimate. */
static void hf_end_slip(const holdfast_rule *rule, holdfast_decision *d, hf_real probability)
{
    if (rule->heads[HOLDFAST_HEAD_SLIP].n_outputs > 0) {
        d->slips = false;
        d->slip_log_odds = HF_NAN;
        d->last_slip = NAN;
        d->slip_probability = probability;
    }
    if (rule->heads[HOLDFAST_HEAD_SPEED].n_outputs > 0) {
        d->speed = d->distance = probability;
        d->slid_at = NAN;
    }
}
