/* Relative features: how force and taxels move, relative to load or noise.
 *
 * They look back by a lag in seconds, and have no unit: counts, newtons, gains and grips cancel, so
 * that they carry over from one hand to another. docs/decisions/0010-relative-features.md says why
 * they are as they are. n is the normal of the patch, g_i the force of taxel i in the fingertip
 * frame, F the fingertip force. */
#include "finger.h"

/* Difference of two spacings, as a share of their sum, up to which they count as equal. */
#define HF_EVEN_STEPS ((hf_real)0.02)
/* A block over which noise is measured has at least this duration [s] and these steps. */
#define HF_NOISE_BLOCK_SECONDS 0.2
#define HF_MIN_BLOCK_STEPS 5
/* A force moves if it changes within this time [s] by this many times its noise. The time is that
 * of a lag of the features, eight samples at 60 Hz. */
#define HF_MOVE_SECONDS 0.133
#define HF_MOVED_TO_NOISE ((hf_real)5)
/* Share of a released force that is normal, at least: friction held the rest. It allows for a
 * friction of 2, and for readings that show shear twice as much. */
#define HF_LEAST_FALL ((hf_real)0.25)
/* Least shift of the centre of pressure, in radii of the patch. */
#define HF_PRESSURE_FLOOR ((hf_real)1e-3)
/* Squared noise of one and of two axes, as a share of that of all three. */
#define HF_ONE_AXIS ((hf_real)1 / (hf_real)3)
#define HF_TWO_AXES ((hf_real)2 / (hf_real)3)
/* Squared noise that is subtracted from a squared change, which has that of two samples: 2, and as
 * much again, because the noise is the least that was measured. */
#define HF_NOISE_SQUARES ((hf_real)4)
/* A change by less than this share of the load counts as none. */
#define HF_LEAST_CHANGE ((hf_real)0.005)

/* Return the index in the ring that lies `back` samples, at most all, before another. */
static inline size_t hf_index_before(const hf_finger *f, size_t now, size_t back)
{
    return now >= back ? now - back : now + HF_N_TRACK(f->hand) - back;
}

/* Return the time of the sample `back` samples before that at an index [s]. */
static inline double hf_time_before(const hf_finger *f, size_t now, size_t back)
{
    return f->track[hf_index_before(f, now, back)].time;
}

/* Compute the change of the fingertip force from one index of the ring to another. */
static void hf_force_between(const hf_finger *f, size_t then, size_t now, hf_real change[3])
{
    for (size_t axis = 0; axis < 3; ++axis) {
        change[axis] = f->track[now].force[axis] - f->track[then].force[axis];
    }
}

/* Return how many samples before the newest that lies which is nearest to a time; 1 or more.
 *
 * n_before: samples before the newest, at least 1.
 * when: the time [s].
 * likely: the number if the samples come at even times, from which the search begins. */
static size_t hf_samples_back(
    const hf_finger *f, size_t now, size_t n_before, double when, size_t likely)
{
    size_t back = likely < n_before ? likely : n_before;
    back = back > 1 ? back : 1;
    while (back < n_before && hf_time_before(f, now, back) > when) {
        ++back;
    }
    while (back > 1 && hf_time_before(f, now, back - 1) <= when) {
        --back;
    }
    /* t(back) <= when < t(back - 1), as far as there are samples: the nearer; of equals the
     * likely. */
    const double older = hf_time_before(f, now, back), newer = hf_time_before(f, now, back - 1);
    bool is_newer = newer - when < when - older;
    if (fabs((newer - when) - (when - older)) <= (double)HF_EVEN_STEPS * (newer - older)) {
        is_newer = likely < back;
    }
    return is_newer && back > 1 ? back - 1 : back;
}

/* Append forces, centre of pressure and moment of a sample to the ring, and the squares of its step
 * to the block over which the noise is measured. The ring starts again after a gap that is not
 * bridged. Compute F_tip, and return the sum of the normal readings. */
