/* What the parts of the kernel share: a finger at a sample, and small functions on numbers. */
#ifndef HF_FINGER_H
#define HF_FINGER_H

#include "kernel.h"

/* A step in time of more sample periods is a gap, as in recordings (GAP_PERIODS). The part over 3
 * allows for rounding. */
#define HF_GAP_LIMIT_PERIODS ((hf_real)3.0003)
/* Longest gap that windows in seconds bridge: 0.1 s, with an allowance for rounding. */
#define HF_MAX_BRIDGED_SECONDS ((hf_real)0.10001)

/* Squares of features are of values of at most this many standard deviations: a moderate jolt of
 * the taxels is a slip, a larger one no stronger sign of it. */
#define HF_MAX_DEVIATION ((hf_real)5)

#define HF_SQRT_2 ((hf_real)1.4142135623730951)

/* One finger: its constants, and its part of the memory. Lanes of taxels count from its first. */
typedef struct {
    const holdfast_hand *hand;
    const holdfast_finger *finger;
    holdfast_finger_memory *state;
    const holdfast_finger_memory *fingers; /* of all */
    holdfast_values *values;
    size_t n_taxels;
    size_t n;                 /* lanes: n_taxels rounded up */
    const hf_real *used;      /* (n) 1 for taxels that contribute, else 0 */
    const hf_real *rotations; /* (9, n) */
    const hf_real *places;    /* (3, n) */
    hf_real *readings;        /* (3, n), as those that follow */
    hf_real *previous;
    hf_real *baseline;
    hf_real *reference;
    hf_real *changes;
    hf_real *pressed; /* (n) */
    hf_real *powers;  /* (2, n) */
    holdfast_taxel *taxels;
    holdfast_mask *masks;
    holdfast_ring *rings;
    hf_real *sums;
    hf_real *history;
    hf_real *blocks;
    holdfast_track *track;
    hf_real *taxel_forces; /* of the first sample in the ring */
    hf_real *relative;
    hf_real *averages;
} hf_finger;

static inline size_t hf_n_lanes(size_t n_taxels)
{
    return (n_taxels + HF_LANES - 1) / HF_LANES * HF_LANES;
}

/* Return the taxel forces of a finger (3, n) at a place of the ring. */
static inline hf_real *hf_forces_at(const hf_finger *f, size_t place)
{
    return f->taxel_forces + place * 3 * HF_N_LANES(f->hand);
}

/* The second number if it is larger, else the first: NaN stays only if it is the first. */
static inline hf_real hf_max(hf_real a, hf_real b)
{
    return b > a ? b : a;
}

/* The second number if it is smaller, else the first; NaN as above. */
static inline hf_real hf_min(hf_real a, hf_real b)
{
    return b < a ? b : a;
}

/* Return the bit of a taxel in a mask; 0 for a taxel that the mask cannot hold. */
static inline uint64_t hf_bit(size_t taxel)
{
    return taxel < HF_N_MASK_BITS ? (uint64_t)1 << taxel : 0;
}

static inline void hf_fill(hf_real *values, size_t n, hf_real value)
{
    for (size_t i = 0; i < n; ++i) {
        values[i] = value;
    }
}

/* Return |v|^2. */
static inline hf_real hf_square(const hf_real v[3])
{
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

static inline hf_real hf_dot(const hf_real a[3], const hf_real b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#include "lanes.h"

#endif
