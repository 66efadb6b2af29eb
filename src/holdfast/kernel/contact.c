/* Contact: whether a finger touches anything (decision 12).
 *
 * A finger without contact has a small load. What counts as none follows a slow drift, and a skin
 * that is released and relaxes. */
#include "decision.h"

/* A touch brings F_a over the threshold of contact in less time than this; a drift does not [s]. */
#define HF_DRIFT_SECONDS ((hf_real)1)
/* A contact begins above the threshold and ends below this share of it. Without this hysteresis a
 * hand changed its state around the threshold and while it let go (decision 12). */
#define HF_CONTACT_RELEASE_RATIO ((hf_real)0.7)
/* Time constant with which the rest follows the force of a finger without contact [s]. With 2 s it
 * follows all that is slower than a touch, and no drift is left to report; with 5 s a grasp has
 * half as many changes again (docs/study/tries.md). A load lasts over the same time. */
#define HF_FOLLOW_SECONDS ((hf_real)3)
/* Share of the largest load so far that a touch exceeds: a contact begins above 0.12 of it, and
 * ends below 0.08, the echo that a released skin may still show (motion.c). */
#define HF_TOUCH_SHARE ((hf_real)1.5 * HF_RELEASED_SHARE)
/* Share of a load that fell at once, in this time [s] at least and twice of it at most, which a
 * release may leave for seconds: in the twin 14 % after a hold of half a minute. */
#define HF_FALL_SHARE ((hf_real)0.145)
#define HF_FALL_SECONDS 0.5
/* A force is at rest if it has not moved, or not been shaken, for this time [s]. So long after a
 * release, the echo is below HF_RELEASED_SHARE in 95 % of the cases (docs/study/tries.md). */
#define HF_REST_SECONDS 0.2
/* A force is unsteady while it changes within 0.133 s by more than a quarter of the largest load of
 * the last seconds, and by 16 times its noise. The noise of such a change is 5 standard deviations
 * of a white one times 2.3, the most that was measured on a real sensor; with 10 times, a gripper
 * that held still had 4.5 alarms a minute (decision 12). */
#define HF_UNSTEADY_SHARE ((hf_real)0.25)
#define HF_UNSTEADY_TO_NOISE ((hf_real)16)
/* A first touch shows turned taxels by at least this share of the squared normal readings of either
 * sign. */
#define HF_TURNED_SHARE ((hf_real)0.2)
/* A finger is calm while sigma is at most this many times the sigma of noise alone. */
#define HF_CALM_RATIO ((hf_real)3)

/* How the load came over the threshold of contact. */
enum { HF_NO_EXCESS, HF_TOUCH, HF_DRIFT };

static bool hf_was_in_contact(const holdfast_decision *d)
{
    /* At the last sample, before the minimum duration. */
    return d->candidate == HOLDFAST_STABLE || d->candidate == HOLDFAST_UNSTABLE;
}

/* Return whether a load is below the threshold of contact, which is lower while in contact. */
static bool hf_is_unloaded(
    const holdfast_decision *d, hf_real load, hf_real peak, hf_real threshold)
{
    /* In contact: load < max(0.7 threshold, 0.08 peak); else load < max(threshold, 0.12 peak). */
    if (hf_was_in_contact(d)) {
        return load < hf_max(HF_CONTACT_RELEASE_RATIO * threshold, HF_RELEASED_SHARE * peak);
    }
    return load < hf_max(threshold, HF_TOUCH_SHARE * peak);
}

/* Return whether a load is what a grip that was let go leaves. Update the load that lasted.
 *
 * A skin creeps back from a load that lasted, and its tare has drifted since: the peak is forgotten
 * sooner than what is left goes. */
static bool hf_is_echo(const hf_finger *f, holdfast_decision *d, hf_real load, double time)
{
    /* s(k) = s(k-1) + (T / tau) (load(k) - s(k-1)); h: the largest load of this block of time and
     * of the one before. In contact: load < max(0.12 s, 0.145 h). */
    d->smoothed = isnan(d->smoothed) ? load : d->smoothed;
    d->smoothed += hf_min(1, f->hand->period / HF_FOLLOW_SECONDS) * (load - d->smoothed);
    if (!(time - d->block_start < HF_FALL_SECONDS)) {
        d->block_start = time;
        d->loads[0] = d->loads[1];
        d->loads[1] = 0;
    }
    d->loads[1] = hf_max(d->loads[1], load);
    const hf_real highest = hf_max(d->loads[0], d->loads[1]);
    return hf_was_in_contact(d) &&
           load < hf_max(HF_TOUCH_SHARE * d->smoothed, HF_FALL_SHARE * highest);
}

/* Return how far the normal force fell below that of the first sample. */
static hf_real hf_fall(const hf_real rest[3], const hf_real normal[3])
{
    hf_real fall = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        fall -= rest[axis] * normal[axis];
    }
    return fall;
}

/* Find at the first touch whether taxels are turned: their normal readings rise at some taxels and
 * fall at others as much, as those of magnets of alternating poles, so that F vanishes. */
