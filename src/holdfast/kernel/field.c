/* Magnetic fields: a hand that turns in the field of the earth changes what its magnetometers read.
 *
 * A field changes all readings of a module by the same vector: in the fingertip frame, or in the
 * taxel frames, for drivers that turn the readings of all chips alike. A load differs from taxel to
 * taxel. So the part that is common to all taxels is a field where nothing else differs; it is
 * taken out of the readings, and stays out while a load hides it. docs/sensors.md says what is
 * lost.
 *
 * The modules of a hand are in one field. How they lie to each other is not known, as fingers move;
 * but while the hand turns, the field changes equally fast for all of them. So where a change may
 * be a field or a load, or a load hides the field, an open module decides: it is the field that
 * changes if both change equally fast. */
#include "finger.h"

/* Share by which the gains of magnetometers differ, and what they read of a field. */
#define HF_FIELD_TOLERANCE ((hf_real)0.1)
/* Share by which taxels differ, as a root mean square, from which on it is a load. Between both it
 * may be either. */
#define HF_LOAD_SHARE ((hf_real)0.25)
/* A field, and its motion, count from this many times the noise of a component of the force: less
 * than any contact does. */
#define HF_FIELD_TO_NOISE ((hf_real)4)
/* Factor on that for the first field of a sensor whose unit is not known: a skin that warms changes
 * all readings alike, too. */
#define HF_FIRST_FIELD ((hf_real)4)
/* A field moves from this many times the least motion on. */
#define HF_MOVES ((hf_real)1.5)
/* Factor of the squared noise of taxels: twice what is expected, as the tare has noise, too. */
#define HF_FIELD_MARGIN ((hf_real)4)
/* Factor by which the speeds of the field differ between modules: gains, and their noise. */
#define HF_SPEED_TOLERANCE ((hf_real)1.25)
/* The speed of a field counts from this many times its noise on, as a root mean square. */
#define HF_SPEED_TO_NOISE ((hf_real)6)
/* Share of a change that is normal in a press; a field has any direction. */
#define HF_PRESSED_SHARE ((hf_real)0.7)
/* Under a load that differs from a field by this factor of its square, only each fourth sample is
 * compared: it takes time, and a load goes slower. */
#define HF_DEEP_LOAD ((hf_real)16)
#define HF_SKIPPED_SAMPLES 3
/* Time for which it must be unclear whether a change is a field or a load [s]. */
#define HF_UNCLEAR_SECONDS ((hf_real)0.1)
/* Time constants over which the common part, and then its speed, are smoothed [s]. */
#define HF_COMMON_SECONDS ((hf_real)0.05)
#define HF_SPEED_SECONDS ((hf_real)0.1)
/* A field changes within a second by at most this many times its largest value: a third of a second
 * for half a turn of the hand. */
#define HF_FIELD_SPEED ((hf_real)3)

/* What the taxels of a finger have in common, beyond the tare. */
typedef struct {
    hf_real n;           /* taxels */
    hf_real means[6];    /* in the taxel frames, and in the fingertip frame */
    bool is_turned;      /* more is common in the fingertip frame */
    hf_real differences; /* sum of the squared distances of the taxels from the mean */
} hf_common;

