/* Faults that readings show: of single taxels and of whole fingers.
 *
 * A taxel is compared with the other taxels of its finger. Only samples that changed a reading of
 * the finger count, because a sample that a server sends twice shows nothing about a taxel. */
#include "finger.h"

/* Readings that changed for this long and then do not change for this long are stuck [s]. */
#define HF_STUCK_SECONDS ((hf_real)0.5)
/* A taxel that has not changed for this long since the first sample, while others change, is dead
 * [s]. */
#define HF_DEAD_SECONDS ((hf_real)2)
/* A taxel stands still by a fault if it does so this many times as long as ever before. Healthy
 * taxels reached 5 times in 24 randomized hands, and once in real recordings. */
#define HF_STILL_RATIO ((hf_real)10)
/* Time over which it is found whether a single axis changed [s], and the time for which an axis that
 * moves is the same at most. On real magnetic skins, no axis was the same for longer than 0.45 s. */
#define HF_COMPARED_SECONDS ((hf_real)0.15)
#define HF_MOVING_SECONDS ((hf_real)1)
/* An axis is the same by a fault if it is so this many times as long as ever before: by chance, n
 * samples are the same with the power n of the chance of one. */
#define HF_SAME_RATIO ((hf_real)5)
/* Factor of the time for which an axis is the same that differed fewer than HF_MIN_CHANGES times.
 */
#define HF_SELDOM_RATIO ((hf_real)15)
/* Changes from which the past of a taxel shows how long it stands still. One that changed less
 * often is compared with the others. */
#define HF_MIN_CHANGES 10
/* Least share of the other taxels that move before one that stands still counts as faulty. */
#define HF_MOVING_SHARE ((hf_real)0.8)
/* Time constant over which the noise of a taxel is smoothed [s]. */
#define HF_NOISE_SMOOTHING ((hf_real)0.25)
/* Least ratio of the mean squares of second and first differences in noise. It is 2 for
 * independent steps, 3 for white noise, 4 for a value that jumps up and down, less for motion. */
#define HF_WHITE_RATIO ((hf_real)2.5)
/* A taxel is noisy when it exceeds its least possible noise by this factor. */
#define HF_LOUD_RATIO ((hf_real)100)
/* Weights of the axes in the sum of the readings, sqrt(2) / 1.5 and sqrt(3) / 1.6: about 1, but not
 * rational. So whole counts have the same sum only if the sum of each axis is the same. */
#define HF_WEIGHT_Y (HF_SQRT_2 / (hf_real)1.5)
#define HF_WEIGHT_Z ((hf_real)1.7320508075688772 / (hf_real)1.6)
/* A pull for this long means that the tare was taken under load: nothing pulls a skin [s]. */
#define HF_LOADED_SECONDS ((hf_real)0.25)

/* Scan the readings of a finger (3, n). */
HF_SHARED hf_scan hf_scan_readings(const hf_finger *f, const hf_real *readings)
{
    const size_t n = f->n;
    hf_sum sum_x, sum_y, sum_z, lanes, minus_least, most;
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        hf_wide x = {0}, y = {0}, z = {0};
        const hf_wide none = x - HF_INFINITY;
        hf_wide lowest = none, highest = none;
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_vectors v = hf_load_vectors(readings, n, i);
            hf_wide high = hf_greater(v.z, hf_greater(v.x, v.y));
            hf_wide low = -hf_smaller(v.z, hf_smaller(v.x, v.y));
            const hf_wide used = hf_load(f->used + i);
            high = hf_where(used > 0, high, none);
            low = hf_where(used > 0, low, none);
            x += v.x;
            y += v.y;
            z += v.z;
            highest = hf_greater(high, highest);
            lowest = hf_greater(low, lowest);
        }
        hf_put(&sum_x, lane, x);
        hf_put(&sum_y, lane, y);
        hf_put(&sum_z, lane, z);
        hf_put(&lanes, lane, x + HF_WEIGHT_Y * y + HF_WEIGHT_Z * z);
        hf_put(&most, lane, highest);
        hf_put(&minus_least, lane, lowest);
    }
    const hf_real sums[3] = {hf_total(sum_x), hf_total(sum_y), hf_total(sum_z)};
    const hf_scan scan = {
        sums[0] + HF_WEIGHT_Y * sums[1] + HF_WEIGHT_Z * sums[2],
        -hf_largest_lane(minus_least),
        hf_largest_lane(most),
        {sums[0], sums[1], sums[2]},
        lanes};
    return scan;
}

