/* Hold the kernel equal to the vectors of write_vectors.py: a program without Python.
 *
 *     cc -std=c99 -I src/holdfast/kernel tests/kernel/check_vectors.c -o check -lm && ./check
 *
 * With -DHOLDFAST_VECTORS_FIXED the sizes are macros, as in an exported header; with
 * -DHOLDFAST_SINGLE numbers are of single precision, and only reasons and faults are compared. */
#include "vectors.h"

#include <stdio.h>
#include <stdlib.h>

enum { N_FINGERS = 2, N_TAXELS = 9, N_VALUES = 6 };

static int n_wrong;
static uint32_t digest = 2166136261u; /* FNV-1a of all bits of all results */

static void add_to_digest(hf_real value)
{
    unsigned char bytes[sizeof value];
    memcpy(bytes, &value, sizeof value);
    for (size_t i = 0; i < sizeof value; ++i) {
        digest = (digest ^ (isnan(value) ? 255u : bytes[i])) * 16777619u;
    }
}

static void check(const char *name, size_t sample, double got, double expected, double tolerance)
{
    const double size = fabs(expected) > 1 ? fabs(expected) : 1;
    const bool is_close = fabs(got - expected) <= tolerance * size;
    if (!(is_close || got == expected || (isnan(got) && isnan(expected)))) {
        printf("sample %d: %s is %.17g, %.17g expected\n", (int)sample, name, got, expected);
        n_wrong += 1;
    }
}

static void check_numbers(const holdfast_memory *memory, size_t sample, const double *expected)
{
    const size_t width = HF_N_FEATURES(&hand);
    for (size_t i = 0; i < N_FINGERS * width; ++i) {
        add_to_digest(memory->features[i]);
        check("a feature", sample, (double)memory->features[i], *expected++, 1e-9);
    }
    for (size_t f = 0; f < N_FINGERS; ++f) {
        const holdfast_values *const v = &memory->values[f];
        const hf_real values[N_VALUES] = {v->force[0],  v->force[1], v->force[2],
                                          v->amplitude, v->m,        v->sigma};
        for (size_t i = 0; i < N_VALUES; ++i) {
            add_to_digest(values[i]);
            check("a value", sample, (double)values[i], *expected++, 1e-9);
        }
    }
}

static void run(holdfast_memory *memory)
{
    const double *row = samples;
    const double *expected = numbers;
    const long *status = statuses;
    for (size_t k = 0; k < N_SAMPLES; ++k) {
        const double time = *row++;
        bool present[N_FINGERS];
        hf_real readings[3 * N_TAXELS];
        for (size_t f = 0; f < N_FINGERS; ++f) {
            present[f] = *row++ > 0;
        }
        for (size_t i = 0; i < 3 * N_TAXELS; ++i) {
            readings[i] = (hf_real)*row++;
        }
        holdfast_advance(&hand, memory, readings, present, time);
        for (size_t f = 0; f < N_FINGERS; ++f, status += 3) {
            check("the reason", k, memory->values[f].reason, (double)status[0], 0);
            check("the faults", k, memory->values[f].faults, (double)status[1], 0);
            check("the taxels", k, (double)memory->values[f].taxels, (double)status[2], 0);
        }
        if (k % EVERY == 0 && sizeof(hf_real) == sizeof(double)) {
            check_numbers(memory, k, expected);
            expected += N_FINGERS * (HF_N_FEATURES(&hand) + N_VALUES);
        }
    }
}

int main(void)
{
    const char *const wrong = holdfast_check(&hand);
    if (wrong) {
        printf("the tables: %s\n", wrong);
        return 1;
    }
#ifdef HOLDFAST_N_FINGERS
    static holdfast_memory memory;
#else
    holdfast_memory memory;
    void *const block = malloc(holdfast_memory_size(&hand));
    if (!block) {
        return 1;
    }
    holdfast_place(&hand, &memory, block);
#endif
    for (int i = 0; i < 2; ++i) { /* the second time after a reset */
        holdfast_begin(&hand, &memory, NULL);
        run(&memory);
    }
#ifndef HOLDFAST_N_FINGERS
    free(block);
#endif
    printf("%d samples, %d wrong, digest %08x\n", (int)N_SAMPLES, n_wrong, (unsigned)digest);
    return n_wrong > 0;
}