static void hf_find_poles(const hf_finger *f)
{
    /* Touch: sum |g_i|^2 > (100 noise)^2. With p_i = g_i . n: the sum of p_i^2 that rise, and that
     * of those that fall, are a fifth of both at least, and |F|^2 < sum |g_i|^2, as of one. */
    holdfast_motion *const m = &f->state->motion;
    const hf_real touch = HF_NOISE_WEIGHT * m->taxel_noise;
    if (isinf(m->least_taxel_noise) || m->taxel_load <= touch) {
        return;
    }
    const size_t now = (size_t)((m->n_samples - 1) % (int64_t)HF_N_TRACK(f->hand));
    const hf_normal_sums sums = hf_sum_normals(f, now);
    if (sums.all > touch * touch) {
        const hf_real fallen = sums.squares - sums.risen_squares;
        const bool both = hf_min(sums.risen_squares, fallen) >= HF_TURNED_SHARE * sums.squares;
        m->poles = both && hf_square(f->track[now].force) < sums.all ? HF_OPPOSED : HF_ALIKE;
    }
}

/* Return what the load of relative features shows, and whether the force rests. */
static int hf_contact_by_load(
    const hf_finger *f, holdfast_decision *d, hf_real limit, bool zero_unknown, double time)
{
    /* No contact: load < limit noise, or a small share of the peak. It begins after 0.2 s of that
     * without motion, or once all taxels read what they did in the tare; and ends with the load
     * alone. */
    const holdfast_motion *const m = &f->state->motion;
    const bool is_tared = !zero_unknown && f->hand->tare_kind != HOLDFAST_TARE_NONE;
    if (m->poles == HF_FIRST_TOUCH && is_tared) {
        hf_find_poles(f);
    }
    const hf_real noise = m->poles == HF_OPPOSED ? m->taxel_noise : m->noise;
    const hf_real threshold = limit * noise;
    hf_real peak = m->peak_contact_load;
    /* The tare holds a load that is not known. It shows when it goes: as the fall of the normal
     * force, once that is clearly above the noise. Until then there may be contact. */
    if (zero_unknown) {
        const hf_real fall = hf_fall(m->contact_zero, f->finger->normal);
        if (fall < HF_NOISE_WEIGHT * noise) {
            return HF_IN_CONTACT;
        }
        peak = hf_max(peak, fall);
    }
    /* What a release leaves is no touch until it rises by half: peak >= echo / 0.08. */
    const hf_real load = m->contact_load;
    const hf_real of_echo = hf_was_in_contact(d) ? 0 : d->echo / HF_RELEASED_SHARE;
    const bool is_echo = hf_is_echo(f, d, load, time);
    const bool is_small = hf_is_unloaded(d, load, hf_max(peak, of_echo), threshold);
    if (!is_small && !is_echo) {
        d->loaded_at = time;
        /* Unsteady: |F(k) - F(k - 0.133 s / T)| > max(peak / 4, 16 noise). */
        const hf_real least = hf_max(HF_UNSTEADY_SHARE * peak, HF_UNSTEADY_TO_NOISE * noise);
        return m->moved_by > least ? HF_UNSTEADY : HF_IN_CONTACT;
    }
    const double last = d->loaded_at > m->moved_at ? d->loaded_at : m->moved_at;
    if (d->candidate == HOLDFAST_NO_CONTACT || f->state->is_untouched ||
        time - last > HF_REST_SECONDS) {
        d->echo = hf_was_in_contact(d) ? load : hf_min(d->echo, load);
        return HF_WITHOUT_CONTACT;
    }
    /* A grip was seen: peak >= 100 noise. A stream may begin in contact undeclared. */
    return is_small && peak < HF_NOISE_WEIGHT * noise ? HF_IN_CONTACT : HF_UNSTEADY;
}

/* Return what F_a shows, and whether a share of it rests.
 *
 * A released skin relaxes slowly: its load is a small share of the largest one, and at rest. */
static int hf_contact_by_force(
    const holdfast_decision *d, hf_real load, hf_real threshold, bool zero_unknown, double time)
{
    if (!(threshold > 0 && hf_is_unloaded(d, load, d->peak, threshold))) {
        return HF_IN_CONTACT;
    }
    /* A load below the threshold itself is no contact at once. One below a share of the peak has to
     * rest first, for 0.2 s with the sigma of noise; and so has any load if it counts from the
     * least force so far, because that may still fall. */
    if (time - d->shaken_at > HF_REST_SECONDS ||
        (!zero_unknown && hf_is_unloaded(d, load, 0, threshold))) {
        return HF_WITHOUT_CONTACT;
    }
    return HF_UNSTEADY;
}

static bool hf_is_calm(const holdfast_values *v, hf_real quiet)
{
    return quiet > 0 && v->sigma <= HF_CALM_RATIO * quiet; /* sigma <= 3 sigma_n */
}

/* Return the load of a finger: its force beyond that without contact. Update its peak.
 *
 * quiet: the sigma of noise alone; 0 for a window of two samples. */