/* Return the taxels with a reading that is not strictly between low and high. */
HF_SHARED holdfast_taxel_set hf_taxels_outside(const hf_finger *f, hf_real low, hf_real high)
{
    holdfast_taxel_set outside = {{0}};
    for (size_t axis = 0; axis < 3; ++axis) {
        for (size_t i = 0; i < f->n_taxels; ++i) {
            const hf_real reading = f->readings[axis * f->n + i];
            if (!(low < reading && reading < high) && f->used[i] > 0) {
                hf_include(&outside, i);
            }
        }
    }
    return outside;
}

/* Add NOT_FINITE and OUT_OF_RANGE to some faults, as far as some taxel has them. Return these
 * taxels. At least one reading of the finger is not valid. */
HF_SHARED holdfast_taxel_set hf_find_invalid(const hf_finger *f, uint32_t *faults)
{
    const holdfast_taxel_set infinite = hf_taxels_outside(f, -HF_INFINITY, HF_INFINITY);
    const holdfast_taxel_set invalid = hf_taxels_outside(
        f, hf_nextafter(f->finger->low, -HF_INFINITY), hf_nextafter(f->finger->high, HF_INFINITY));
    if (!hf_is_empty(f, &infinite)) {
        *faults |= HOLDFAST_NOT_FINITE;
    }
    if (!hf_are_equal(f, &invalid, &infinite)) {
        *faults |= HOLDFAST_OUT_OF_RANGE;
    }
    return invalid;
}

/* Return whether no reading of a finger has changed since the first sample, for long. */
HF_SHARED bool hf_is_dead(const hf_finger *f)
{
    /* Dead: for max(0.5 s, 10 samples). Noise of a step / 3 or more changes a reading at 1 of 6
     * samples at least, so 15 readings of a living skin are all the same that long with a chance
     * of 1e-12. One with far less noise may rest so: it is alive from its first change on. */
    const hf_real least = hf_max(HF_STUCK_SECONDS / f->hand->period, HF_MIN_CHANGES);
    return !f->state->is_alive && (hf_real)f->state->n_constant >= least;
}

/* Return whether the reading of a taxel changed since the last valid sample. */
HF_SHARED bool hf_has_moved(const hf_finger *f, size_t i)
{
    const hf_real *const now = f->readings + i, *const then = f->previous + i;
    const size_t n = f->n;
    return now[0] != then[0] || now[n] != then[n] || now[2 * n] != then[2 * n];
}

/* Return whether nearly all taxels changed at once since the last valid sample. */
HF_SHARED bool hf_are_moving(const hf_finger *f)
{
    hf_real n_moving = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        n_moving += hf_has_moved(f, i);
    }
    return f->finger->n_used >= HF_MIN_TAXELS && n_moving >= HF_MOVING_SHARE * f->finger->n_used;
}

/* Note whether the readings of a finger, valid or not, have changed since the first sample. */
HF_SHARED void hf_note_constant(const hf_finger *f, const hf_scan *scan)
{
    holdfast_finger_memory *const s = f->state;
    if (s->is_alive || !isfinite(scan->total)) {
        return;
    }
    const bool rests = f->finger->rests_at_zero && scan->least == 0 && scan->most == 0;
    s->is_alive = rests || (s->n_constant > 0 && scan->total != s->constant_sum);
    s->constant_sum = scan->total;
    s->n_constant += 1;
}

