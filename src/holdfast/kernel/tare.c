/* The tare: a baseline of each taxel taken without contact, then frozen; and the noise.
 *
 * The first samples of a stream may be no readings: what a driver had in its memory, or the output
 * of its filter, which rises from zero. The stream then begins again with a later sample. */
#include "finger.h"

/* Time from the first sample in which the stream may begin again [s]. */
#define HF_PROVISIONAL_SECONDS 0.5
/* The first sample is no reading if the next differs from it by this many times as much as from the
 * one after. Noise does so in 1 of 100 streams of one taxel,
 * where it does no harm. */
#define HF_LEFT_RATIO ((hf_real)5)
/* Tolerances of a filter that rises from zero: of its shrinking steps, and of their direction. */
#define HF_STEP_TOLERANCE ((hf_real)1.5)
#define HF_LEAST_COLLINEAR ((hf_real)0.95)

/* Begin again, as if no sample had been processed before. */
HF_SHARED void hf_begin_again(const hf_finger *f, double time)
{
    holdfast_finger_memory *const s = f->state;
    memset(s, 0, sizeof *s);
    memset(f->taxels, 0, f->n * sizeof *f->taxels);
    memset(f->masks, 0, f->n * sizeof *f->masks);
    hf_fill(f->baseline, 3 * f->n, 0);
    hf_fill(f->reference, 3 * f->n, 0);
    hf_fill(f->changes, 3 * f->n, 0);
    hf_fill(f->moved, 3 * f->n, 0);
    hf_fill(f->powers, 2 * f->n, 0);
    hf_begin_finger(f);
    s->last_time = time;
    s->provisional_end = time + HF_PROVISIONAL_SECONDS;
    s->is_alive = true;
}

/* Return |f(k) - f(k-1)|^2 over all taxels of a finger, and |f(k)|^2 of both samples. */
static hf_real hf_step_square(const hf_finger *f, hf_real *now, hf_real *before)
{
    hf_real step = 0;
    *now = *before = 0;
    for (size_t i = 0; i < 3 * f->n; ++i) {
        const hf_real change = f->readings[i] - f->previous[i];
        step += change * change;
        *now += f->readings[i] * f->readings[i];
        *before += f->previous[i] * f->previous[i];
    }
    return step;
}

/* Return whether the first three readings are those of a filter of the first order from zero. */
static bool hf_is_settling(const hf_finger *f, hf_real step, hf_real size)
{
    /* f(k) = (1 - r^k) f: of x = |f(0)|, d = |f(1) - f(0)| and e = |f(2) - f(1)|, each is r times
     * the one before, so that e <= d and x e <= d^2; and all point where f(2) points. */
    const hf_real x = f->state->first_size, d = f->state->first_step;
    return step <= HF_STEP_TOLERANCE * d && x * step <= HF_STEP_TOLERANCE * d * d &&
           size >= HF_LEAST_COLLINEAR * (x + d + step) && hf_are_moving(f);
}

/* Begin again while the first samples are no readings, and for 0.5 s at most.
 *
 * All readings are finite. A motion is no jump of one sample, and begins far from zero or grows; so
 * a stream that begins in contact stays as it is. */
HF_SHARED void hf_confirm_zero(const hf_finger *f, double time)
{
    holdfast_finger_memory *const s = f->state;
    const double end = s->n_seen > 0 ? s->provisional_end : time + HF_PROVISIONAL_SECONDS;
    hf_real now, before;
    const hf_real step = hf_sqrt(hf_step_square(f, &now, &before));
    s->provisional_end = end;
    if (s->n_seen == 0) {
        const int32_t kind = f->hand->tare_kind;
        const bool takes_samples = kind == HOLDFAST_TARE_SECONDS || kind == HOLDFAST_TARE_FIRST;
        s->zero = takes_samples && !(f->finger->rests_at_zero && now == 0) ? HF_PROVISIONAL
                                                                         : HF_CONFIRMED;
        return;
    }
    const bool is_late = time > end;
    if (s->zero == HF_PROVISIONAL && !is_late && (s->first_step == 0 || step == 0)) {
        if (step > 0) {
            s->first_step = step;
            s->first_size = hf_sqrt(before);
        }
        return; /* a reading that is sent twice shows nothing */
    }
    /* Left: d > 5 max(e, that of rounding), which is that of two samples in three components. */
    const hf_real least = hf_max(step, hf_sqrt(6) * f->finger->min_noise);
    const bool is_left = s->first_step > HF_LEFT_RATIO * least;
    const bool settles =
        !(is_left || is_late) && (s->zero == HF_SETTLES || hf_is_settling(f, step, hf_sqrt(now)));
    if (is_left || settles) {
        hf_begin_again(f, time);
        s->provisional_end = end;
        s->zero = settles ? HF_SETTLES : HF_PROVISIONAL;
    } else {
        s->zero = HF_CONFIRMED;
    }
}

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