/* Return what the taxels have in common that are neither faulty nor masked. */
static hf_common hf_find_common(const hf_finger *f)
{
    /* h_i = f_i - b_i: sum h_i, sum R_i h_i, sum |h_i|^2. */
    const size_t n = f->n;
    hf_sum parts[7];
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        const hf_wide zero = {0};
        hf_vectors plain = {zero, zero, zero}, turned = plain;
        hf_wide squares = zero;
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_vectors h =
                hf_minus(hf_load_vectors(f->readings, n, i), hf_load_vectors(f->baseline, n, i));
            const hf_vectors g = hf_turned(f->rotations, n, i, h);
            const hf_wide used = hf_load(f->used + i);
            plain.x += used * h.x;
            plain.y += used * h.y;
            plain.z += used * h.z;
            turned.x += g.x;
            turned.y += g.y;
            turned.z += g.z;
            squares += used * hf_squares(h);
        }
        const hf_wide all[7] = {plain.x, plain.y, plain.z, turned.x, turned.y, turned.z, squares};
        for (size_t k = 0; k < 7; ++k) {
            hf_put(&parts[k], lane, all[k]);
        }
    }
    hf_real sums[7];
    for (size_t k = 0; k < 7; ++k) {
        sums[k] = hf_total(parts[k]);
    }
    hf_common common = {f->finger->n_used, {0, 0, 0, 0, 0, 0}, false, 0};
    const holdfast_taxel_set *const faulty = &f->values->taxels, *const masked = &f->state->masked;
    const bool has_left_out = f->values->faults || f->state->has_masked;
    for (size_t i = 0; has_left_out && i < f->n_taxels; ++i) {
        if ((hf_has(faulty, i) || hf_has(masked, i)) && f->used[i] > 0) {
            hf_real h[3];
            for (size_t axis = 0; axis < 3; ++axis) {
                h[axis] = f->readings[axis * n + i] - f->baseline[axis * n + i];
                sums[axis] -= h[axis];
            }
            for (size_t axis = 0; axis < 3; ++axis) {
                const hf_real *const turn = f->rotations + 3 * axis * n + i;
                sums[3 + axis] -= turn[0] * h[0] + turn[n] * h[1] + turn[2 * n] * h[2];
            }
            sums[6] -= hf_square(h);
            common.n -= 1;
        }
    }
    /* sum |h_i - mean|^2 = sum |h_i|^2 - |sum h_i|^2 / n. Rounding decides nothing: 1 %. */
    common.is_turned = hf_square(sums + 3) > (hf_real)1.01 * hf_square(sums);
    const hf_real share = 1 / hf_max(common.n, 1);
    for (size_t k = 0; k < 6; ++k) {
        common.means[k] = share * sums[k];
    }
    const hf_real square = hf_square(common.is_turned ? sums + 3 : sums);
    common.differences = hf_max(sums[6] - share * square, 0);
    return common;
}

/* Return the part of a common change that is along the normal: above 0, it presses. */
static hf_real hf_normal_part(const hf_finger *f, const hf_common *common, const hf_real change[3])
{
    return common->is_turned ? hf_dot(change, f->finger->normal) : change[2];
}

/* Return whether a common change is along the normal, as that of a press. */
static bool hf_is_press(const hf_finger *f, const hf_common *common, const hf_real change[3])
{
    const hf_real along = hf_normal_part(f, common, change);
    /* Where the unit is not known, a press of the tare that goes, too. */
    return (along > 0 || isinf(f->finger->max_field)) &&
           along * along >= HF_PRESSED_SHARE * HF_PRESSED_SHARE * hf_square(change);
}

/* Return whether the square of the speed of another module's field is between two numbers. */
static bool hf_another_turns(const hf_finger *f, hf_real low, hf_real high)
{
    for (size_t i = 0; i < HF_N_FINGERS(f->hand); ++i) {
        const holdfast_finger_memory *const other = &f->fingers[i];
        const bool is_present = f->state->last_time - other->last_time <= HF_MAX_BRIDGED_SECONDS;
        const bool is_between = low <= other->field_speed && other->field_speed <= high;
        if (other != f->state && other->field_speed > 0 && is_present && is_between) {
            return true;
        }
    }
    return false;
}

/* Return whether what the taxels have in common moves as fast in a frame as another's field. */
static bool hf_fits_another(const hf_finger *f, bool is_turned)
{
    const hf_real speed = hf_square(f->state->speed + (is_turned ? 3 : 0));
    const hf_real factor = HF_SPEED_TOLERANCE * HF_SPEED_TOLERANCE;
    return hf_another_turns(f, speed / factor, speed * factor);
}

/* Update the field of a finger by what its taxels have in common. Return whether it may be either
 * a field or a load. */