/* Return whether the readings of a finger stopped changing after they had changed.
 *
 * A sensor with a dead band, or with less noise than a step of its readings, rests while nothing
 * moves it. */
HF_SHARED bool hf_is_stuck(const hf_finger *f)
{
    /* Stuck: more than half of the steps before the rest changed a reading, 0.5 s of changes at
     * least, and the rest lasts max(0.5 s, 10 times the longest rest before). */
    const holdfast_finger_memory *const s = f->state;
    const int64_t n_steps = s->n_seen - 1 - s->n_unchanged;
    const hf_real least = HF_STUCK_SECONDS / f->hand->period;
    const hf_real rested = HF_STILL_RATIO * (hf_real)s->longest_rest;
    return 2 * s->n_changes > n_steps && (hf_real)s->n_unchanged >= hf_max(least, rested) &&
           (hf_real)s->n_changes >= least;
}

/* Return whether the normal readings add up to a pull, well above noise, for a long time. */
HF_SHARED bool hf_is_pulled(const hf_finger *f, hf_real normal)
{
    /* Pulled: sum_i z_i < -max(20 noise, 0.1 max F_a), for 0.25 s. Noise alone never reaches 20
     * deviations, and an elastomer that creeps falls by less than a tenth. */
    holdfast_finger_memory *const s = f->state;
    const hf_real limit = hf_max(20 * s->noise, (hf_real)0.1 * s->max_amplitude);
    s->n_pulled = normal < -limit ? s->n_pulled + 1 : 0;
    return (hf_real)s->n_pulled * f->hand->period >= HF_LOADED_SECONDS;
}

static bool hf_differ(const hf_real *readings, const hf_real *previous, size_t n)
{
    for (size_t i = 0; i < n; ++i) {
        if (readings[i] != previous[i]) {
            return true;
        }
    }
    return false;
}

/* Return false for zeros: a sensor with a dead band jumps to and from zero without noise. */
HF_SHARED bool hf_has_reading(const hf_real *readings, size_t n, size_t i)
{
    return readings[i] != 0 || readings[n + i] != 0 || readings[2 * n + i] != 0;
}

/* Forget the last change of a taxel, so that its next second difference is a first one. */
static void hf_forget_change(const hf_finger *f, size_t i)
{
    f->changes[i] = f->changes[f->n + i] = f->changes[2 * f->n + i] = 0;
}

/* Note that a taxel which changes now did not for `still` samples before, or never did. */
static void hf_note_still(const hf_finger *f, size_t i, int64_t still)
{
    holdfast_taxel *const taxel = &f->taxels[i];
    const hf_real period = f->hand->period, length = (hf_real)still;
    /* Still for longer than the smoothing: the change before is too old for a second difference. */
    if ((length + 1) * hf_min(1, period / HF_NOISE_SMOOTHING) > 1) {
        hf_forget_change(f, i);
    }
    if (taxel->n_changed == 0) {
        taxel->longest_still = f->state->n_seen - 1;
    } else if (still > taxel->longest_still) {
        /* longest = still, unless still >= max(0.5 s, 10 (longest + 1)): that was a fault. */
        const hf_real limit = HF_STILL_RATIO * (hf_real)(taxel->longest_still + 1);
        if (taxel->n_changed < HF_MIN_CHANGES ||
            length < hf_max(HF_STUCK_SECONDS / period, limit)) {
            taxel->longest_still = still;
        }
    }
}

/* How the taxels of a finger change. */
typedef struct {
    bool any_still;  /* some taxel did not change for 0.5 s of changes of the finger */
    bool alone;      /* one taxel has most of the second differences */
    hf_real largest; /* its P2 */
} hf_changes;