HF_SHARED hf_real hf_append_taxels(const hf_finger *f, double time, hf_real force[3])
{
    holdfast_motion *const m = &f->state->motion;
    const size_t length = HF_N_TRACK(f->hand);
    size_t now = (size_t)(m->n_samples % (int64_t)length);
    const size_t before = hf_index_before(f, now, 1);
    const hf_real elapsed = (hf_real)(time - f->track[before].time);
    const hf_real limit = HF_GAP_LIMIT_PERIODS * f->hand->period;
    if (m->n_samples > 0 && elapsed > hf_max(limit, HF_MAX_BRIDGED_SECONDS)) {
        now = 0;
        m->n_samples = 0;
    }
    const bool has_previous = m->n_samples > 0;
    const hf_taxel_sums sums = hf_turn_taxels(f, now, before);
    holdfast_track *const track = &f->track[now];
    const hf_real weight = hf_max(sums.weight, HF_TINY);
    m->n_samples += 1;
    track->time = time;
    hf_real centre[3] = {0, 0, 0};
    track->moment = f->hand->has_centres ? hf_moment(f, now, centre) : 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        track->force[axis] = force[axis] = sums.force[axis];
        track->pressure[axis] = centre[axis] / weight;
    }
    m->taxel_load = hf_sqrt(sums.squares);
    /* Sums over the block: squares of steps of F and of all g_i. Repeated samples do not count, nor
     * steps over a gap that is bridged, in which the force may change; nor samples whose noise went
     * out with a field. */
    if (!has_previous) {
        m->block_squares = m->block_taxel_squares = 0;
        m->block_steps = 0;
        m->block_start = NAN;
    } else if (f->state->n_unchanged == 0 && elapsed <= limit && !f->state->has_new_field) {
        hf_real step[3];
        hf_force_between(f, before, now, step);
        m->block_squares += hf_square(step);
        m->block_taxel_squares += sums.moved;
        m->block_steps += 1;
    }
    return sums.normal;
}

/* Return the noise of F_tip, and of all taxels, by the rounding of the readings: step / sqrt(12) of
 * each. Where a reading without contact is exactly 0, only the others are rounded. */
static hf_real hf_rounding(const hf_finger *f)
{
    int64_t n_rounded = 0;
    for (size_t i = 0; i < 3 * f->n; ++i) {
        n_rounded += f->readings[i] != 0;
    }
    return f->finger->step_noise * hf_sqrt((hf_real)n_rounded);
}

/* Update the noise: the least mean square step over blocks, halved, and its root. */
static void hf_update_noise(const hf_finger *f, double time)
{
    holdfast_motion *const m = &f->state->motion;
    m->rounding = f->finger->rests_at_zero ? hf_rounding(f) : 0;
    if (isnan(m->block_start)) {
        m->block_start = time;
    }
    /* Three components, each with at least the noise of rounding. */
    const hf_real floor = hf_sqrt(3) * f->finger->min_noise;
    const hf_real steps = (hf_real)m->block_steps;
    if (m->block_steps == 0) {
        if (isinf(m->least_noise)) {
            m->noise = m->taxel_noise = floor;
        }
        return;
    }
    /* noise = sqrt(sum |F(k) - F(k-1)|^2 / (2 n)) over a block of n steps; the same for taxels. */
    const hf_real force = hf_max(hf_sqrt(m->block_squares / (2 * steps)), floor);
    const hf_real taxels = hf_max(hf_sqrt(m->block_taxel_squares / (2 * steps)), floor);
    if (time - m->block_start >= HF_NOISE_BLOCK_SECONDS && m->block_steps >= HF_MIN_BLOCK_STEPS) {
        /* The least over the blocks that are complete. */
        m->least_noise = hf_min(m->least_noise, force);
        m->least_taxel_noise = hf_min(m->least_taxel_noise, taxels);
        m->block_squares = m->block_taxel_squares = 0;
        m->block_steps = 0;
        m->block_start = time;
    }
    const bool known = !isinf(m->least_noise);
    m->noise = known ? m->least_noise : force;
    m->taxel_noise = known ? m->least_taxel_noise : taxels;
}

