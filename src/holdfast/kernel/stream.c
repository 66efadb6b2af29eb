/* One sample of a hand, in the order of holdfast.h: is it valid and plausible, changes, tare,
 * field, masks, force and features. */
#include "finger.h"

/* Return one finger of a hand: its constants, and its part of the memory. */
HF_SHARED hf_finger hf_finger_of(const holdfast_hand *hand, holdfast_memory *memory, size_t index)
{
    const holdfast_finger *const finger = &hand->fingers[index];
    const size_t first = finger->first, n_lags = HF_N_LAGS(hand);
    const size_t n_blocks = HF_N_CHANNELS(hand) * HF_N_LEVELS(hand) * HF_N_SUMS;
    hf_finger f;
    f.hand = hand;
    f.finger = finger;
    f.state = &memory->fingers[index];
    f.fingers = memory->fingers;
    f.values = &memory->values[index];
    f.n_taxels = finger->n_taxels;
    f.n = hf_n_lanes(finger->n_taxels);
    f.used = hand->used + first;
    f.rotations = hand->rotations + 9 * first;
    f.positions = hand->positions + 3 * first;
    f.readings = memory->readings + 3 * first;
    f.previous = memory->previous + 3 * first;
    f.baseline = memory->baseline + 3 * first;
    f.reference = memory->reference + 3 * first;
    f.changes = memory->changes + 3 * first;
    f.moved = memory->moved + 3 * first;
    f.pressed = memory->pressed + first;
    f.shares = memory->shares + 4 * first;
    f.powers = memory->powers + 2 * first;
    f.taxels = memory->taxels + first;
    f.masks = memory->masks + first;
    f.levels = memory->levels + first;
    f.laws = &memory->laws[index];
    f.history = memory->history + index * HF_N_HISTORY(hand) * HF_N_COMPONENTS;
    f.blocks = memory->blocks + index * HF_N_HISTORY(hand) * n_blocks;
    f.track = memory->track + index * HF_N_TRACK(hand);
    f.taxel_forces = memory->taxel_forces + 3 * first;
    f.slides = memory->slides + 3 * first;
    f.relative = memory->relative + index * n_lags * HOLDFAST_N_RELATIVE;
    f.averages = memory->averages + index * n_lags * HF_N_AVERAGES;
    return f;
}

/* Copy rows of taxels (n_taxels, 3) to the lanes of a finger (3, n); 0 for ignored taxels. */
HF_SHARED void hf_copy_to_lanes(const hf_finger *f, const hf_real *rows, hf_real *lanes)
{
    const hf_real *const row = rows + 3 * f->finger->first_taxel;
    const size_t n = f->n;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        lanes[i] = row[3 * i];
        lanes[n + i] = row[3 * i + 1];
        lanes[2 * n + i] = row[3 * i + 2];
    }
    if (f->finger->n_used < (hf_real)f->n_taxels) {
        for (size_t i = 0; i < f->n_taxels; ++i) {
            if (f->used[i] == 0) {
                lanes[i] = lanes[n + i] = lanes[2 * n + i] = 0;
            }
        }
    }
}

HF_SHARED void hf_clear_values(holdfast_values *values)
{
    hf_fill(values->force, 3, HF_NAN);
    values->amplitude = values->m = values->sigma = HF_NAN;
}

/* Start the windows of a finger again, whether it has a sample or not: a gap. */
static void hf_begin_gap(const hf_finger *f, hf_real *own)
{
    f->state->n_stretch = f->state->n_unchanged = f->state->n_pulled = 0;
    f->state->after_gap = true;
    hf_fill(own, HF_N_FEATURES(f->hand), HF_NAN);
    hf_fill(f->relative, HF_N_LAGS(f->hand) * HOLDFAST_N_RELATIVE, HF_NAN);
    hf_clear_values(f->values);
    f->values->reason = HOLDFAST_GAP;
    f->values->faults = 0;
    hf_clear(&f->values->taxels);
}

/* Compute the force of a valid sample, and return the reason.
 *
 * enough: whether the finger goes on without its faulty taxels.
 * finger_faults: that were found for the finger as a whole. */
