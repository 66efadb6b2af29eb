/* Masks: a finger goes on without its faulty taxels.
 *
 * A masked taxel is filled in: with its last healthy reading beyond rest, scaled by the load of the
 * healthy taxels. So the force has no step when a taxel is masked, and what is filled in goes with
 * the load when the finger lets go. What is wrong with it when the taxel comes back fades slowly.
 * docs/decisions/0022-masks-of-taxels.md has the reasons. */
#include "finger.h"

/* Least share of the load that the healthy taxels of a finger carry; of its taxels, where the load
 * is not known. With less, the finger is UNKNOWN. */
#define HF_MIN_HEALTHY_SHARE ((hf_real)0.5)
/* The load is known if a taxel has this many times its noise, as a root mean square. */
#define HF_KNOWN_LOAD_TO_NOISE ((hf_real)10)
/* Time constant over which the difference fades when a taxel comes back [s]: slow beside all
 * features. */
#define HF_FADE_SECONDS ((hf_real)2)
/* What fades is gone below this share of the noise of a reading. */
#define HF_FADED_TO_NOISE ((hf_real)0.1)
/* Changes of a finger from which a taxel that did not change with them is still the same. */
#define HF_STILL_CHANGES 2
/* A taxel without a valid reading for this long in the tare is left out until the next [s]. */
#define HF_LOST_SECONDS ((hf_real)0.5)

/* Let taxels that are at a limit now, and were not left out before, count for their last reading.
 * The difference is in `fade`, which `hf_load_of` adds when the mask changes at this sample. */
HF_SHARED void hf_note_saturated(const hf_finger *f)
{
    const holdfast_taxel_set at_limit = hf_taxels_outside(f, f->finger->low, f->finger->high);
    for (size_t i = 0; i < f->n_taxels; ++i) {
        if (!hf_has(&at_limit, i) || hf_has(&f->state->masked, i)) {
            continue;
        }
        for (size_t axis = 0; axis < 3; ++axis) {
            const size_t index = axis * f->n + i;
            f->masks[i].fade[axis] += f->previous[index] - f->readings[index];
        }
    }
}

/* Set the readings of the taxels without a tare to a valid number that never changes. */
HF_SHARED void hf_hold_lost(const hf_finger *f)
{
    const hf_real low = f->finger->low, high = f->finger->high;
    const hf_real neutral = low < 0 && 0 < high ? 0 : (low + high) / 2;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        if (hf_has(&f->state->lost, i)) {
            f->readings[i] = f->readings[f->n + i] = f->readings[2 * f->n + i] = neutral;
            f->taxels[i].changed_at = f->state->n_changes; /* no taxel that is still */
        }
    }
}

/* Count a sample of the tare that is not valid, and leave out its taxels if it lasts. */
HF_SHARED void hf_lose_taxels(
    const hf_finger *f, uint32_t faults, const holdfast_taxel_set *invalid)
{
    holdfast_finger_memory *const s = f->state;
    const hf_real n_used = f->finger->n_used;
    holdfast_taxel_set lost = s->lost;
    size_t n_lost = 0;
    hf_unite(f, &lost, invalid);
    for (size_t i = 0; i < f->n_taxels; ++i) {
        n_lost += hf_has(&lost, i);
    }
    s->n_refused += 1;
    if ((hf_real)s->n_refused * f->hand->period >= HF_LOST_SECONDS && !hf_is_empty(f, invalid) &&
        n_used - (hf_real)n_lost >= HF_MIN_HEALTHY_SHARE * n_used) {
        s->lost = lost;
        s->lost_faults |= faults;
    }
}

/* Compute the reading of a taxel beyond that at rest, in its own frame. */
static void hf_beyond_rest(const hf_finger *f, size_t i, hf_real beyond[3])
{
    /* h_i = f_i - b_i - R_i^T g_i(reference). */
    const size_t n = f->n;
    const hf_real *const turn = f->rotations;
    const hf_real x = f->reference[i], y = f->reference[n + i], z = f->reference[2 * n + i];
    for (size_t axis = 0; axis < 3; ++axis) {
        const size_t index = axis * n + i;
        beyond[axis] = f->readings[index] - f->baseline[index] -
                       (turn[index] * x + turn[3 * n + index] * y + turn[6 * n + index] * z);
    }
}

/* Compute what a taxel counts for before the mask changes: filled in, fading, or as it is. */
static void hf_load_of(const hf_finger *f, size_t i, hf_real load[3])
{
    const holdfast_finger_memory *const s = f->state;
    const holdfast_mask *const mask = &f->masks[i];
    if (hf_has(&s->noisy_taxels, i) || hf_has(&s->lost, i)) {
        hf_fill(load, 3, 0); /* not known */
        return;
    }
    const bool is_filled = hf_has(&s->masked, i) && !s->too_many;
    if (!is_filled) {
        hf_beyond_rest(f, i, load);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
        load[axis] =
            is_filled ? s->fill_ratio * mask->last_healthy[axis] : load[axis] + mask->fade[axis];
    }
}