static hf_real hf_load_of_force(
    const hf_finger *f, holdfast_decision *d, hf_real quiet, double time)
{
    /* load = |F_tip - rest|, peak(k) = max(load(k), (1 - T / tau) peak(k-1)). */
    hf_real beyond[3];
    for (size_t axis = 0; axis < 3; ++axis) {
        beyond[axis] = f->values->force[axis] - d->rest[axis];
    }
    const hf_real load = hf_sqrt(hf_square(beyond));
    const hf_real lost = hf_min(1, f->hand->period / HF_LOAD_DECAY_SECONDS);
    d->peak = hf_max(load, (1 - lost) * d->peak);
    if (!hf_is_calm(f->values, quiet)) {
        d->shaken_at = time;
    }
    return load;
}

/* Take the force at the least normal force so far as that without contact. */
static void hf_update_rest(const hf_finger *f, holdfast_decision *d)
{
    /* rest = F at the least F . n; at the start rest = 0, the load of the first sample. */
    hf_real least = 0, force = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        least += d->rest[axis] * f->finger->normal[axis];
        force += f->values->force[axis] * f->finger->normal[axis];
    }
    if (force < least) {
        memcpy(d->rest, f->values->force, sizeof d->rest);
    }
}

/* Let the force without contact follow slowly. One of exact zeros does not drift. */
HF_SHARED void hf_follow(const hf_finger *f, hf_real rest[3])
{
    /* rest(k) = rest(k-1) + (T / tau) (F_tip(k) - rest(k-1)). */
    const hf_real share = hf_min(1, f->hand->period / HF_FOLLOW_SECONDS);
    for (size_t axis = 0; axis < 3 && !f->finger->rests_at_zero; ++axis) {
        rest[axis] += share * (f->values->force[axis] - rest[axis]);
    }
}

/* Return whether the load crept over the threshold, slower and calmer than a touch.
 *
 * The rest follows a slower drift, so that its load stays below the threshold. */
static bool hf_has_drifted(
    const hf_finger *f, holdfast_decision *d, hf_real load, hf_real threshold, hf_real quiet,
    double time)
{
    /* mean = sqrt(2) m is the mean of F_a over the window (equation 1); s(k) = s(k-1) +
     * (T / tau) (F_a(k) - s(k-1)). Calm: sigma <= 3 sigma_n and |mean - s| <= threshold / 2. */
    const hf_real amplitude = f->values->amplitude, mean = HF_SQRT_2 * f->values->m;
    const hf_real period = f->hand->period;
    if (isnan(d->smoothed)) {
        d->smoothed = amplitude;
        d->restless_at = time;
    }
    const hf_real away = hf_abs(mean - d->smoothed);
    const bool jumped = hf_abs(amplitude - d->smoothed) > threshold / 2;
    d->smoothed += hf_min(1, period / HF_DRIFT_SECONDS) * (amplitude - d->smoothed);
    const bool calm = hf_is_calm(f->values, quiet) && away <= threshold / 2;
    if (!calm) {
        d->restless_at = time;
    }
    /* A drift comes over the threshold after 1 s of calm and without a jump; a touch does not. */
    if (load < threshold) {
        d->excess = HF_NO_EXCESS;
    } else if (!calm) {
        d->excess = HF_TOUCH;
    } else if (d->excess == HF_NO_EXCESS) {
        const hf_real lasted = (hf_real)(time - d->restless_at) + period / 2;
        d->excess = lasted >= HF_DRIFT_SECONDS && !jumped ? HF_DRIFT : HF_TOUCH;
    }
    return d->excess == HF_DRIFT;
}

/* Return what the force of a finger with features shows. Report a drift of its tare as a fault. */
HF_SHARED int hf_find_contact(
    const hf_finger *f, const holdfast_rule *rule, holdfast_decision *d, bool zero_unknown,
    double time)
{
    if (rule->contact == HOLDFAST_ALWAYS_CONTACT) {
        return HF_IN_CONTACT;
    }
    if (rule->contact == HOLDFAST_CONTACT_BY_LOAD) {
        return hf_contact_by_load(f, d, rule->contact_limit, zero_unknown, time);
    }
    const hf_real noise = f->state->noise;
    const bool by_noise = rule->contact == HOLDFAST_CONTACT_BY_NOISE;
    const hf_real threshold = by_noise ? rule->contact_limit * noise : rule->contact_limit;
    const hf_real quiet = hf_noise_sigma(noise, f->finger->sigma_window);
    if (zero_unknown || f->state->is_rezeroed) { /* first: the load counts from the rest */
        hf_update_rest(f, d);
    }
    const hf_real load = hf_load_of_force(f, d, quiet, time);
    if (zero_unknown) {
        const hf_real fall = hf_fall(d->rest, f->finger->normal);
        if (fall < HF_NOISE_WEIGHT * noise) {
            return HF_IN_CONTACT;
        }
        d->peak = hf_max(d->peak, fall);
    } else if (hf_has_drifted(f, d, load, threshold, quiet, time)) {
        f->values->reason = HOLDFAST_FAULT;
        f->values->faults |= HOLDFAST_TARE_DRIFT;
    }
    return hf_contact_by_force(d, load, threshold, zero_unknown, time);
}