/* Compute a force beyond another. */
static void hf_beyond(const hf_real force[3], const hf_real zero[3], hf_real beyond[3])
{
    for (size_t axis = 0; axis < 3; ++axis) {
        beyond[axis] = force[axis] - zero[axis];
    }
}

/* Update the reference, and the load beyond it.
 *
 * A skin can only be pressed. So the least normal force since the start belongs to the least load
 * that is known, whatever the load was when the tare was taken. */
static void hf_update_load(const hf_finger *f, size_t now, hf_real keep)
{
    holdfast_motion *const m = &f->state->motion;
    const hf_real *const force = f->track[now].force;
    /* The reference: F and g_i at the least F . n so far. */
    const hf_real normal = hf_dot(force, f->finger->normal);
    if (normal < m->least_normal) {
        m->least_normal = normal;
        for (size_t axis = 0; axis < 3; ++axis) {
            m->reference[axis] = force[axis];
        }
        memcpy(f->reference, hf_forces_at(f, now), 3 * f->n * sizeof(hf_real));
        m->taxel_load = 0;
    }
    /* load = |F - F_ref|, peak(k) = max(load(k), exp(-step / tau) peak(k-1)); the same for
     * taxels. */
    hf_real beyond[3];
    hf_beyond(force, m->reference, beyond);
    m->load = hf_sqrt(hf_square(beyond));
    m->peak_load = hf_max(m->load, keep * m->peak_load);
    m->peak_taxel_load = hf_max(m->taxel_load, keep * m->peak_taxel_load);
}

/* Return whether a force below that without contact is that of a skin which was let go. */
static bool hf_is_release(const hf_finger *f, size_t now, hf_real normal)
{
    /* Friction held what fell: -F . n >= 1/4 |F|. And what rises is at most an echo:
     * sum max(g_i . n, 0) <= 0.08 sum max(-g_i . n, 0). */
    const hf_real square = hf_square(f->track[now].force);
    if (normal * normal < HF_LEAST_FALL * HF_LEAST_FALL * square) {
        return false;
    }
    const hf_real risen = hf_sum_normals(f, now).risen;
    return risen <= HF_RELEASED_SHARE * (risen - normal);
}

/* Update the force without contact, and the load beyond it, by which contact is decided.
 *
 * A shear draws the normal force of a magnetic skin below that of the tare, while it is held. So
 * only a release counts: of a tare under load, all taxels fall. */
static void hf_update_contact_load(const hf_finger *f, size_t now, hf_real keep)
{
    holdfast_motion *const m = &f->state->motion;
    const hf_real *const force = f->track[now].force;
    /* zero: F at the least F . n so far of a release. */
    const hf_real normal = hf_dot(force, f->finger->normal);
    if (f->state->has_new_field) { /* all taxels are at their tare: what fell was the field */
        hf_fill(m->contact_zero, 3, 0);
    }
    if (normal < hf_dot(m->contact_zero, f->finger->normal) && hf_is_release(f, now, normal)) {
        for (size_t axis = 0; axis < 3; ++axis) {
            m->contact_zero[axis] = force[axis];
        }
    }
    /* load = |F - zero|, or sqrt(sum |g_i|^2) of taxels that are turned; peak as above. */
    hf_real beyond[3];
    hf_beyond(force, m->contact_zero, beyond);
    const bool opposed = m->poles == HF_OPPOSED;
    m->contact_load = hf_sqrt(opposed ? hf_sum_normals(f, now).all : hf_square(beyond));
    m->peak_contact_load = hf_max(m->contact_load, keep * m->peak_contact_load);
}