/* Return the sum of squares of the taxels of a finger beyond which its load is known. */
static hf_real hf_known_squares(const hf_finger *f)
{
    /* sum |h_i|^2 > n (10 noise)^2, with the noise of a reading: noise of F / sqrt(n). */
    const hf_real limit = HF_KNOWN_LOAD_TO_NOISE * f->state->noise;
    return limit * limit;
}

/* Return whether the load of a masked taxel is not known even if that of the finger is. */
static bool hf_is_unweighed(const hf_finger *f, size_t i)
{
    const holdfast_finger_memory *const s = f->state;
    if (f->masks[i].unweighed) { /* since a mask before, too */
        return true;
    }
    if (hf_has(&s->masked, i)) {
        return false;
    }
    return hf_has(&s->noisy_taxels, i) || hf_has(&s->lost, i) || f->taxels[i].n_changed == 0;
}

/* What a finger carries without some of its taxels. */
typedef struct {
    bool known;  /* the load is known */
    bool enough; /* the other taxels carry enough of it */
} hf_weight;

/* Weigh a finger without some faulty taxels. */
static hf_weight hf_weigh(const hf_finger *f, const holdfast_taxel_set *faulty)
{
    const hf_real n_used = f->finger->n_used;
    hf_sum carried = {{0}}, healthy = {{0}}, all_squares = {{0}};
    size_t n_masked = 0, n_unweighed = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        if (f->used[i] == 0) {
            continue;
        }
        hf_real load[3];
        hf_load_of(f, i, load);
        const hf_real square = hf_square(load);
        hf_add(&all_squares, i, square);
        if (hf_has(faulty, i)) {
            hf_add(&carried, i, hf_sqrt(square));
            n_masked += 1;
            n_unweighed += hf_is_unweighed(f, i);
        } else {
            hf_add(&healthy, i, hf_sqrt(square));
        }
    }
    /* Enough: sum over the healthy |h_i| >= half of that over all; and where loads are not known,
     * n - n_unknown >= n / 2. */
    const hf_real load = hf_total(healthy) + hf_total(carried);
    hf_weight weight;
    weight.known = hf_total(all_squares) > hf_known_squares(f); /* false for NaN */
    weight.enough = (hf_real)n_masked < n_used;
    if (weight.known && !(hf_total(healthy) >= HF_MIN_HEALTHY_SHARE * load)) {
        weight.enough = false;
    }
    const hf_real left = n_used - (hf_real)(weight.known ? n_unweighed : n_masked);
    weight.enough = weight.enough && left >= HF_MIN_HEALTHY_SHARE * n_used;
    return weight;
}

/* Replace the readings of taxels that are not valid by the last that were. Return whether enough
 * are valid. */
HF_SHARED bool hf_replace_invalid(const hf_finger *f, const holdfast_taxel_set *invalid)
{
    holdfast_finger_memory *const s = f->state;
    if (hf_is_empty(f, invalid)) {
        return false;
    }
    for (size_t i = 0; i < f->n_taxels; ++i) {
        for (size_t axis = 0; axis < 3 && hf_has(invalid, i); ++axis) {
            f->readings[axis * f->n + i] = f->previous[axis * f->n + i];
            f->taxels[i].changed_at = s->n_changes; /* no taxel that is still */
        }
    }
    holdfast_taxel_set left_out = *invalid;
    hf_unite(f, &left_out, &s->masked);
    hf_unite(f, &left_out, &s->faulty_taxels);
    hf_unite(f, &left_out, &s->lost);
    hf_unite(f, &left_out, &s->offset_taxels);
    if (hf_are_equal(f, &left_out, &s->masked)) {
        return !s->too_many;
    }
    const hf_weight weight = hf_weigh(f, &left_out);
    for (size_t i = 0; i < f->n_taxels && !weight.known && !weight.enough; ++i) {
        if (hf_has(&left_out, i)) { /* what they would carry stays unknown under a load as well */
            f->masks[i].unweighed = true;
        }
    }
    return weight.enough;
}

/* Note how far what was filled in for a taxel is from its reading, if it was long. */
static void hf_return_taxel(const hf_finger *f, size_t i, double time)
{
    holdfast_mask *const mask = &f->masks[i];
    if ((hf_real)(time - mask->masked_at) <= HF_MAX_BRIDGED_SECONDS) {
        return;
    }
    /* fade_i = ratio shape_i - h_i. */
    hf_real beyond[3];
    hf_beyond_rest(f, i, beyond);
    for (size_t axis = 0; axis < 3; ++axis) {
        mask->fade[axis] = f->state->fill_ratio * mask->last_healthy[axis] - beyond[axis];
    }
    f->state->fading = true;
}

