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

/* Let the taxels of some bits, which are at a limit now, count for their last reading. The
 * difference is in `fade`, which `hf_load_of` adds when the mask changes at this sample. */
HF_SHARED void hf_note_saturated(const hf_finger *f, uint64_t bits)
{
    for (size_t i = 0; i < f->n_taxels; ++i) {
        for (size_t axis = 0; axis < 3 && (bits & hf_bit(i)); ++axis) {
            const size_t place = axis * f->n + i;
            f->masks[i].fade[axis] += f->previous[place] - f->readings[place];
        }
    }
}

/* Set the readings of the taxels without a tare to a valid number that never changes. */
HF_SHARED void hf_hold_lost(const hf_finger *f)
{
    const hf_real low = f->finger->low, high = f->finger->high;
    const hf_real neutral = low < 0 && 0 < high ? 0 : (low + high) / 2;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        if (f->state->lost & hf_bit(i)) {
            f->readings[i] = f->readings[f->n + i] = f->readings[2 * f->n + i] = neutral;
            f->taxels[i].changed_at = f->state->n_changes; /* no taxel that is still */
        }
    }
}

static size_t hf_n_bits(uint64_t bits)
{
    size_t n = 0;
    for (; bits; bits &= bits - 1) {
        ++n;
    }
    return n;
}

/* Count a sample of the tare that is not valid, and leave out its taxels if it lasts. */
HF_SHARED void hf_lose_taxels(const hf_finger *f, uint32_t faults, uint64_t bits)
{
    holdfast_finger_memory *const s = f->state;
    const uint64_t lost = s->lost | bits;
    const hf_real n_used = f->finger->n_used;
    s->n_refused += 1;
    if ((hf_real)s->n_refused * f->hand->period >= HF_LOST_SECONDS && bits &&
        n_used - (hf_real)hf_n_bits(lost) >= HF_MIN_HEALTHY_SHARE * n_used) {
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
        const size_t place = axis * n + i;
        beyond[axis] = f->readings[place] - f->baseline[place] -
                       (turn[place] * x + turn[3 * n + place] * y + turn[6 * n + place] * z);
    }
}

/* Compute what a taxel counts for before the mask changes: filled in, fading, or as it is. */
static void hf_load_of(const hf_finger *f, size_t i, hf_real load[3])
{
    const holdfast_finger_memory *const s = f->state;
    const holdfast_mask *const mask = &f->masks[i];
    const uint64_t bit = hf_bit(i);
    if ((s->noisy_taxels | s->lost) & bit) {
        hf_fill(load, 3, 0); /* not known */
        return;
    }
    const bool is_filled = (s->masked & bit) && !s->too_many;
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
    if (s->masked & hf_bit(i)) {
        return false;
    }
    return ((s->noisy_taxels | s->lost) & hf_bit(i)) || f->taxels[i].n_changed == 0;
}

/* What a finger carries without some of its taxels. */
typedef struct {
    bool known;  /* the load is known */
    bool enough; /* the other taxels carry enough of it */
} hf_weight;

/* Weigh a finger without the faulty taxels of some bits. */
static hf_weight hf_weigh(const hf_finger *f, uint64_t bits)
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
        if (bits & hf_bit(i)) {
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

/* Replace the readings of some bits, which are not valid, by the last that were. Return whether
 * enough are valid. */
HF_SHARED bool hf_replace_invalid(const hf_finger *f, uint64_t bits)
{
    holdfast_finger_memory *const s = f->state;
    if (bits == 0 || f->n_taxels > HF_N_MASK_BITS) {
        return false;
    }
    for (size_t i = 0; i < f->n_taxels; ++i) {
        for (size_t axis = 0; axis < 3 && (bits & hf_bit(i)); ++axis) {
            f->readings[axis * f->n + i] = f->previous[axis * f->n + i];
            f->taxels[i].changed_at = s->n_changes; /* no taxel that is still */
        }
    }
    bits |= s->masked | s->faulty_taxels | s->lost;
    if (bits == s->masked) {
        return !s->too_many;
    }
    const hf_weight weight = hf_weigh(f, bits);
    for (size_t i = 0; i < f->n_taxels && !weight.known && !weight.enough; ++i) {
        if (bits & hf_bit(i)) { /* what they would carry stays unknown under a load as well */
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
static void hf_change_mask(const hf_finger *f, uint64_t bits, double time)
{
    holdfast_finger_memory *const s = f->state;
    const uint64_t before = s->too_many ? 0 : s->masked;
    const hf_weight weight = hf_weigh(f, bits);
    hf_sum sum = {{0}};
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const uint64_t bit = hf_bit(i);
        holdfast_mask *const mask = &f->masks[i];
        hf_real load[3];
        hf_load_of(f, i, load);
        if (bits & bit) {
            mask->unweighed = !weight.known || hf_is_unweighed(f, i);
            hf_fill(mask->fade, 3, 0);
            if ((before & bit) == 0) {
                mask->masked_at = time;
            }
        } else if (s->n_changes - f->taxels[i].changed_at < HF_STILL_CHANGES) {
            mask->unweighed = false;
        }
        if (before & bit & ~bits) {
            hf_return_taxel(f, i, time);
            hf_beyond_rest(f, i, load);
            for (size_t axis = 0; axis < 3; ++axis) {
                load[axis] += mask->fade[axis];
            }
        }
        for (size_t axis = 0; axis < 3; ++axis) {
            mask->last_healthy[axis] = load[axis];
        }
        if (!(bits & bit) && f->used[i] > 0) {
            hf_add(&sum, i, hf_square(load));
        }
    }
    /* No window holds the samples of a taxel that became noisy, nor both ways to sum a finger. */
    if ((s->noisy_taxels & ~s->masked) || (!weight.enough && before)) {
        s->n_stretch = s->motion.n_samples = 0;
    }
    const hf_real squares = hf_total(sum);
    s->masked = bits;
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
        if ((s->masked & hf_bit(i)) || f->used[i] == 0) {
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
    if (s->masked && s->load_known) {
        hf_update_fill_ratio(f);
    }
    /* f_i = f_i(rest) + ratio shape_i. */
    for (size_t i = 0; i < f->n_taxels; ++i) {
        if (s->masked & hf_bit(i)) {
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
HF_SHARED bool hf_mask_taxels(const hf_finger *f, uint64_t bits, double time)
{
    const holdfast_finger_memory *const s = f->state;
    if (f->n_taxels > HF_N_MASK_BITS) {
        return false;
    }
    if (bits != s->masked || s->too_many || s->unloaded) {
        hf_change_mask(f, bits, time);
    }
    if (s->too_many) {
        return false;
    }
    hf_fill_taxels(f);
    return true;
}