/* Note how far the force moved, and when: by much more than its noise, and than an echo. */
static void hf_update_movement(const hf_finger *f, size_t now, size_t n_before, double time)
{
    holdfast_motion *const m = &f->state->motion;
    /* moved = |F(k) - F(k - MOVE_SECONDS / T)| > max(5 noise, 0.08 peak): the force moves. */
    const size_t likely = (size_t)lrint(HF_MOVE_SECONDS / (double)f->hand->period);
    size_t back = likely < n_before ? likely : n_before;
    if (back > 0) {
        back = hf_samples_back(f, now, n_before, time - HF_MOVE_SECONDS, back);
    }
    hf_real change[3];
    hf_force_between(f, hf_index_before(f, now, back), now, change);
    m->moved_by = hf_sqrt(hf_square(change));
    if (m->moved_by > hf_max(HF_MOVED_TO_NOISE * m->noise, HF_RELEASED_SHARE * m->peak_load)) {
        m->moved_at = time;
    }
}

/* Return what a change is divided by. */
static hf_real hf_load_floor(hf_real peak, hf_real noise)
{
    return peak + HF_NOISE_WEIGHT * noise; /* L = peak + 100 noise */
}

/* Return log(v / load) of a change v, given v^2 with noise; at least log(LEAST_CHANGE). */
static hf_real hf_relative(hf_real square, hf_real noise_square, hf_real load)
{
    /* log sqrt(max(v^2 - 4 noise^2, 0) / L^2 + LEAST_CHANGE^2). */
    const hf_real change = hf_max(square - HF_NOISE_SQUARES * noise_square, 0);
    return hf_log(change / (load * load) + HF_LEAST_CHANGE * HF_LEAST_CHANGE) / 2;
}

/* Fill the changes over one lag. */
static void hf_fill_changes(
    const hf_finger *f, size_t now, size_t then, hf_real load_to_noise, hf_real *out)
{
    const holdfast_motion *const m = &f->state->motion;
    /* Without noise at rest, the least is that of the first touch: few readings are rounded. */
    const hf_real noise = hf_max(m->noise, m->rounding);
    const hf_real taxel_noise = hf_max(m->taxel_noise, m->rounding);
    const hf_real echo = taxel_noise * taxel_noise;
    const hf_real load = hf_load_floor(m->peak_load, noise);
    const hf_real taxel_load = hf_load_floor(m->peak_taxel_load, taxel_noise);
    /* v = |dF| and |dF - (dF . n) n|, over L. */
    hf_real change[3], mean[3], shift[3];
    hf_force_between(f, then, now, change);
    const hf_real across = hf_dot(change, f->finger->normal), square = hf_square(change);
    out[HF_FORCE_CHANGE] = hf_relative(square, noise * noise, load);
    out[HF_SHEAR_CHANGE] = hf_relative(square - across * across, HF_TWO_AXES * noise * noise, load);
    /* v = sqrt(sum |dg_i - mean dg|^2), whole and across the normal, over the taxels' L. */
    for (size_t axis = 0; axis < 3; ++axis) {
        mean[axis] = change[axis] / f->finger->n_used;
    }
    const hf_residual rest = hf_residual_of(f, now, then, mean);
    out[HF_RESIDUAL] = hf_relative(rest.moved, echo, taxel_load);
    out[HF_SHEAR_RESIDUAL] = hf_relative(rest.moved - rest.pressed, HF_TWO_AXES * echo, taxel_load);
    /* log(|dc| + PRESSURE_FLOOR), with the centre of pressure c. */
    hf_beyond(f->track[now].pressure, f->track[then].pressure, shift);
    out[HF_PRESSURE_SHIFT] = hf_log(hf_sqrt(hf_square(shift)) + HF_PRESSURE_FLOOR);
    /* v = |d moment|, over L. */
    const hf_real turned = f->track[now].moment - f->track[then].moment;
    out[HF_MOMENT_CHANGE] = hf_relative(turned * turned, HF_ONE_AXIS * echo, load);
    out[HF_LOAD_TO_NOISE] = load_to_noise;
}

