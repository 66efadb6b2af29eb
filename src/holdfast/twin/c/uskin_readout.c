/* Readout of a uSkin fingertip: silicone, magnets, temperature, noise and whole counts.
 *
 * uskin_readout.py has the parameters and their sources. */
#include "steps.h"

#define UINT16_LARGEST 65535.0

/* What a fingertip does not change: see `Taxels` and `_Constants` in Python. */
typedef struct {
    const mat *mixing;      /* (n_taxels) from a force to a reading by axis */
    const double *baseline; /* (n_taxels, 3) [count] */
    const double *thermal;  /* (n_taxels, 3) [count/K] */
    const double *noise;    /* (n_taxels) */
} taxels;

typedef struct {
    taxels taxels;
    const double *limits;        /* (3) [N] */
    const double *scales;        /* (3) [count/N] */
    const double *shares, *taus; /* (n_lags) */
    double prompt;
    const double *noise; /* (3) [count] */
    double scan;         /* [s] */
    int64_t line;
    double step; /* [count] */
    double spread, thermal_time;
} readout_constants;

/* State of a fingertip. */
typedef struct {
    vec *force;       /* (n_taxels) last forces [N] */
    vec *delayed;     /* (n_lags, n_taxels) delayed parts of the force [N] */
    double *numbers;  /* (3) time of the last sample [s], rate of warming [K/s], warmth [K] */
    vec *passed;      /* (n_taxels) after the silicone, at the last sample [N] */
    vec *passed_now;  /* (n_taxels) the same at this sample */
    double *readings; /* (n_averaged, n_taxels, 3) last readings [count] */
    int *n_read;      /* (n_taxels) number of readings so far */
    uint16_t *shown;  /* (n_taxels, 3) counts of the last sample */
    size_t n_taxels, n_lags, n_averaged;
} readout_state;

enum { TIME, RATE, WARMTH };

/* Return a reading that saturates at a limit: x / (1 + (x / limit)^4)^(1/4).
 *
 * With a limit of 7.35 N the slope falls to 85 % at 4.5 N and to 48 % at 7 N, where the data sheet
 * shows a change of slope. */
static double saturated(double newtons, double limit)
{
    const double ratio = newtons / limit, square = ratio * ratio;
    return newtons / sqrt(sqrt(1.0 + square * square));
}

/* Advance rate and temperature, an integrated random rate; the first step is 0. */
static void advance_warming(const readout_constants *c, double step, double drawn, double *numbers)
{
    const double keep = exp(-step / c->thermal_time);
    const double rate = keep * numbers[RATE] + sqrt(1 - keep * keep) * c->spread * drawn;
    numbers[WARMTH] += 0.5 * (numbers[RATE] + rate) * step;
    numbers[RATE] = rate;
}

/* Compute the forces after the silicone: the sum of a prompt part and low-pass parts.
 *
 * It is exact for forces that are linear between samples. Over a step h of a force from u to v:
 * y <- e y + (g - e) u + (1 - g) v, with e = exp(-h / tau) and g = (1 - e) tau / h. */
static void low_pass(const readout_constants *c, const vec *forces, double step, readout_state *s)
{
    for (size_t i = 0; i < s->n_taxels; ++i) {
        s->passed_now[i] = scaled(forces[i], c->prompt);
    }
    for (size_t lag = 0; lag < s->n_lags; ++lag) {
        const double ratio = step / c->taus[lag];
        const double keep = exp(-ratio);
        const double mean = ratio == 0.0 ? 1.0 : -expm1(-ratio) / ratio;
        vec *const delayed = &s->delayed[lag * s->n_taxels];
        for (size_t i = 0; i < s->n_taxels; ++i) {
            const vec moved = add(scaled(s->force[i], mean - keep), scaled(forces[i], 1 - mean));
            delayed[i] = add(scaled(delayed[i], keep), moved);
            s->passed_now[i] = add(s->passed_now[i], scaled(delayed[i], c->shares[lag]));
        }
    }
    for (size_t i = 0; i < s->n_taxels; ++i) {
        s->force[i] = forces[i];
    }
}

/* Return a reading as a multiple of a step, between 0 (for NaN too) and the largest number. */
static uint16_t whole(double value, double step)
{
    return (uint16_t)smaller(larger(0.0, rint(value / step) * step), UINT16_LARGEST);
}