/* Return |D2|^2 of a taxel that changes by D1, with D2 = D1 - D1 of its last change. */
static hf_real hf_second_square(const hf_finger *f, size_t i, const hf_real change[3])
{
    holdfast_taxel *const taxel = &f->taxels[i];
    const int64_t still = f->state->n_changes - taxel->changed_at - 1;
    if (still != 0 || taxel->n_changed == 0) {
        hf_note_still(f, i, still);
    }
    hf_real second[3];
    for (size_t axis = 0; axis < 3; ++axis) {
        hf_real *const last = &f->changes[axis * f->n + i];
        second[axis] = change[axis] - *last;
        *last = change[axis];
        f->moved[axis * f->n + i] += hf_abs(change[axis]);
    }
    taxel->n_changed += 1;
    taxel->changed_at = f->state->n_changes;
    return hf_square(second);
}

/* Update the past of one taxel. Return whether it did not change for long. */
static bool hf_update_taxel(const hf_finger *f, size_t i, hf_real share)
{
    const size_t n = f->n;
    const hf_real *const now = f->readings, *const then = f->previous;
    const hf_real change[3] = {
        now[i] - then[i], now[n + i] - then[n + i], now[2 * n + i] - then[2 * n + i]};
    const hf_real square = hf_square(change);
    hf_real first_power = (1 - share) * f->powers[i];
    hf_real second_power = (1 - share) * f->powers[n + i];
    bool is_still = false;
    if (square > 0) {
        const hf_real second = hf_second_square(f, i, change);
        if (hf_has_reading(now, n, i) && hf_has_reading(then, n, i)) {
            first_power += share * square;
            second_power += share * second;
        } else {
            hf_forget_change(f, i);
        }
    } else {
        const hf_real still = (hf_real)(f->state->n_changes - f->taxels[i].changed_at);
        is_still = still >= HF_STUCK_SECONDS / f->hand->period;
    }
    f->powers[i] = first_power;
    f->powers[n + i] = second_power;
    return is_still;
}

/* Return whether all taxels from a lane on change now and did so at the change before, with
 * readings: the usual case, in which nothing about a single taxel is to be noted. */
static bool hf_are_lively(const hf_finger *f, size_t i, hf_vectors now, hf_vectors then)
{
    bool are_lively = true;
    for (size_t l = 0; l < HF_WIDTH; ++l) {
        const holdfast_taxel *const taxel = &f->taxels[i + l];
        are_lively &= taxel->n_changed > 0 && taxel->changed_at == f->state->n_changes - 1;
    }
    const hf_wide squares = hf_squares(hf_minus(now, then));
    const hf_wide has = hf_wide_abs(now.x) + hf_wide_abs(now.y) + hf_wide_abs(now.z);
    const hf_wide had = hf_wide_abs(then.x) + hf_wide_abs(then.y) + hf_wide_abs(then.z);
    return are_lively && hf_are_positive(hf_smaller(squares, hf_smaller(has, had)));
}

/* Update the past of taxels in the usual case, as `hf_update_taxel` does. */
static void hf_update_lively(
    const hf_finger *f, size_t i, hf_vectors now, hf_vectors then, hf_real share)
{
    const size_t n = f->n;
    const hf_vectors change = hf_minus(now, then);
    const hf_vectors second = hf_minus(change, hf_load_vectors(f->changes, n, i));
    hf_store(f->changes + i, change.x);
    hf_store(f->changes + n + i, change.y);
    hf_store(f->changes + 2 * n + i, change.z);
    hf_store(f->moved + i, hf_load(f->moved + i) + hf_wide_abs(change.x));
    hf_store(f->moved + n + i, hf_load(f->moved + n + i) + hf_wide_abs(change.y));
    hf_store(f->moved + 2 * n + i, hf_load(f->moved + 2 * n + i) + hf_wide_abs(change.z));
    const hf_wide first = hf_load(f->powers + i), power = hf_load(f->powers + n + i);
    hf_store(f->powers + i, (1 - share) * first + share * hf_squares(change));
    hf_store(f->powers + n + i, (1 - share) * power + share * hf_squares(second));
    for (size_t l = 0; l < HF_WIDTH; ++l) {
        f->taxels[i + l].n_changed += 1;
        f->taxels[i + l].changed_at = f->state->n_changes;
    }
}

