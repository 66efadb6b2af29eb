/* The tare: a baseline of each taxel taken without contact, then frozen; and the noise. */
#include "finger.h"

/* Measure the noise of a component of the force by the steps from sample to sample. */
static void hf_measure_noise(const hf_finger *f, bool complete)
{
    /* A step has the noise of two samples, in three components, sixfold the variance:
     * noise = max(sqrt(sum |F(k) - F(k-1)|^2 / (6 n)), noise of the rounding). */
    holdfast_finger_memory *const s = f->state;
    if (complete) {
        const hf_real n_steps = hf_max((hf_real)s->n_steps, 1);
        s->noise = hf_max(hf_sqrt(s->squared_steps / (6 * n_steps)), f->finger->min_noise);
    } else if (s->n_seen > 1) {
        hf_real step[3]; /* sum_i R_i (f_i(k) - f_i(k-1)) */
        hf_sum_taxels(f, f->previous, step);
        s->squared_steps += hf_square(step);
        s->n_steps += 1;
    }
}

/* Add a sample to the baseline of a finger, or freeze it. */
static void hf_update_baseline(const hf_finger *f, bool running)
{
    /* b_i = (1 / n) sum_k f_i(k) over the time of the tare; of the first sample alone: n = 1. */
    holdfast_finger_memory *const s = f->state;
    const int32_t kind = f->hand->tare_kind;
    const hf_real n_taken = hf_max((hf_real)s->n_tared, 1);
    for (size_t i = 0; i < 3 * f->n; ++i) {
        if (kind == HOLDFAST_TARE_FIRST) {
            f->baseline[i] = f->readings[i];
        } else if (kind == HOLDFAST_TARE_SECONDS && running) {
            f->baseline[i] += f->readings[i];
        } else if (kind == HOLDFAST_TARE_SECONDS) {
            f->baseline[i] /= n_taken;
        }
    }
    if (kind == HOLDFAST_TARE_SECONDS && running) {
        s->n_tared += 1;
    } else {
        s->is_tared = true;
    }
}

/* Add a sample to the noise and to the tare, and keep it as the previous one. Return whether the
 * tare is complete. */
HF_SHARED bool hf_update_tare(const hf_finger *f, hf_real elapsed)
{
    holdfast_finger_memory *const s = f->state;
    if (isnan(s->noise)) {
        hf_measure_noise(f, elapsed >= f->hand->noise_seconds);
    }
    /* Here, because field and masks change the readings later: the previous ones are raw. */
    memcpy(f->previous, f->readings, 3 * f->n * sizeof(hf_real));
    if (!s->is_tared) {
        s->n_refused = 0;
        /* One sample at least. */
        hf_update_baseline(f, elapsed < f->hand->tare_seconds || s->n_tared == 0);
    }
    return s->is_tared;
}