static int32_t hf_process_force(
    const hf_finger *f, bool enough, uint32_t finger_faults, double time)
{
    holdfast_finger_memory *const s = f->state;
    holdfast_values *const v = f->values;
    /* F_tip = sum_i R_i (f_i - b_i). */
    hf_real force[3], normal;
    if (HF_N_LAGS(f->hand) > 0) {
        normal = hf_append_taxels(f, time, force);
        hf_append_force(f, force);
        hf_update_motion(f, time);
    } else {
        normal = hf_sum_taxels(f, f->baseline, force);
        hf_append_force(f, force);
    }
    finger_faults |= enough ? 0 : v->faults;
    if (hf_is_stuck(f)) {
        finger_faults |= HOLDFAST_STUCK;
    }
    v->faults |= finger_faults;
    if (finger_faults & HF_SERIOUS) {
        s->n_stretch = s->motion.n_samples = s->n_pulled = 0;
        return HOLDFAST_FAULT;
    }
    s->max_amplitude = hf_max(s->max_amplitude, v->amplitude);
    if (s->n_stretch >= (int64_t)f->finger->sigma_window) {
        const hf_moments moments = hf_newest_moments(f, 0, f->finger->sigma_window);
        v->m = moments.m;
        v->sigma = hf_sqrt(moments.variance);
    }
    /* With other tares a hand may hold an object at the start: then it is a notice and no fault. */
    if (f->hand->tare_kind == HOLDFAST_TARE_SECONDS && !s->is_rezeroed && hf_is_pulled(f, normal)) {
        finger_faults |= HOLDFAST_TARE_LOADED;
        v->faults |= HOLDFAST_TARE_LOADED;
    }
    const uint32_t rezeroed = hf_follow_rezero(f, time);
    v->faults |= rezeroed;
    if (finger_faults | rezeroed) {
        return HOLDFAST_FAULT;
    }
    const int64_t n_known = f->finger->bridges ? s->motion.n_samples : s->n_stretch;
    if (n_known < (int64_t)f->finger->ready_window) {
        return s->after_gap ? HOLDFAST_GAP : HOLDFAST_WARM_UP;
    }
    s->after_gap = false;
    return HOLDFAST_READY;
}

/* Return whether all readings are finite, and low <= every reading <= high. */
static bool hf_are_valid(const hf_finger *f, const hf_scan *scan)
{
    return isfinite(scan->total) && scan->least >= f->finger->low && scan->most <= f->finger->high;
}

/* Replace the readings of a sample that are not valid, if enough are. Return false if not.
 *
 * jumps: taxels that read zeros, or jump alone; NULL without any. */
static bool hf_replace_or_refuse(
    const hf_finger *f, const hf_scan *scan, const holdfast_taxel_set *jumps)
{
    uint32_t faults = jumps ? HOLDFAST_INVALID : 0;
    holdfast_taxel_set invalid = {{0}};
    if (!hf_are_valid(f, scan)) {
        /* Also where finite readings have a sum that is not. */
        faults |= isfinite(scan->total) ? HOLDFAST_OUT_OF_RANGE : HOLDFAST_NOT_FINITE;
        invalid = hf_find_invalid(f, &faults);
    }
    if (jumps) {
        hf_unite(f, &invalid, jumps);
    }
    f->values->faults |= faults;
    hf_unite(f, &f->values->taxels, &invalid);
    if (!f->state->is_tared) {
        hf_lose_taxels(f, faults, &invalid);
        return false;
    }
    return hf_replace_invalid(f, &invalid);
}

/* Note whether the readings of a finger have changed. Begin again, with a new tare, if all taxels
 * of one that was dead do at once: it was plugged in, and its constants were no zero. A tare that
 * is given stays. */
static void hf_note_life(const hf_finger *f, const hf_scan *scan, double time)
{
    holdfast_finger_memory *const s = f->state;
    const bool was_dead = hf_is_dead(f);
    const int32_t tare = f->hand->tare_kind;
    hf_note_constant(f, scan);
    if (was_dead && s->is_alive && s->n_seen > 0 && hf_are_moving(f) &&
        (tare == HOLDFAST_TARE_SECONDS || tare == HOLDFAST_TARE_FIRST)) {
        hf_begin_again(f, time);
    }
}