/* Return the three samples of a second difference.
 *
 * The third lies as long before the second as the second before the newest. A gap, or uneven times,
 * move it; the weights then let an even motion cancel, as it does at even times. */
static hf_second hf_second_of(const hf_finger *f, size_t now, size_t back, size_t n_before)
{
    hf_second second = {now, now, now, 1, 1};
    if (n_before < 2) {
        return second; /* no difference yet */
    }
    const double newest = f->track[now].time;
    double middle = hf_time_before(f, now, back);
    const double oldest = hf_time_before(f, now, n_before);
    if (2 * middle - newest < oldest - (newest - middle) / 2 / (double)back) {
        /* The windows are filled in part. */
        back = back < n_before / 2 ? back : n_before / 2;
        middle = hf_time_before(f, now, back);
    }
    const size_t further = hf_samples_back(f, now, n_before, 2 * middle - newest, 2 * back);
    second.before = hf_index_before(f, now, back);
    second.first = hf_index_before(f, now, further > back ? further : back + 1);
    /* h = t(k) - t(k-s), h' = t(k-s) - t(k-2s): a = 2 h' / (h + h'), c = 2 h / (h + h'). */
    const double later = newest - middle, earlier = middle - f->track[second.first].time;
    const double whole = later + earlier;
    if (!(fabs(later - earlier) <= (double)HF_EVEN_STEPS * whole)) {
        second.newest = (hf_real)(2 * earlier / whole);
        second.oldest = (hf_real)(2 * later / whole);
    }
    return second;
}

/* Compute the relative features of a finger, after `hf_append_taxels`. */
HF_SHARED void hf_update_motion(const hf_finger *f, double time)
{
    const holdfast_hand *const hand = f->hand;
    const size_t length = HF_N_TRACK(hand);
    const int64_t n = f->state->motion.n_samples;
    const size_t now = (size_t)((n - 1) % (int64_t)length);
    const size_t n_before = n < (int64_t)length ? (size_t)(n - 1) : length - 1;
    const hf_real step = n < 2 ? hand->period : (hf_real)(time - hf_time_before(f, now, 1));
    const hf_real keep = hf_exp(-step / HF_LOAD_DECAY_SECONDS);
    hf_update_noise(f, time);
    hf_update_load(f, now, keep);
    hf_update_contact_load(f, now, keep);
    hf_update_movement(f, now, n_before, time);
    if (HF_N_SLIDES(hand) > 0) {
        hf_append_slide(f, now, time, step);
    }
    if (n < 2) {
        hf_fill(f->relative, HF_N_LAGS(hand) * HOLDFAST_N_RELATIVE, HF_NAN);
        hf_fill(f->averages, HF_N_LAGS(hand) * HF_N_AVERAGES, HF_NAN);
        return;
    }
    /* log(L / noise): the same for all lags. */
    const holdfast_motion *const m = &f->state->motion;
    const hf_real noise = hf_max(m->noise, m->rounding);
    const hf_real load_to_noise =
        hand->has_centres ? hf_log(hf_load_floor(m->peak_load, noise) / noise) : HF_NAN;
    for (size_t i = 0; i < HF_N_LAGS(hand); ++i) {
        const holdfast_lag *const lag = &hand->lags[i];
        hf_real *const out = f->relative + i * HOLDFAST_N_RELATIVE;
        const size_t back = hf_samples_back(f, now, n_before, time - lag->seconds, lag->samples);
        const size_t then = hf_index_before(f, now, back);
        if (lag->has_changes) {
            hf_fill_changes(f, now, then, load_to_noise, out);
        }
        if (lag->sliding) {
            hf_fill_slide(f, lag, now, then, out);
        }
        if (lag->sliding >> (HF_FAST - HF_FIRST_SLIDING) != 0) {
            const hf_second at = hf_second_of(f, now, back, n_before);
            hf_fill_energies(f, lag->sliding, at, step, f->averages + i * HF_N_AVERAGES, out);
        }
    }
}