/* Update the past of each taxel of a finger with a sample that changed a reading. */
static hf_changes hf_update_taxels(const hf_finger *f)
{
    /* D1 = f_i(k) - f_i(k-1), D2 = D1 - D1 of the last change, s = T / tau:
     * P1 = (1 - s) P1 + s |D1|^2, P2 = (1 - s) P2 + s |D2|^2. Without a change D1 = D2 = 0. */
    const size_t n = f->n;
    const hf_real share = hf_min(1, f->hand->period / HF_NOISE_SMOOTHING);
    hf_changes changes = {false, false, 0};
    hf_sum total, largest;
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        hf_wide sum = {0}, most = {0};
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_vectors now = hf_load_vectors(f->readings, n, i);
            const hf_vectors then = hf_load_vectors(f->previous, n, i);
            if (hf_are_lively(f, i, now, then)) {
                hf_update_lively(f, i, now, then, share);
            } else {
                for (size_t l = 0; l < HF_WIDTH && i + l < f->n_taxels; ++l) {
                    changes.any_still |= hf_update_taxel(f, i + l, share);
                }
            }
            const hf_wide power = hf_load(f->powers + n + i);
            sum += power;
            most = hf_greater(power, most);
        }
        hf_put(&total, lane, sum);
        hf_put(&largest, lane, most);
    }
    changes.largest = hf_largest_lane(largest);
    changes.alone = changes.largest >= HF_LONE_SHARE * hf_total(total);
    return changes;
}

/* Return whether a taxel does not change for far longer than ever before. */
static bool hf_is_still(const hf_finger *f, const holdfast_taxel *taxel)
{
    /* Still: 2 s at first; later max(0.5 s, 10 (longest + 1 sample)). */
    const hf_real still = (hf_real)(f->state->n_changes - taxel->changed_at);
    if (taxel->n_changed < HF_MIN_CHANGES) {
        return still >= HF_DEAD_SECONDS / f->hand->period;
    }
    const hf_real limit = HF_STILL_RATIO * (hf_real)(taxel->longest_still + 1);
    return still >= hf_max(HF_STUCK_SECONDS / f->hand->period, limit);
}

/* Return for how many samples a moving taxel stood still at most; -1 if too few move.
 *
 * A taxel that was ever still for long does not count as moving, because the noise of such a
 * sensor is less than a step of its readings: it is still while nothing moves it. */
static int64_t hf_longest_still_of_moving(const hf_finger *f)
{
    const hf_real least = HF_STUCK_SECONDS / f->hand->period;
    int64_t n_live = 0, n_moving = 0, longest = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const holdfast_taxel *const taxel = &f->taxels[i];
        const bool silent = taxel->n_changed == 0 && !hf_has_reading(f->readings, f->n, i);
        if (f->used[i] == 0 || silent || hf_is_still(f, taxel)) {
            continue;
        }
        n_live += 1;
        /* Moving: changed in the last 0.25 s and in more than half of the samples. */
        const int64_t still = f->state->n_changes - taxel->changed_at;
        if ((hf_real)(2 * still) < least && 2 * taxel->n_changed > taxel->changed_at &&
            (hf_real)taxel->longest_still < least) {
            n_moving += 1;
            longest = taxel->longest_still > longest ? taxel->longest_still : longest;
        }
    }
    /* At least 80 % of the live taxels move. */
    const bool enough = n_moving > 0 && (hf_real)n_moving >= HF_MOVING_SHARE * (hf_real)n_live;
    return enough ? longest : -1;
}

