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
 * half as many changes again (docs/study/tries.md). */
#define HF_FOLLOW_SECONDS ((hf_real)3)
/* Share of the largest load so far that a touch exceeds: a contact begins above 0.12 of it, and
 * ends below 0.08, the echo that a released skin may still show (motion.c). */
#define HF_TOUCH_SHARE ((hf_real)1.5 * HF_RELEASED_SHARE)
/* A force is at rest if it has not moved, or not been shaken, for this time [s]. So long after a
 * release, the echo is below HF_RELEASED_SHARE in 95 % of the cases (docs/study/tries.md). */
#define HF_REST_SECONDS 0.2
/* A force is unsteady while it changes within 0.133 s by more than a quarter of the largest load of
 * the last seconds, and by 16 times its noise. The noise of such a change is 5 standard deviations
 * of a white one times 2.3, the most that was measured on a real sensor; with 10 times, a gripper
 * that held still had 4.5 alarms a minute (decision 12). */
#define HF_UNSTEADY_SHARE ((hf_real)0.25)
#define HF_UNSTEADY_TO_NOISE ((hf_real)16)
/* A finger is calm while sigma is at most this many times the sigma of noise alone. */
#define HF_CALM_RATIO ((hf_real)3)

/* How the load came over the threshold of contact. */
enum { HF_NO_EXCESS, HF_TOUCH, HF_DRIFT };

/* Return whether a load is below the threshold of contact, which is lower while in contact.
 *
 * latest: the state of the last sample, before the minimum duration. */
static bool hf_is_unloaded(hf_real load, hf_real peak, hf_real threshold, int32_t latest)
{
    /* In contact: load < max(0.7 threshold, 0.08 peak); else load < max(threshold, 0.12 peak). */
    if (latest == HOLDFAST_STABLE || latest == HOLDFAST_UNSTABLE) {
        return load < hf_max(HF_CONTACT_RELEASE_RATIO * threshold, HF_RELEASED_SHARE * peak);
    }
    return load < hf_max(threshold, HF_TOUCH_SHARE * peak);
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

/* Return what the load of relative features shows, and whether the force rests. */
static int hf_contact_by_load(
    const hf_finger *f, holdfast_decision *d, hf_real limit, bool zero_unknown, double time)
{
    /* No contact: load < limit noise, or a small share of the peak. It begins after 0.2 s of that
     * without motion, or once all taxels read what they did in the tare; and ends with the load
     * alone. */
    const holdfast_motion *const m = &f->state->motion;
    const hf_real threshold = limit * m->noise;
    hf_real peak = m->peak_contact_load;
    /* The tare holds a load that is not known. It shows when it goes: as the fall of the normal
     * force, once that is clearly above the noise. Until then there may be contact. */
    if (zero_unknown) {
        const hf_real fall = hf_fall(m->contact_zero, f->finger->normal);
        if (fall < HF_NOISE_WEIGHT * m->noise) {
            return HF_IN_CONTACT;
        }
        peak = hf_max(peak, fall);
    }
    if (!hf_is_unloaded(m->contact_load, peak, threshold, d->candidate)) {
        d->loaded_at = time;
        /* Unsteady: |F(k) - F(k - 0.133 s / T)| > max(peak / 4, 16 noise). */
        const hf_real least = hf_max(HF_UNSTEADY_SHARE * peak, HF_UNSTEADY_TO_NOISE * m->noise);
        return m->moved_by > least ? HF_UNSTEADY : HF_IN_CONTACT;
    }
    const double last = d->loaded_at > m->moved_at ? d->loaded_at : m->moved_at;
    if (d->candidate == HOLDFAST_NO_CONTACT || f->state->is_untouched ||
        time - last > HF_REST_SECONDS) {
        return HF_WITHOUT_CONTACT;
    }
    /* A grip was seen: peak >= 100 noise. A stream may begin in contact undeclared. */
    return peak >= HF_NOISE_WEIGHT * m->noise ? HF_UNSTEADY : HF_IN_CONTACT;
}

/* Return what F_a shows, and whether a share of it rests.
 *
 * A released skin relaxes slowly: its load is a small share of the largest one, and at rest. */
static int hf_contact_by_force(
    const holdfast_decision *d, hf_real load, hf_real threshold, bool zero_unknown, double time)
{
    if (!(threshold > 0 && hf_is_unloaded(load, d->peak, threshold, d->candidate))) {
        return HF_IN_CONTACT;
    }
    /* A load below the threshold itself is no contact at once. One below a share of the peak has to
     * rest first, for 0.2 s with the sigma of noise; and so has any load if it counts from the
     * least force so far, because that may still fall. */
    if (time - d->shaken_at > HF_REST_SECONDS ||
        (!zero_unknown && hf_is_unloaded(load, 0, threshold, d->candidate))) {
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

/* Let the force without contact follow slowly. */
HF_SHARED void hf_follow(const hf_finger *f, holdfast_decision *d)
{
    /* rest(k) = rest(k-1) + (T / tau) (F_tip(k) - rest(k-1)). */
    const hf_real share = hf_min(1, f->hand->period / HF_FOLLOW_SECONDS);
    for (size_t axis = 0; axis < 3; ++axis) {
        d->rest[axis] += share * (f->values->force[axis] - d->rest[axis]);
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
