/* Several taxels at a time: the order of sums over taxels, and numbers as wide as a register.
 *
 * Values of taxels stand in lanes (holdfast.h). Every sum over taxels has four parts: lane l adds up
 * taxels l, l + 4, l + 8, ..., and the total is (lane 0 + lane 1) + (lane 2 + lane 3). So all
 * compilers get the same bits. Lanes without a taxel, and ignored taxels, add 0.
 *
 * A loop takes HF_WIDTH of the lanes at a time: with GCC and Clang on x86 with SSE2 and on
 * 64-bit ARM 16 bytes, a vector register, at any level of optimisation, with AVX2 all four; else
 * one number:
 *
 *     for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
 *         hf_wide part = {0};
 *         for (size_t i = lane; i < n; i += HF_LANES) {
 *             part += hf_load(values + i);
 *         }
 *         hf_put(&sum, lane, part);
 *     }
 */
#ifndef HF_LANES_H
#define HF_LANES_H

#include "holdfast.h"

/* Return the second number if it is larger, else the first. NaN stays only if it is the first. */
static inline hf_real hf_max(hf_real a, hf_real b)
{
    return b > a ? b : a;
}

/* Return the second number if it is smaller, else the first. NaN stays only if it is the first. */
static inline hf_real hf_min(hf_real a, hf_real b)
{
    return b < a ? b : a;
}

#ifdef HOLDFAST_SINGLE
typedef int32_t hf_bits;
#define HF_SSE2(name) _mm_##name##_ps
#else
typedef int64_t hf_bits;
#ifdef __AVX2__
#define HF_VECTOR 32
#define HF_SSE2(name) _mm256_##name##_pd
#else
#define HF_SSE2(name) _mm_##name##_pd
#endif
#endif
#ifndef HF_VECTOR
#define HF_VECTOR 16 /* bytes */
#endif
#ifdef __SSE2__
#include <immintrin.h>
#endif

#if defined(__GNUC__) && (defined(__SSE2__) || defined(__aarch64__))
enum { HF_WIDTH = HF_VECTOR / sizeof(hf_real) };
typedef hf_real hf_wide __attribute__((vector_size(HF_VECTOR)));
/* The same in an array of numbers: compilers know that it aliases numbers alone. */
typedef hf_real hf_wide_in_memory
    __attribute__((vector_size(HF_VECTOR), aligned(sizeof(hf_real))));
typedef hf_bits hf_wide_bits __attribute__((vector_size(HF_VECTOR)));

/* Return b where a comparison holds, else a. */
static inline hf_wide hf_where(hf_wide_bits holds, hf_wide b, hf_wide a)
{
    return (hf_wide)(((hf_wide_bits)b & holds) | ((hf_wide_bits)a & ~holds));
}

static inline hf_wide hf_wide_abs(hf_wide a)
{
    const hf_wide zero = {0};
    return (hf_wide)((hf_wide_bits)a & ~(hf_wide_bits)-zero); /* without the bit of the sign */
}
#else
enum { HF_WIDTH = 1 };
typedef hf_real hf_wide;
typedef hf_real hf_wide_in_memory;

static inline hf_wide hf_where(bool holds, hf_wide b, hf_wide a)
{
    return holds ? b : a;
}

static inline hf_wide hf_wide_abs(hf_wide a)
{
    return hf_abs(a);
}
#endif

/* Return a where it is smaller, else b. SSE2 has an instruction, which not all compilers find. */
static inline hf_wide hf_smaller(hf_wide a, hf_wide b)
{
#ifdef __SSE2__
    return HF_SSE2(min)(a, b);
#else
    return hf_where(a < b, a, b);
#endif
}

/* Return a where it is larger, else b. */
static inline hf_wide hf_greater(hf_wide a, hf_wide b)
{
#ifdef __SSE2__
    return HF_SSE2(max)(a, b);
#else
    return hf_where(a > b, a, b);
#endif
}

typedef struct {
    hf_real lane[HF_LANES];
} hf_sum;

static inline hf_wide hf_load(const hf_real *values)
{
    return *(const hf_wide_in_memory *)values;
}

static inline void hf_store(hf_real *values, hf_wide a)
{
    *(hf_wide_in_memory *)values = a;
}

/* Return the square roots. */
static inline hf_wide hf_root(hf_wide a)
{
#ifdef __SSE2__
    return HF_SSE2(sqrt)(a);
#else
    hf_real values[HF_WIDTH];
    hf_store(values, a);
    for (size_t l = 0; l < HF_WIDTH; ++l) {
        values[l] = hf_sqrt(values[l]);
    }
    return hf_load(values);
#endif
}

/* Return whether all of these numbers are above 0. */
static inline bool hf_are_positive(hf_wide a)
{
    hf_real values[HF_WIDTH];
    bool are_positive = true;
    hf_store(values, a);
    for (size_t l = 0; l < HF_WIDTH; ++l) {
        are_positive &= values[l] > 0;
    }
    return are_positive;
}

/* Set as many parts of a sum as HF_WIDTH, from a lane on. */
static inline void hf_put(hf_sum *sum, size_t lane, hf_wide parts)
{
    hf_store(&sum->lane[lane], parts);
}

static inline void hf_add(hf_sum *sum, size_t taxel, hf_real value)
{
    sum->lane[taxel % HF_LANES] += value;
}

static inline hf_real hf_total(hf_sum sum)
{
    return (sum.lane[0] + sum.lane[1]) + (sum.lane[2] + sum.lane[3]);
}

/* Return the largest lane. */
static inline hf_real hf_largest_lane(hf_sum sum)
{
    return hf_max(hf_max(sum.lane[0], sum.lane[1]), hf_max(sum.lane[2], sum.lane[3]));
}

/* Vectors of some taxels: their x, y and z. */
typedef struct {
    hf_wide x, y, z;
} hf_vectors;

/* Return the vectors (3, n) from a lane on. */
static inline hf_vectors hf_load_vectors(const hf_real *values, size_t n, size_t i)
{
    const hf_vectors v = {
        hf_load(values + i), hf_load(values + n + i), hf_load(values + 2 * n + i)};
    return v;
}

static inline hf_vectors hf_minus(hf_vectors a, hf_vectors b)
{
    const hf_vectors v = {a.x - b.x, a.y - b.y, a.z - b.z};
    return v;
}

static inline hf_wide hf_squares(hf_vectors v)
{
    return v.x * v.x + v.y * v.y + v.z * v.z;
}

/* Return R_i v_i, with the rotations (9, n) from a lane on. */
static inline hf_vectors hf_turned(const hf_real *rotations, size_t n, size_t i, hf_vectors v)
{
    const hf_real *const r = rotations + i;
    const hf_vectors turned = {
        hf_load(r) * v.x + hf_load(r + n) * v.y + hf_load(r + 2 * n) * v.z,
        hf_load(r + 3 * n) * v.x + hf_load(r + 4 * n) * v.y + hf_load(r + 5 * n) * v.z,
        hf_load(r + 6 * n) * v.x + hf_load(r + 7 * n) * v.y + hf_load(r + 8 * n) * v.z};
    return turned;
}

#endif