/* Note the taxels of a finger that are DEAD or STUCK, if the others move. */
static void hf_find_still_taxels(const hf_finger *f)
{
    holdfast_finger_memory *const s = f->state;
    const int64_t others = hf_longest_still_of_moving(f);
    if (others < 0) {
        return;
    }
    /* A taxel at a limit of its range is saturated, not stuck. */
    const holdfast_taxel_set at_limit = hf_taxels_outside(f, f->finger->low, f->finger->high);
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const holdfast_taxel *const taxel = &f->taxels[i];
        const int64_t still = s->n_changes - taxel->changed_at;
        if (f->used[i] == 0 || !hf_is_still(f, taxel)) {
            continue;
        }
        if (!hf_has_reading(f->readings, f->n, i)) {
            continue; /* zeros: nothing touches a sensor with a dead band */
        }
        /* Too few changes of its own: compared with the others, still >= 10 (others + 1). */
        if (taxel->n_changed < HF_MIN_CHANGES &&
            (hf_real)still < HF_STILL_RATIO * (hf_real)(others + 1)) {
            continue;
        }
        if (taxel->n_changed == 0) {
            s->taxel_faults |= HOLDFAST_DEAD;
            hf_include(&s->faulty_taxels, i);
        } else if (!hf_has(&at_limit, i)) {
            s->taxel_faults |= HOLDFAST_STUCK;
            hf_include(&s->faulty_taxels, i);
        }
    }
}

/* Note the taxel of a finger that has most of the second differences, if it is NOISY. */
static void hf_find_noisy_taxel(const hf_finger *f, hf_real largest)
{
    holdfast_finger_memory *const s = f->state;
    /* Noise of a reading: noise of F / sqrt(n_used), where the step is not known. */
    const hf_real quiet = isnan(f->finger->step) ? s->noise / hf_sqrt(f->finger->n_used)
                                                 : f->finger->step_noise;
    size_t loudest = 0;
    while (loudest + 1 < f->n_taxels && f->powers[f->n + loudest] != largest) {
        ++loudest;
    }
    /* Noisy: P2 > 2.5 P1 (white noise has 3 P1), and P2 > 6 (100 noise)^2: D2 of white noise of a
     * reading has the variance 6 noise^2. */
    const hf_real first_power = f->powers[loudest], second_power = f->powers[f->n + loudest];
    const hf_real loud = HF_LOUD_RATIO * quiet;
    if (second_power > HF_WHITE_RATIO * first_power && second_power > 6 * (loud * loud)) {
        s->taxel_faults |= HOLDFAST_NOISY;
        hf_include(&s->noisy_taxels, loudest);
        hf_include(&s->faulty_taxels, loudest);
    }
}

/* Return whether an axis of a taxel is the same for far longer than ever before.
 *
 * others: most intervals for which one that moves was the same. */
static bool hf_is_same(const holdfast_taxel *taxel, size_t axis, int32_t others)
{
    /* Same for max(2 s, 5 times as long as ever before); one that differed too seldom, for
     * max(30 s, 5 times as long as the others, too). */
    const bool is_live = taxel->n_differed[axis] >= HF_MIN_CHANGES;
    int32_t before = taxel->longest_same[axis];
    before = !is_live && others > before ? others : before;
    const hf_real least = (is_live ? 1 : HF_SELDOM_RATIO) * HF_DEAD_SECONDS / HF_COMPARED_SECONDS;
    const hf_real limit = hf_max(least, HF_SAME_RATIO * (hf_real)(before + 1));
    return (hf_real)taxel->n_same[axis] >= limit;
}

/* Find the magnetometers of which an axis is stuck, while that of the others moves.
 *
 * Whole counts with little noise repeat, so an axis is compared with its own past. */
