/* Hold the kernel and the detector equal to the vectors of write_vectors.py, without Python.
 *
 *     python tests/kernel/write_vectors.py > vectors.h
 *     cc -std=c99 -I src/holdfast/kernel -I . tests/kernel/check_vectors.c -o check -lm && ./check
 *
 * With -DHOLDFAST_VECTORS_LINKED the kernel is linked, its files compiled each by itself. With
 * -DHOLDFAST_VECTORS_FIXED the sizes are macros, as in an exported header; with
 * -DHOLDFAST_SINGLE numbers are of single precision, and only states, reasons and faults
 * are compared. */
#include "vectors.h"

#include <stdio.h>
#include <stdlib.h>

enum { N_FINGERS = 2, N_TAXELS = 9, IS_SINGLE = sizeof(hf_real) < sizeof(double) };

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

/* Check the numbers of a sample. Return what is expected of the next. */
static const double *check_numbers(
    const holdfast_detector_memory *d, const holdfast_finger_estimate *estimates, size_t sample,
    const double *expected)
{
    for (size_t f = 0; f < N_FINGERS; ++f) {
        const holdfast_finger_estimate *const e = &estimates[f];
        const hf_real values[] = {e->stable_probability, e->slip_probability, e->slip_speed,
                                  e->slip_distance,      e->instability,      e->force[0],
                                  e->force[1],           e->force[2]};
        for (size_t i = 0; i < sizeof values / sizeof *values; ++i) {
            add_to_digest(values[i]);
            check("a number", sample, (double)values[i], *expected++, 1e-9);
        }
    }
    for (size_t i = 0; i < N_FINGERS * HF_N_FEATURES(&hf_hand); ++i) {
        add_to_digest(d->memory.features[i]);
        check("a feature", sample, (double)d->memory.features[i], *expected++, 1e-9);
    }
    return expected;
}

static void run(holdfast_detector_memory *d)
{
    const double *row = samples;
    const double *expected = numbers;
    const long *code = codes;
    for (size_t k = 0; k < N_SAMPLES; ++k) {
        const double time = *row++;
        bool present[N_FINGERS];
        hf_real readings[3 * N_TAXELS];
        holdfast_finger_estimate estimates[N_FINGERS];
        for (size_t f = 0; f < N_FINGERS; ++f) {
            present[f] = *row++ > 0;
        }
        for (size_t i = 0; i < 3 * N_TAXELS; ++i) {
            readings[i] = (hf_real)*row++;
        }
        const int32_t hand = holdfast_detect(&hf_model, d, time, readings, present, estimates);
        check("the hand", k, hand, (double)*code++, 0);
        for (size_t f = 0; f < N_FINGERS; ++f) {
            const holdfast_finger_estimate *const e = &estimates[f];
            check("the state", k, e->state, (double)*code++, 0);
            check("the reason", k, e->reason, (double)*code++, 0);
            /* Two causes may be nearly equal: there single precision is not compared. */
            check("the cause", k, e->cause, (double)*code++, 6 * IS_SINGLE);
            check("the faults", k, e->faults, (double)*code++, 0);
            check("the taxels", k, (double)e->faulty_taxels[0], (double)*code++, 0);
        }
        if (k % EVERY == 0 && !IS_SINGLE) {
            expected = check_numbers(d, estimates, k, expected);
        }
    }
}

int main(void)
{
    const char *const wrong = holdfast_check_model(&hf_model);
    if (wrong) {
        printf("the tables: %s\n", wrong);
        return 1;
    }
#ifdef HOLDFAST_N_FINGERS
    static holdfast_detector_memory d;
#else
    holdfast_detector_memory d;
    void *const block = malloc(holdfast_detector_size(&hf_model));
    if (!block) {
        return 1;
    }
    holdfast_detector_use_memory(&hf_model, &d, block);
#endif
    for (int i = 0; i < 2; ++i) { /* the second time after a reset */
        holdfast_start(&hf_model, &d, NULL);
        run(&d);
    }
    hf_real baseline[3 * N_TAXELS];
    for (size_t f = 0; f < N_FINGERS; ++f) {
        if (!holdfast_baseline(&hf_model, &d, f, baseline + 3 * hf_fingers[f].first_taxel)) {
            printf("no tare of finger %d\n", (int)f);
            n_wrong += 1;
        }
    }
#ifndef HOLDFAST_N_FINGERS
    free(block);
#endif
    printf("%d samples, %d wrong, digest %08x\n", (int)N_SAMPLES, n_wrong, (unsigned)digest);
    return n_wrong > 0;
}