/* Process a sample of one finger. Return its reason; its faults are in the values. */
static int32_t hf_process(const hf_finger *f, double time)
{
    holdfast_finger_memory *const s = f->state;
    holdfast_values *const v = f->values;
    const hf_real low = f->finger->low, high = f->finger->high;
    /* Haar windows begin again after any gap, also after one that windows in seconds bridge. */
    const bool after_gap = (hf_real)(time - s->last_time) > HF_GAP_LIMIT_PERIODS * f->hand->period;
    if ((hf_real)(time - s->last_time) > HF_PAUSE_SECONDS) {
        hf_forget_returns(f);
    }
    hf_clear_values(v);
    s->last_time = time;
    s->field_speed = 0; /* a sample that is refused shows none */
    if (after_gap) {
        s->n_stretch = 0;
    }
    v->faults = s->lost_faults;
    v->taxels = s->lost;
    if (s->lost_faults) {
        hf_hold_lost(f);
    }
    if (s->has_offsets) {
        hf_take_out_jumps(f);
        if (s->has_offsets) {
            v->faults |= HOLDFAST_INVALID;
            hf_unite(f, &v->taxels, &s->offset_taxels);
        }
    }
    hf_scan scan = hf_scan_readings(f, f->readings);
    const bool are_valid = hf_are_valid(f, &scan);
    if (s->zero != HF_CONFIRMED && are_valid) {
        hf_confirm_zero(f, time);
    }
    holdfast_taxel_set jumps = {{0}};
    /* After a gap the last sample is too old to show a jump, and a first one may be no reading. */
    const bool is_compared = !after_gap && (s->n_seen > 1 || s->zero == HF_CONFIRMED);
    const bool has_jumps = is_compared && hf_find_jumps(f, &scan, &jumps);
    if (has_jumps || !are_valid) {
        if (!hf_replace_or_refuse(f, &scan, has_jumps ? &jumps : NULL)) {
            s->n_stretch = 0;
            hf_note_constant(f, &scan);
            return HOLDFAST_FAULT;
        }
        scan = hf_scan_readings(f, f->readings);
    }
    if (!s->is_alive) {
        hf_note_life(f, &scan, time);
    }
    /* Before the sample is counted: an implausible one reaches no tare, force or window. */
    const uint32_t implausible = hf_find_implausible(f, &scan);
    if (implausible) {
        s->n_stretch = 0;
        v->faults |= implausible;
        return HOLDFAST_FAULT;
    }
    hf_track_changes(f, time, after_gap);
    /* Half a period of tolerance: the rounding of times moves no sample. */
    const hf_real elapsed = (hf_real)(time - s->first_time) + f->hand->period / 2;
    const bool is_saturated = scan.least <= low || scan.most >= high;
    if (is_saturated && s->is_tared) {
        hf_note_saturated(f);
    }
    if (!hf_update_tare(f, elapsed)) {
        return HOLDFAST_TARE;
    }
    if (s->taxel_faults) {
        v->faults |= s->taxel_faults;
        hf_unite(f, &v->taxels, &s->faulty_taxels);
    }
    if (f->laws->has_equals) {
        v->faults |= HOLDFAST_EQUAL_TAXELS;
        hf_unite(f, &v->taxels, &f->laws->equals);
    }
    if (is_saturated) {
        const holdfast_taxel_set at_limit = hf_taxels_outside(f, low, high);
        v->faults |= HOLDFAST_SATURATED;
        hf_unite(f, &v->taxels, &at_limit);
    }
    /* Before the masks, which compare loads without the field. */
    const uint32_t field = hf_take_out_field(f);
    const bool has_mask = v->faults || s->has_masked || s->fading;
    const bool enough = !has_mask || hf_mask_taxels(f, &v->taxels, time);
    return hf_process_force(f, enough, field, time);
}

/* Return a value computed from a force feature. */
static hf_real hf_transform(const holdfast_feature *feature, hf_real value, hf_real noise)
{
    if (feature->transform == HOLDFAST_LOG) {
        return hf_log(hf_sqrt(value * value + feature->floor * feature->floor));
    }
    if (feature->transform == HOLDFAST_BY_NOISE) {
        /* log(max(v, sigma_n / 1000) / sigma_n), with the sigma of noise alone. */
        const hf_real expected = hf_noise_sigma(noise, feature->window);
        return hf_log(hf_max(value, (hf_real)1e-3 * expected) / expected);
    }
    return value;
}

/* Return a force feature of a finger whose stretch is long enough for it, before its transform. */
static hf_real hf_force_feature(const hf_finger *f, int32_t kind, size_t window)
{
    const hf_real *const newest = hf_history(f, 0);
    if (kind < HF_N_COMPONENTS) {
        return newest[kind]; /* F_a, F_x, F_y or F_z of the newest sample */
    }
    if (kind == HOLDFAST_M) {
        return hf_newest_moments(f, 0, window).m;
    }
    if (kind == HOLDFAST_SIGMA) {
        return hf_sqrt(hf_newest_moments(f, 0, window).variance);
    }
    /* change = |F_tip(k) - F_tip(k - N_w + 1)|.
     * sigma_xyz = sqrt(sigma(F_x)^2 + sigma(F_y)^2 + sigma(F_z)^2). */
    hf_real total = 0;
    for (size_t axis = 1; axis <= 3; ++axis) {
        if (kind == HOLDFAST_CHANGE) {
            const hf_real change = newest[axis] - hf_history(f, window - 1)[axis];
            total += change * change;
        } else {
            total += hf_newest_moments(f, axis, window).variance;
        }
    }
    return hf_sqrt(total);
}