static bool hf_update_field(const hf_finger *f, const hf_common *common)
{
    /* The checks, in this order: too few taxels to compare; no change above the noise; a press,
     * which is a load; an open module that turns as fast, which makes it a field after all; taxels
     * that differ; a field that is too strong. What is left is a field. */
    holdfast_finger_memory *const s = f->state;
    if (common->n < HF_MIN_TAXELS) { /* all may be loaded alike */
        s->is_deep = false;
        return false;
    }
    const hf_real most = f->finger->max_field;
    const bool is_known = !isinf(most), is_first = !(hf_square(s->field) > 0);
    const bool same_frame = common->is_turned == s->field_is_turned;
    const size_t frame = common->is_turned ? 3 : 0;
    const hf_real *const mean = common->means + frame;
    /* c(k) = c(k-1) + (T / tau) (mean(k) - c(k-1)), and its speed likewise. */
    const hf_real elapsed = f->hand->period * (hf_real)(s->n_skipped + 1);
    const hf_real gain = hf_min(1, elapsed / HF_COMMON_SECONDS);
    const hf_real speed_gain = hf_min(1, elapsed / HF_SPEED_SECONDS), per_second = 1 / elapsed;
    hf_real motions[6], steps[6], change[3];
    for (size_t k = 0; k < 6; ++k) {
        motions[k] = common->means[k] - s->common[k];
        steps[k] = gain * motions[k];
        s->common[k] += steps[k];
        s->speed[k] += speed_gain * (steps[k] * per_second - s->speed[k]);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
        change[axis] = mean[axis] - (same_frame ? s->field[axis] : 0);
    }
    /* n |v| > 4 noise: F of that vector is above the noise of F. The first field of a sensor whose
     * unit is not known has four times that: what is less may be a skin that warms. */
    const hf_real to_noise = HF_FIELD_TO_NOISE * (!is_known && is_first ? HF_FIRST_FIELD : 1);
    const hf_real noise = to_noise * s->noise / common->n, least = noise * noise;
    const hf_real moved = hf_square(motions + frame), square = hf_square(change);
    if (moved <= least) {
        memcpy(s->still_field, s->field, sizeof s->field);
    }
    /* Untouched: sum |h_i - mean|^2 <= 4 times that of noise, and the mean is the field's, or
     * pulls, which no contact does. A drift of all taxels adds up in the force: what they have in
     * common has the limit of the force. */
    const hf_real of_noise = HF_FIELD_MARGIN * 3 * (s->noise * s->noise);
    const bool is_pull = hf_normal_part(f, common, change) < 0;
    s->is_untouched = (square <= least || is_pull) && common->differences <= of_noise;
    /* Alike: sum |h_i - mean|^2 <= n (0.1 max(|mean|, |change|))^2 + 4 times that of noise. */
    const hf_real squares = common->n * hf_max(hf_square(mean), square);
    const hf_real limit = HF_FIELD_TOLERANCE * HF_FIELD_TOLERANCE * squares + of_noise;
    const bool is_clear = common->differences <= limit;
    s->is_deep = common->differences > HF_DEEP_LOAD * limit;
    /* Variance of the speed: 3 (noise / n)^2 T / (2 tau_1 tau_2 (tau_1 + tau_2)). */
    const hf_real seconds = HF_COMMON_SECONDS + HF_SPEED_SECONDS;
    const hf_real scale = HF_SPEED_TO_NOISE * s->noise / common->n;
    const hf_real variance = scale * scale *
                             (3 / (2 * HF_COMMON_SECONDS * HF_SPEED_SECONDS * seconds)) *
                             f->hand->period;
    const hf_real speed = hf_square(s->speed + frame);
    const bool is_turning = speed > variance;
    if (square <= least) {
        s->field_is_load = false;
        s->field_speed = is_turning && is_clear ? speed : 0;
        return false;
    }
    /* A load: a press that is too fast for a field, or too strong. Where the unit is not known, any
     * press is one, unless it is small beside a field that was found, or in the fingertip frame:
     * on a curved patch, no press is alike there. */
    const hf_real fastest = HF_FIELD_SPEED * HF_COMMON_SECONDS * most;
    const bool is_strong = hf_square(mean) > most * most;
    const bool is_fast = moved > fastest * fastest;
    const bool is_small = square < hf_square(s->field) / 4;
    bool is_load =
        hf_is_press(f, common, change) &&
        (is_known ? is_fast || is_strong || s->field_is_load : !is_small && !common->is_turned);
    bool is_alike = is_clear, is_followed = false;
    s->is_shared = s->is_shared && is_small;
    if (!is_clear || is_load) {
        /* In the frame of the field; while that is small, in the other if only that fits. */
        const hf_real small = HF_FIRST_FIELD * HF_FIELD_TO_NOISE * s->noise / common->n;
        is_followed = hf_fits_another(f, s->field_is_turned);
        if (!is_followed && hf_square(s->field) <= small * small &&
            hf_fits_another(f, !s->field_is_turned)) {
            s->field_is_turned = !s->field_is_turned;
            hf_fill(s->field, 3, 0);
            is_followed = true;
        }
        s->is_shared |= is_followed;
    }
    const hf_real nearly = HF_LOAD_SHARE * HF_LOAD_SHARE;
    if (s->is_shared) { /* gains may differ more, and no press is a load */
        is_alike = common->differences <= nearly * squares + of_noise;
        is_load = false;
    }
    s->field_is_load = is_load && is_alike;
    if (!is_alike) {
        for (size_t axis = 0; axis < 3 && is_followed; ++axis) {
            s->field[axis] += steps[axis + (s->field_is_turned ? 3 : 0)];
        }
        /* Without the noise: what is under it is no field, and a light touch is not unclear. */
        return !is_load && !s->is_shared && common->differences <= nearly * common->n * square;
    }
    if (is_load) {
        if (is_known && is_fast) { /* what was taken for a field before */
            memcpy(s->field, s->still_field, sizeof s->field);
        }
        return false;
    }
    if (is_strong) {
        return true;
    }
    /* What moves is taken as it is; else the smoothed part, as one noisy sample of the mean would
     * stay in the force. Moves: |motion| > 1.5 times the least. */
    const bool moves = moved > HF_MOVES * HF_MOVES * least;
    memcpy(s->field, moves ? mean : s->common + frame, sizeof s->field);
    s->has_new_field = true;
    s->is_untouched = common->differences <= of_noise;
    s->field_is_turned = common->is_turned;
    s->field_speed = is_turning && !s->is_shared ? speed : 0;
    return false;
}

