/* The Haar window of whole arrays: m and sigma of every window (equations 1 and 2 of the paper).
 *
 * A window is cut into blocks of 1, 2, 4, ... pairs. The sums of a block come from its two halves,
 * so that overlapping windows share them; each belongs to its own samples only, and no value is
 * carried on. A window of 7 pairs consists of blocks of 4, 2 and 1 pairs, the newest being last.
 * The sums of a block are P = sum (x_0 + x_1), D = sum (x_0 - x_1), and the sum of squares
 * S = sum (x_0 - x_1 - D / n)^2 over its n pairs. Two blocks, of a and b pairs, give
 *
 *     P = P_a + P_b,    D = D_a + D_b,    S = S_a + S_b + (b D_a - a D_b)^2 / (a b (a + b))
 *
 * (Chan, Golub and LeVeque 1983), in which nothing cancels.
 *
 * Loops run over the windows that end at successive samples, and each fills one array or two: a
 * compiler computes several windows at a time. `restrict` says that these arrays are apart.
 *
 * window.c has the same sums in the same order for a stream, so both have the same bits.
 */
#include "batch.h"

#include <math.h>

enum {
    BLOCK_SAMPLES = 384, /* computed at a time: their scratch memory stays in the L1 cache */
    CACHE_LINE = 8       /* doubles; rows begin at a multiple, so that no vector lies in two */
};

/* gcc compiles a function and all that it calls twice, and the processor chooses at run time: with
 * vectors of 4 doubles, or of 2. The bits are the same. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__GLIBC__)
#define FOR_EACH_PROCESSOR __attribute__((target_clones("avx2", "default"), flatten))
#else
#define FOR_EACH_PROCESSOR
#endif

/* Sums of the blocks of one size, or of the newer pairs of each window. */
typedef struct {
    double *p, *d, *s;
} sums;

static size_t row_length(size_t window)
{
    return (BLOCK_SAMPLES + window - 1 + CACHE_LINE - 1) / CACHE_LINE * CACHE_LINE;
}

size_t holdfast_haar_scratch(size_t window)
{
    return 10 * row_length(window); /* the rows of `features_of_block` */
}

static void copy(const double *restrict values, double *restrict copied, size_t n)
{
    for (size_t k = 0; k < n; ++k) {
        copied[k] = values[k];
    }
}

static void fill(double *values, double value, size_t n)
{
    for (size_t k = 0; k < n; ++k) {
        values[k] = value;
    }
}

/* 1 / (a b (a + b)) of two blocks of a and b pairs; 0 if there is nothing to join with. */
static double join_factor(size_t a, size_t b)
{
    return b ? 1.0 / (double)(a * b * (a + b)) : 0.0;
}

/* Compute F_a = |F_tip| of n samples. */
static void amplitudes(const double *restrict force, double *restrict amplitude, size_t n)
{
    for (size_t k = 0; k < n; ++k, force += 3) {
        amplitude[k] = sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2]);
    }
}

/* Compute F_a of n samples, and write it and the force to their rows.
 *
 * The rows are written while the square roots are computed: the processor waits for both. */
static void write_forces(
    const double *restrict force, double *restrict amplitude, double *restrict rows, size_t n)
{
    for (size_t k = 0; k < n; ++k, force += 3, rows += HOLDFAST_N_HAAR) {
        const double x = force[0], y = force[1], z = force[2];
        amplitude[k] = sqrt(x * x + y * y + z * z);
        rows[0] = amplitude[k];
        rows[1] = x;
        rows[2] = y;
        rows[3] = z;
    }
}

/* Compute the sums of the pair that begins at each sample: x_0 + x_1, x_0 - x_1 and 0. */
static void pairs(const double *restrict x, const sums *blocks, size_t n)
{
    double *restrict p = blocks->p, *restrict d = blocks->d, *restrict s = blocks->s;
    for (size_t k = 0; k < n; ++k) {
        p[k] = x[k] + x[k + 1];
        d[k] = x[k] - x[k + 1];
        s[k] = 0.0;
    }
}

/* Add the sums of older blocks, of n_older pairs, to those of the newer pairs of each window. */
static void join(const sums *older, size_t n_older, const sums *newer, size_t n_newer, size_t n)
{
    /* S = S_a + S_b + (b D_a - a D_b)^2 / (a b (a + b)), P = P_a + P_b, D = D_a + D_b. */
    const double a = (double)n_older, b = (double)n_newer, factor = join_factor(n_older, n_newer);
    const double *restrict older_p = older->p, *restrict older_d = older->d;
    const double *restrict older_s = older->s;
    double *restrict p = newer->p, *restrict d = newer->d, *restrict s = newer->s;
    for (size_t k = 0; k < n; ++k) {
        const double apart = b * older_d[k] - a * d[k];
        s[k] = older_s[k] + s[k] + apart * apart * factor;
        p[k] = older_p[k] + p[k];
        d[k] = older_d[k] + d[k];
    }
}