/* Mask other taxels than before, and let those that come back fade in. */
static void hf_change_mask(const hf_finger *f, const holdfast_taxel_set *faulty, double time)
{
    holdfast_finger_memory *const s = f->state;
    const hf_weight weight = hf_weigh(f, faulty);
    hf_sum sum = {{0}};
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const bool was_filled = hf_has(&s->masked, i) && !s->too_many;
        const bool is_faulty = hf_has(faulty, i);
        holdfast_mask *const mask = &f->masks[i];
        hf_real load[3];
        hf_load_of(f, i, load);
        if (is_faulty) {
            mask->unweighed = !weight.known || hf_is_unweighed(f, i);
            hf_fill(mask->fade, 3, 0);
            if (!was_filled) {
                mask->masked_at = time;
            }
        } else if (s->n_changes - f->taxels[i].changed_at < HF_STILL_CHANGES) {
            mask->unweighed = false;
        }
        if (was_filled && !is_faulty) {
            hf_return_taxel(f, i, time);
            hf_beyond_rest(f, i, load);
            for (size_t axis = 0; axis < 3; ++axis) {
                load[axis] += mask->fade[axis];
            }
        }
        for (size_t axis = 0; axis < 3; ++axis) {
            mask->last_healthy[axis] = load[axis];
        }
        if (!is_faulty && f->used[i] > 0) {
            hf_add(&sum, i, hf_square(load));
        }
    }
    /* No window holds the samples of a taxel that became noisy, nor both ways to sum a finger. */
    holdfast_taxel_set noisy = s->noisy_taxels;
    hf_exclude(f, &noisy, &s->masked);
    if (!hf_is_empty(f, &noisy) || (!weight.enough && s->has_masked && !s->too_many)) {
        s->n_stretch = s->motion.n_samples = 0;
    }
    const hf_real squares = hf_total(sum);
    s->masked = *faulty;
    s->has_masked = !hf_is_empty(f, faulty);
    s->too_many = !weight.enough;
    s->load_known = weight.known && squares > 0;
    s->unloaded = false;
    s->fill_squares = squares;
    s->fill_ratio = 1;
}

/* Add what is left of the difference of taxels that came back, and reduce it. */
static void hf_fade_taxels(const hf_finger *f)
{
    /* fade_i(k+1) = (1 - T / tau) fade_i(k), until all are below 0.1 times the noise of a
     * reading. */
    const hf_real keep = 1 - hf_min(1, f->hand->period / HF_FADE_SECONDS);
    hf_real largest = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        for (size_t axis = 0; axis < 3; ++axis) {
            hf_real *const fade = &f->masks[i].fade[axis];
            largest = hf_max(largest, hf_abs(*fade));
            f->readings[axis * f->n + i] += *fade;
            *fade *= keep;
        }
    }
    const hf_real noise = f->state->noise / hf_sqrt(f->finger->n_used);
    if (!(largest > HF_FADED_TO_NOISE * noise)) {
        f->state->fading = false;
        for (size_t i = 0; i < f->n_taxels; ++i) {
            hf_fill(f->masks[i].fade, 3, 0);
        }
    }
}

/* Update the load of the healthy taxels, beside that when the mask last changed. */
static void hf_update_fill_ratio(const hf_finger *f)
{
    /* ratio = sum over the healthy h_i . shape_i / sum |shape_i|^2: linear in the readings. */
    holdfast_finger_memory *const s = f->state;
    hf_sum along = {{0}}, squares = {{0}};
    for (size_t i = 0; i < f->n_taxels; ++i) {
        if (hf_has(&s->masked, i) || f->used[i] == 0) {
            continue;
        }
        hf_real beyond[3];
        hf_beyond_rest(f, i, beyond);
        for (size_t axis = 0; axis < 3; ++axis) {
            hf_add(&along, i, beyond[axis] * f->masks[i].last_healthy[axis]);
        }
        hf_add(&squares, i, hf_square(beyond));
    }
    s->fill_ratio = hf_total(along) / s->fill_squares;
    s->unloaded = hf_total(squares) < hf_known_squares(f);
}

/* Fill in the masked taxels of a finger, and let those fade that came back. */
static void hf_fill_taxels(const hf_finger *f)
{
    holdfast_finger_memory *const s = f->state;
    if (s->fading) {
        hf_fade_taxels(f);
    }
    if (s->has_masked && s->load_known) {
        hf_update_fill_ratio(f);
    }
    /* f_i = f_i(rest) + ratio shape_i. */
    for (size_t i = 0; s->has_masked && i < f->n_taxels; ++i) {
        if (hf_has(&s->masked, i)) {
            hf_real beyond[3];
            hf_beyond_rest(f, i, beyond);
            for (size_t axis = 0; axis < 3; ++axis) {
                f->readings[axis * f->n + i] +=
                    s->fill_ratio * f->masks[i].last_healthy[axis] - beyond[axis];
            }
        }
    }
}

/* Fill in the faulty taxels of a finger. Return false, and fill none, if they carry too much. */
HF_SHARED bool hf_mask_taxels(const hf_finger *f, const holdfast_taxel_set *faulty, double time)
{
    const holdfast_finger_memory *const s = f->state;
    if (!hf_are_equal(f, faulty, &s->masked) || s->too_many || s->unloaded) {
        hf_change_mask(f, faulty, time);
    }
    if (s->too_many) {
        return false;
    }
    hf_fill_taxels(f);
    return true;
}
