/* The kernel once more, for processors with AVX2: it takes four numbers at a time, and gives the same
 * bits. module.c chooses. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#pragma GCC target("avx2")
#undef HF_API
#define HF_API static inline
#include "holdfast.c"

extern __typeof__(holdfast_advance) *const holdfast_advance_avx2;
extern __typeof__(holdfast_detect) *const holdfast_detect_avx2;
__typeof__(holdfast_advance) *const holdfast_advance_avx2 = holdfast_advance;
__typeof__(holdfast_detect) *const holdfast_detect_avx2 = holdfast_detect;
#else
typedef int nothing; /* a file of C declares something */
#endif