static void hf_find_stuck_axis(const hf_finger *f, size_t axis)
{
    const hf_real *const readings = f->readings + axis * f->n;
    hf_real *const moved = f->moved + axis * f->n;
    holdfast_taxel_set *const stuck = &f->state->stuck_axes[axis];
    const int32_t least = (int32_t)(HF_DEAD_SECONDS / HF_COMPARED_SECONDS);
    bool is_any_same = false;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        holdfast_taxel *const taxel = &f->taxels[i];
        if (moved[i] == 0) {
            taxel->n_same[axis] += 1;
            is_any_same |= taxel->n_same[axis] >= least && f->used[i] > 0;
            continue;
        }
        if (taxel->n_same[axis] > taxel->longest_same[axis] && !hf_has(stuck, i)) {
            taxel->longest_same[axis] = taxel->n_same[axis];
        }
        moved[i] = 0;
        taxel->n_same[axis] = 0;
        taxel->n_differed[axis] += 1;
    }
    if (f->state->has_stuck_axis[axis]) {
        hf_clear(stuck);
        f->state->has_stuck_axis[axis] = false;
    }
    if (!is_any_same) {
        return;
    }
    hf_real n_moving = 0;
    int32_t longest = 0; /* of those that move */
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const holdfast_taxel *const taxel = &f->taxels[i];
        const hf_real same = HF_COMPARED_SECONDS * (hf_real)taxel->n_same[axis];
        if (taxel->n_differed[axis] >= HF_MIN_CHANGES && same < HF_MOVING_SECONDS) {
            n_moving += 1;
            longest = taxel->longest_same[axis] > longest ? taxel->longest_same[axis] : longest;
        }
    }
    for (size_t i = 0; n_moving >= HF_MOVING_SHARE * f->finger->n_used && i < f->n_taxels; ++i) {
        const bool at_limit = readings[i] <= f->finger->low || readings[i] >= f->finger->high;
        if (f->used[i] > 0 && !at_limit && hf_is_same(&f->taxels[i], axis, longest)) {
            hf_include(stuck, i);
            f->state->has_stuck_axis[axis] = true;
        }
    }
}

/* Find the faulty taxels of a finger at a sample that changed a reading. */
static void hf_find_taxel_faults(const hf_finger *f, bool after_gap)
{
    holdfast_finger_memory *const s = f->state;
    const hf_changes changes = hf_update_taxels(f);
    for (size_t i = 0; after_gap && i < f->n_taxels; ++i) { /* a change over a gap is no noise */
        hf_forget_change(f, i);
        f->powers[i] = f->powers[f->n + i] = 0;
    }
    if (f->finger->is_magnetic) { /* one axis after the other */
        const double turns = (double)(HF_COMPARED_SECONDS / 3 / f->hand->period);
        const int64_t interval = turns > 1 ? (int64_t)lrint(turns) : 1;
        if (s->n_changes % interval == 0) {
            const size_t axis = (size_t)(s->n_changes / interval % 3);
            hf_find_stuck_axis(f, axis);
        }
    }
    if (s->taxel_faults) { /* of the last sample */
        hf_clear(&s->faulty_taxels);
        hf_clear(&s->noisy_taxels);
        s->taxel_faults = 0;
    }
    for (size_t axis = 0; axis < 3; ++axis) {
        if (s->has_stuck_axis[axis]) {
            hf_unite(f, &s->faulty_taxels, &s->stuck_axes[axis]);
            s->taxel_faults = HOLDFAST_STUCK;
        }
    }
    hf_find_fallen_taxels(f, after_gap);
    if (changes.any_still) {
        hf_find_still_taxels(f);
    }
    if (changes.alone && f->finger->n_used >= HF_MIN_TAXELS) {
        hf_find_noisy_taxel(f, changes.largest);
    }
}

/* Count a valid sample of a finger, and compare it with the one before. */
HF_SHARED void hf_track_changes(const hf_finger *f, double time, bool after_gap)
{
    holdfast_finger_memory *const s = f->state;
    if (s->n_seen == 0) {
        s->first_time = time;
    } else if (hf_differ(f->readings, f->previous, 3 * f->n)) {
        /* longest rest = max(longest rest, rest), of rests of 0.5 s or more that are no fault. */
        if (!hf_is_stuck(f) && (hf_real)s->n_unchanged >= HF_STUCK_SECONDS / f->hand->period &&
            s->n_unchanged > s->longest_rest) {
            s->longest_rest = s->n_unchanged;
        }
        s->n_unchanged = 0;
        s->n_changes += 1;
        hf_find_taxel_faults(f, after_gap);
    } else {
        s->n_unchanged += 1;
    }
    s->n_seen += 1;
}