/* Compute the sums of blocks of two equal halves; the newer half is `step` samples later. */
static void double_blocks(const sums *half, size_t size, const sums *whole, size_t n)
{
    const size_t step = 2 * size;
    const double *restrict p = half->p, *restrict d = half->d, *restrict s = half->s;
    double *restrict next_p = whole->p, *restrict next_d = whole->d, *restrict next_s = whole->s;
    if (size == 1) { /* pairs, whose own S is 0: (D_a - D_b)^2 / 2 */
        for (size_t k = 0; k < n; ++k) {
            const double apart = d[k] - d[k + step];
            next_s[k] = apart * apart * 0.5;
        }
    } else { /* (n D_a - n D_b)^2 / (2 n^3) = (D_a - D_b)^2 / (2 n) */
        const double factor = 0.5 / (double)size;
        for (size_t k = 0; k < n; ++k) {
            const double apart = d[k] - d[k + step];
            next_s[k] = s[k] + s[k + step] + apart * apart * factor;
        }
    }
    for (size_t k = 0; k < n; ++k) {
        next_p[k] = p[k] + p[k + step];
        next_d[k] = d[k] + d[k + step];
    }
}

/* Compute m and sigma of each window from the sums of its oldest block and its newer pairs.
 *
 * older: sums of the oldest block, of n_older pairs.
 * newer: sums of the other pairs; its p and s become m and sigma.
 */
static void moments(const sums *older, size_t n_older, const sums *newer, size_t n_newer, size_t n)
{
    /* The last step of `join`, then
     * m = sum(a) / N_w = P / (sqrt(2) N_w) (equation 1) and
     * sigma = sqrt(sum (d - mean d)^2 / N_w) = sqrt(S / (2 N_w)) (equation 2). */
    const double window = 2.0 * (double)(n_older + n_newer);
    const double m_factor = 1.0 / (sqrt(2.0) * window), sigma_factor = 0.5 / window;
    const double a = (double)n_older, b = (double)n_newer, factor = join_factor(n_older, n_newer);
    const double *restrict older_p = older->p, *restrict older_d = older->d;
    const double *restrict older_s = older->s, *restrict d = newer->d;
    double *restrict p = newer->p, *restrict s = newer->s;
    for (size_t k = 0; k < n; ++k) {
        const double apart = b * older_d[k] - a * d[k];
        p[k] = (older_p[k] + p[k]) * m_factor;
        s[k] = sqrt((older_s[k] + s[k] + apart * apart * factor) * sigma_factor);
    }
}

/* Write m and sigma to n rows; a row whose window has a value that is not finite becomes NaN. */
static void write_moments(
    const double *restrict m, const double *restrict sigma, double *restrict rows, size_t n)
{
    for (size_t k = 0; k < n; ++k, rows += HOLDFAST_N_HAAR) {
        rows[4] = m[k];
        rows[5] = sigma[k];
        if (!isfinite(m[k] + sigma[k])) {
            fill(rows, (double)NAN, HOLDFAST_N_HAAR);
        }
    }
}

/* Fill n rows, at most BLOCK_SAMPLES, from the n + window - 1 forces of their windows. */
FOR_EACH_PROCESSOR
static void features_of_block(
    const double *force, size_t window, size_t n, double *rows, double *scratch)
{
    const size_t n_pairs = window / 2, n_before = window - 1, row = row_length(window);
    double *const amplitude = scratch;
    sums blocks = {scratch + row, scratch + 2 * row, scratch + 3 * row};
    sums next = {scratch + 4 * row, scratch + 5 * row, scratch + 6 * row};
    const sums newer = {scratch + 7 * row, scratch + 8 * row, scratch + 9 * row};
    size_t length = n + n_before - 1; /* number of blocks of the present size */
    size_t taken = 0, size = 1;       /* pairs in `newer`, and in a block */
    amplitudes(force, amplitude, n_before);
    write_forces(force + 3 * n_before, amplitude + n_before, rows, n);
    pairs(amplitude, &blocks, length);
    for (;; size *= 2) {
        /* N_w / 2 in binary: each of its ones is a block of so many pairs, the newest first. */
        if (n_pairs & size) {
            const size_t start = 2 * (n_pairs - taken - size);
            const sums older = {blocks.p + start, blocks.d + start, blocks.s + start};
            if (taken + size == n_pairs) {
                if (taken == 0) {
                    fill(newer.p, 0.0, 3 * row); /* p, d and s */
                }
                moments(&older, size, &newer, taken, n);
                break;
            }
            if (taken == 0) {
                copy(older.p, newer.p, n);
                copy(older.d, newer.d, n);
                copy(older.s, newer.s, n);
            } else {
                join(&older, size, &newer, taken, n);
            }
            taken += size;
        }
        length -= 2 * size;
        double_blocks(&blocks, size, &next, length);
        const sums swapped = blocks;
        blocks = next;
        next = swapped;
    }
    write_moments(newer.p, newer.s, rows, n);
}

void holdfast_haar_features(
    const double *force, size_t window, size_t first, size_t stop, double *out, double *scratch)
{
    for (; first < stop && first < window - 1; ++first) {
        fill(out + HOLDFAST_N_HAAR * first, (double)NAN, HOLDFAST_N_HAAR);
    }
    while (first < stop) {
        const size_t n = stop - first < BLOCK_SAMPLES ? stop - first : BLOCK_SAMPLES;
        features_of_block(
            force + 3 * (first - (window - 1)), window, n, out + HOLDFAST_N_HAAR * first, scratch);
        first += n;
    }
}