/* Compute a reading: cross-talk and gain, range, baseline, temperature, noise [count]. */
static double reading(
    const readout_constants *c, vec force, size_t i, size_t axis, double warmth, double random)
{
    const taxels *const t = &c->taxels;
    const mat *const m = &t->mixing[i];
    const double newtons = dot(axis == 0 ? m->x : axis == 1 ? m->y : m->z, force);
    double value = saturated(newtons, c->limits[axis]) * c->scales[axis];
    value += t->baseline[3 * i + axis] + warmth * t->thermal[3 * i + axis];
    value += c->noise[axis] * t->noise[i] * random;
    return value;
}

/* Return when a taxel was read last, as a share of the step from the last packet to this.
 *
 * The taxels of a line are read one after the other, again and again: the i-th at the times
 * (k + (i mod n + 1/2) / n) scan, k = 0, 1, ..., with n taxels on a line. The result is at most 0
 * if there was none in this step. */
static double share_of_step(
    const readout_constants *c, const readout_state *s, size_t i, double time)
{
    const double before = s->numbers[TIME];
    if (c->scan == 0.0 || s->n_read[i] == 0 || time <= before) {
        return 1.0;
    }
    const double phase = ((double)(i % (size_t)c->line) + 0.5) / (double)c->line;
    const double last = (floor(time / c->scan - phase) + phase) * c->scan;
    return (last - before) / (time - before);
}

/* Read a taxel, and set the counts that it shows: the mean of its last readings, rounded. */
static void read_taxel(const readout_constants *c, size_t i, const double *drawn, readout_state *s)
{
    const size_t index = (size_t)s->n_read[i] % s->n_averaged;
    s->n_read[i] += s->n_read[i] < INT32_MAX;
    const size_t n_known =
        (size_t)s->n_read[i] < s->n_averaged ? (size_t)s->n_read[i] : s->n_averaged;
    for (size_t axis = 0; axis < 3; ++axis) {
        double *const kept = &s->readings[3 * i + axis];
        const size_t apart = 3 * s->n_taxels;
        kept[index * apart] =
            reading(c, s->passed[i], i, axis, s->numbers[WARMTH], drawn[3 * i + axis]);
        double sum = 0.0;
        for (size_t k = 0; k < n_known; ++k) {
            sum += kept[k * apart];
        }
        s->shown[3 * i + axis] = whole(sum / (double)n_known, c->step);
    }
}

/* Fill the counts of a packet whose taxels are all read when it is sent. */
static void fill_counts(
    const readout_constants *c, const double *drawn, const readout_state *s, uint16_t *out)
{
    for (size_t i = 0; i < s->n_taxels; ++i) {
        for (size_t axis = 0; axis < 3; ++axis) {
            const size_t at = 3 * i + axis;
            const double value =
                reading(c, s->passed_now[i], i, axis, s->numbers[WARMTH], drawn[at]);
            out[at] = whole(value, c->step);
        }
    }
}

/* Fill the counts of a packet whose taxels are read in turn, or averaged.
 *
 * A taxel that was not read since the last packet shows the same counts again. Between two packets
 * forces are linear. */
static void fill_last_counts(
    const readout_constants *c, double time, const double *drawn, readout_state *s, uint16_t *out)
{
    for (size_t i = 0; i < s->n_taxels; ++i) {
        const double share = share_of_step(c, s, i, time);
        if (share > 0.0) {
            const vec before = s->passed[i];
            s->passed[i] = add(before, scaled(subtract(s->passed_now[i], before), share));
            read_taxel(c, i, drawn, s);
        }
        for (size_t axis = 0; axis < 3; ++axis) {
            out[3 * i + axis] = s->shown[3 * i + axis];
        }
        s->passed[i] = s->passed_now[i];
    }
}

/* Fill the counts of n samples, (n, n_taxels, 3), and advance the state.
 *
 * `forces` are (n, n_taxels) [N], `drawn` (n, 1 + 3 n_taxels) normal random numbers: of the
 * warming, of the readings. */
static void read_out(
    const vec *forces, const double *times, const double *drawn, size_t n,
    const readout_constants *c, readout_state *s, uint16_t *out)
{
    const bool at_once = c->scan == 0.0 && s->n_averaged == 1;
    for (size_t k = 0; k < n; ++k) {
        const double step = times[k] - s->numbers[TIME];
        const double *const random = &drawn[k * (1 + 3 * s->n_taxels)];
        uint16_t *const counts = &out[k * 3 * s->n_taxels];
        advance_warming(c, step, random[0], s->numbers);
        low_pass(c, &forces[k * s->n_taxels], step, s);
        if (at_once) {
            fill_counts(c, random + 1, s, counts);
        } else {
            fill_last_counts(c, times[k], random + 1, s, counts);
        }
        s->numbers[TIME] = times[k];
    }
}