/* Take the field out of the readings of a finger. Return its faults. */
HF_SHARED uint32_t hf_take_out_field(const hf_finger *f)
{
    holdfast_finger_memory *const s = f->state;
    if (!(f->finger->max_field > 0) || isnan(s->noise)) {
        return 0;
    }
    s->has_new_field = false;
    /* Under a deep load each fourth sample only, unless a module turns: it shows the field. */
    if (s->is_deep && s->n_skipped < HF_SKIPPED_SAMPLES && !hf_another_turns(f, 0, HF_INFINITY)) {
        s->n_skipped += 1;
    } else {
        const hf_common common = hf_find_common(f);
        /* Counted, because a touch that begins is unclear, too, but not for long. */
        s->n_unclear = hf_update_field(f, &common) ? s->n_unclear + 1 : 0;
        s->n_skipped = 0;
    }
    if (hf_square(s->field) > 0) {
        /* f_i -= field, or R_i^T field. */
        const size_t n = f->n;
        for (size_t i = 0; i < f->n_taxels; ++i) {
            for (size_t axis = 0; axis < 3; ++axis) {
                const hf_real *const turn = f->rotations + axis * n + i;
                f->readings[axis * n + i] -= s->field_is_turned ? turn[0] * s->field[0] +
                                                                      turn[3 * n] * s->field[1] +
                                                                      turn[6 * n] * s->field[2]
                                                                : f->used[i] * s->field[axis];
            }
        }
    }
    const bool lasts = (hf_real)s->n_unclear * f->hand->period >= HF_UNCLEAR_SECONDS;
    return lasts ? HOLDFAST_FIELD : 0;
}
