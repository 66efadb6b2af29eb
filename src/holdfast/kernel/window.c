/* The Haar window of a stream: m and sigma of the last N_w values (equations 1 and 2).
 *
 * A window is cut into blocks of 1, 2, 4, ... pairs. The sums of a block come from its two halves,
 * so that overlapping windows share them, and no value is carried on for longer than a window. A
 * window of 7 pairs consists of blocks of 4, 2 and 1 pairs, the newest being last. The sums of a
 * block of n pairs are
 *
 *     P = sum (x_0 + x_1),  D = sum (x_0 - x_1),  S = sum (x_0 - x_1 - D / n)^2.
 *
 * Two blocks, of a and b pairs, give (Chan, Golub and LeVeque 1983; nothing cancels)
 *
 *     P = P_a + P_b,  D = D_a + D_b,  S = S_a + S_b + (b D_a - a D_b)^2 / (a b (a + b)).
 *
 * Memory: a ring of rows, one for each sample; in a row, for each channel and each size of blocks,
 * the sums of the block that ends with the sample. */
#include "finger.h"

/* Return the number of a block's sums in the ring: (n_history, n_channels, n_levels, 3). */
static inline hf_real *hf_block(const hf_finger *f, size_t row, size_t channel, size_t level)
{
    const size_t n_levels = HF_N_LEVELS(f->hand);
    const size_t n_channels = HF_N_CHANNELS(f->hand);
    return f->blocks + ((row * n_channels + channel) * n_levels + level) * HF_N_SUMS;
}

/* Append the blocks that end with a pair (x_0, x_1) = (older, newer) of a channel. */
static void hf_append_pair(const hf_finger *f, size_t channel, hf_real older, hf_real newer)
{
    const size_t row = f->state->row, length = HF_N_HISTORY(f->hand);
    hf_real *block = hf_block(f, row, channel, 0);
    block[0] = older + newer;
    block[1] = older - newer;
    block[2] = 0;
    size_t size = 1;
    hf_real share = (hf_real)0.5; /* 1 / (2 n), exactly */
    for (size_t level = 0; level + 1 < HF_N_LEVELS(f->hand); ++level) {
        /* Two equal halves: S = S_a + S_b + (D_a - D_b)^2 / (2 n). */
        const hf_real *const half =
            hf_block(f, hf_row_before(row, 2 * size, length), channel, level);
        hf_real *const joined = block + HF_N_SUMS;
        const hf_real apart = half[1] - block[1];
        joined[0] = half[0] + block[0];
        joined[1] = half[1] + block[1];
        joined[2] = half[2] + block[2] + apart * apart * share;
        block = joined;
        size *= 2;
        share /= 2;
    }
}

/* Return the moments of the newest window of a channel; the stretch must have as many samples. */
HF_SHARED hf_moments hf_newest_moments(const hf_finger *f, size_t channel, size_t window)
{
    const size_t n_pairs = window / 2, length = HF_N_HISTORY(f->hand);
    hf_real total = 0, drift = 0, spread = 0; /* P, D and S of the pairs taken, the newest first */
    size_t taken = 0, size = 1;
    for (size_t level = 0; taken < n_pairs; ++level, size *= 2) {
        if (n_pairs & size) { /* each one of N_w / 2 in binary is a block of so many pairs */
            const hf_real *const block =
                hf_block(f, hf_row_before(f->state->row, 2 * taken, length), channel, level);
            const hf_real apart = (hf_real)taken * block[1] - (hf_real)size * drift;
            const hf_real both = block[2] + spread;
            const hf_real share =
                taken ? (hf_real)1 / (hf_real)(size * taken * (size + taken)) : (hf_real)0;
            spread = both + apart * apart * share;
            total = block[0] + total;
            drift = block[1] + drift;
            taken += size;
        }
    }
    /* m = sum(a) / N_w = P / (sqrt(2) N_w) (equation 1).
     * sigma^2 = sum (d - mean d)^2 / N_w = S / (2 N_w) (equation 2). */
    const hf_real n_w = (hf_real)window;
    const hf_moments moments = {total * (1 / (HF_SQRT_2 * n_w)), spread * (1 / (2 * n_w))};
    return moments;
}

/* Return the sigma that noise of a standard deviation gives in a window. */
HF_SHARED hf_real hf_noise_sigma(hf_real noise, size_t window)
{
    /* E[sigma^2] of white noise: d = (x_0 - x_1) / sqrt(2) has the variance noise^2, and
     * sum (d - mean d)^2 over N_w / 2 pairs, divided by N_w, has (N_w / 2 - 1) / N_w of it. */
    const hf_real n_w = (hf_real)window;
    return noise * hf_sqrt((n_w - 2) / (2 * n_w));
}

/* Append a force to the history of a finger and to its windows, and write it to the values. */
HF_SHARED void hf_append_force(const hf_finger *f, const hf_real force[3])
{
    const size_t length = HF_N_HISTORY(f->hand);
    const size_t row = (size_t)(f->state->n_stretch % (int64_t)length);
    hf_real *const newest = f->history + row * HF_N_COMPONENTS;
    f->state->row = row;
    f->state->n_stretch += 1;
    newest[0] = f->values->amplitude = hf_sqrt(hf_square(force)); /* F_a = |F_tip| */
    for (size_t axis = 0; axis < 3; ++axis) {
        newest[1 + axis] = f->values->force[axis] = force[axis];
    }
    const hf_real *const older = hf_history(f, 1);
    for (size_t channel = 0; channel < HF_N_CHANNELS(f->hand); ++channel) {
        hf_append_pair(f, channel, older[channel], newest[channel]);
    }
}