/* Return a feature of a finger by itself; NaN where its stretch is too short. */
static hf_real hf_feature(const hf_finger *f, const holdfast_feature *feature)
{
    if (feature->kind >= HOLDFAST_FIRST_RELATIVE) {
        const hf_real *const relative = f->relative + feature->lag * HOLDFAST_N_RELATIVE;
        return relative[feature->kind - HOLDFAST_FIRST_RELATIVE];
    }
    const size_t n_needed = feature->window > 1 ? feature->window : 1;
    if (f->state->n_stretch < (int64_t)n_needed) {
        return HF_NAN;
    }
    const hf_real value = hf_force_feature(f, feature->kind, feature->window);
    return hf_transform(feature, value, f->state->noise);
}

/* Compute the features of a finger by itself. */
static void hf_compute_own(const hf_finger *f, const holdfast_feature *features, hf_real *own)
{
    for (size_t j = 0; j < HF_N_FEATURES(f->hand); ++j) {
        if (features[j].kind < 0) {
            own[j] = 0; /* padding */
        } else if (features[j].same_as < j) {
            own[j] = own[features[j].same_as];
        } else {
            own[j] = hf_feature(f, &features[j]);
        }
    }
}

/* Return the larger of two values; one that is NaN does not count. */
static hf_real hf_larger(hf_real value, hf_real rival)
{
    return rival > value || isnan(value) ? rival : value;
}

/* Return the largest value over the fingers of a feature of finger `index`. */
static hf_real hf_largest(
    const holdfast_hand *hand, holdfast_memory *memory, size_t index, size_t j)
{
    const size_t width = HF_N_FEATURES(hand);
    if (hand->alike) {
        return memory->of_hand[j];
    }
    hf_real value = memory->own[index * width + j];
    for (size_t other = 0; other < HF_N_FINGERS(hand); ++other) {
        const hf_finger f = hf_finger_of(hand, memory, other);
        value = hf_larger(value, hf_feature(&f, &hand->features[index * width + j]));
    }
    return value;
}

/* Compute the largest value over the fingers of the features that all have. */
static void hf_compute_of_hand(const holdfast_hand *hand, holdfast_memory *memory)
{
    const size_t width = HF_N_FEATURES(hand);
    for (size_t j = 0; j < width; ++j) {
        if (hand->features[j].of_hand) {
            hf_real value = memory->own[j];
            for (size_t f = 1; f < HF_N_FINGERS(hand); ++f) {
                value = hf_larger(value, memory->own[f * width + j]);
            }
            memory->of_hand[j] = value;
        }
    }
}

/* Fill Phi = [F_a, F_x, F_y, F_z, m, sigma], or the features of the model, of one finger. */
static void hf_fill_features(const holdfast_hand *hand, holdfast_memory *memory, size_t index)
{
    const size_t width = HF_N_FEATURES(hand);
    const holdfast_feature *const features = hand->features + index * width;
    hf_real *const out = memory->features + index * width;
    bool is_known = true;
    for (size_t j = 0; j < width; ++j) {
        out[j] = features[j].of_hand ? hf_largest(hand, memory, index, j)
                                     : memory->own[index * width + j];
        is_known = is_known && !isnan(out[j]);
    }
    if (!is_known) {
        memory->values[index].reason = HOLDFAST_TARE; /* the noise is not known yet */
    }
}

HF_API void holdfast_advance(
    const holdfast_hand *hand, holdfast_memory *memory, const hf_real *readings,
    const bool *present, double time)
{
    const size_t width = HF_N_FEATURES(hand);
    for (size_t i = 0; i < HF_N_FINGERS(hand); ++i) {
        const hf_finger f = hf_finger_of(hand, memory, i);
        /* A gap: t - t_last > 3 T, with the period T; or > 0.1 s where all windows are in seconds.
         * False while last_time is NaN. */
        if ((hf_real)(time - f.state->last_time) > f.finger->max_step) {
            hf_begin_gap(&f, memory->own + i * width);
        }
        if (present[i]) {
            hf_copy_to_lanes(&f, readings, f.readings);
            f.values->reason = hf_process(&f, time);
            if (!f.state->is_alive && hf_is_dead(&f)) {
                f.values->reason = HOLDFAST_FAULT;
                f.values->faults = HOLDFAST_DEAD;
                hf_clear(&f.values->taxels);
            }
            hf_compute_own(&f, hand->features + i * width, memory->own + i * width);
        }
    }
    hf_find_copies(hand, memory, present);
    if (hand->alike) {
        hf_compute_of_hand(hand, memory);
    }
    for (size_t i = 0; i < HF_N_FINGERS(hand); ++i) {
        if (memory->values[i].reason != HOLDFAST_READY) {
            hf_fill(memory->features + i * width, width, HF_NAN);
        } else if (present[i]) {
            hf_fill_features(hand, memory, i);
        }
    }
}
