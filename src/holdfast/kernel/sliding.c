/* Features of sliding: signs, ratios and shares, by which a slip differs from a press.
 *
 * They have no unit. Of taxel i, y_i = f_i - b_i is the reading beyond the tare in its own frame,
 * N_i = (y_i)_z, T_i = (y_i)_xy, and w_i = |N_i| / sum |N_j| its share of the load. F is the
 * fingertip force, F_z = F . n, F_t = F - F_z n, s the noise of a reading, m the number of taxels,
 * and L = max(sum |N_i|, 10 s sqrt(m)). docs/decisions/0019 lists all. */
#include "finger.h"

/* Least load in a denominator: of a finger, by s sqrt(m), and of a taxel, by s. */
#define HF_LEAST_LOAD ((hf_real)10)
#define HF_LEAST_TAXEL_LOAD ((hf_real)5)
/* A larger ratio of shear to normal force is that of an unloaded taxel. */
#define HF_MAX_FRICTION ((hf_real)5)
/* A taxel's shear falls or rises by more than this many times the noise. */
#define HF_SHARE_NOISE ((hf_real)2)
/* Least shift of the centre of pressure, in radii of the patch. */
#define HF_SHIFT_FLOOR ((hf_real)1e-3)
/* Blocks a second of which the largest friction is kept. */
#define HF_BLOCKS_PER_SECOND 16.0
/* Time constant of an average of the friction [s]. An average over 20 ms has the same mean delay
 * and the same noise, and so have those of the energies of 30, 100 and 400 ms. */
#define HF_FRICTION_SECONDS ((hf_real)0.01)
static const hf_real HF_ENERGY_SECONDS[HF_N_ENERGY_TIMES] = {
    (hf_real)0.015, (hf_real)0.05, (hf_real)0.2};

/* Return whether one of the kinds from `first` to `last` is needed. */
static inline bool hf_needs(uint64_t kinds, int first, int last)
{
    const uint64_t some = ((uint64_t)2 << (last - first)) - 1;
    return (kinds >> (first - HF_FIRST_SLIDING) & some) != 0;
}

/* All parts of a sum over taxels, in as many vectors as they need. A loop that adds to all of them
 * does not wait for its last sum, as one over a part of the lanes does. */
enum { HF_N_WIDE = HF_LANES / HF_WIDTH };
typedef struct {
    hf_wide part[HF_N_WIDE];
} hf_parts;

static inline hf_parts hf_no_parts(void)
{
    const hf_wide none = {0};
    hf_parts parts;
    for (size_t l = 0; l < HF_N_WIDE; ++l) {
        parts.part[l] = none;
    }
    return parts;
}

static inline hf_real hf_total_of(const hf_parts *parts)
{
    hf_sum sum;
    for (size_t l = 0; l < HF_N_WIDE; ++l) {
        hf_put(&sum, l * HF_WIDTH, parts->part[l]);
    }
    return hf_total(sum);
}

/* Return y_i (3, n) of a sample in the ring. */
static inline hf_real *hf_slide_at(const hf_finger *f, size_t index)
{
    return f->slides + index * 3 * HF_N_LANES(f->hand);
}

/* Return the share of a new value in a mean over some time, after a step in time. */
static inline hf_real hf_gain(hf_real step, hf_real seconds)
{
    return step / (step + seconds);
}

static inline hf_real hf_smoothed(hf_real mean, hf_real value, hf_real gain)
{
    return isnan(mean) ? value : mean + gain * (value - mean); /* a(k-1) + gain (v(k) - a(k-1)) */
}

/* Return the kinds of sliding that some lag needs. */
static inline uint64_t hf_kinds_of_sliding(const holdfast_hand *hand)
{
    uint64_t kinds = 0;
    for (size_t i = 0; i < HF_N_LAGS(hand); ++i) {
        kinds |= hand->lags[i].sliding;
    }
    return kinds;
}

/* Store y_i and |N_i|; return sum |N_i|. */
static hf_real hf_store_slide(const hf_finger *f, size_t now)
{
    const size_t n = f->n;
    hf_real *const own = hf_slide_at(f, now), *const shares = f->shares;
    hf_parts load = hf_no_parts();
    for (size_t i = 0; i < n;) {
        for (size_t l = 0; l < HF_N_WIDE; ++l, i += HF_WIDTH) {
            const hf_vectors v =
                hf_minus(hf_load_vectors(f->readings, n, i), hf_load_vectors(f->baseline, n, i));
            const hf_wide pressed = hf_wide_abs(v.z - hf_load(shares + 3 * n + i));
            hf_store(own + i, v.x);
            hf_store(own + n + i, v.y);
            hf_store(own + 2 * n + i, v.z);
            hf_store(shares + i, pressed);
            load.part[l] += pressed;
        }
    }
    return hf_total_of(&load);
}

/* Store the squares of |T_i| + 2 s and of max(|T_i| - 2 s, 0); return
 * sum |N_i| min(|T_i| / max(|N_i|, 5 s), 5). */
static hf_real hf_sum_shears(const hf_finger *f, size_t now, hf_real s)
{
    const size_t n = f->n;
    const hf_real *const own = hf_slide_at(f, now);
    hf_real *const shares = f->shares;
    const hf_wide none = {0}, band = none + HF_SHARE_NOISE * s;
    const hf_wide least = none + HF_LEAST_TAXEL_LOAD * s, most = none + HF_MAX_FRICTION;
    hf_parts friction = hf_no_parts();
    for (size_t i = 0; i < n;) {
        for (size_t l = 0; l < HF_N_WIDE; ++l, i += HF_WIDTH) {
            const hf_wide x = hf_load(own + i), y = hf_load(own + n + i);
            const hf_wide pressed = hf_load(shares + i), shear = hf_root(x * x + y * y);
            const hf_wide low = hf_greater(shear - band, none), high = shear + band;
            hf_store(shares + n + i, high * high);
            hf_store(shares + 2 * n + i, low * low);
            friction.part[l] += pressed * hf_smaller(shear / hf_greater(pressed, least), most);
        }
    }
    return hf_total_of(&friction);
}

/* Fill sum |N_i| r_i. */
static void hf_sum_centre(const hf_finger *f, hf_real sums[3])
{
    const size_t n = f->n;
    hf_parts cx = hf_no_parts(), cy = cx, cz = cx;
    for (size_t i = 0; i < n;) {
        for (size_t l = 0; l < HF_N_WIDE; ++l, i += HF_WIDTH) {
            const hf_vectors r = hf_load_vectors(f->positions, n, i);
            const hf_wide pressed = hf_load(f->shares + i);
            cx.part[l] += pressed * r.x;
            cy.part[l] += pressed * r.y;
            cz.part[l] += pressed * r.z;
        }
    }
    sums[0] = hf_total_of(&cx);
    sums[1] = hf_total_of(&cy);
    sums[2] = hf_total_of(&cz);
}

/* Return how many whole blocks of time a number is, from 1 to those that are kept. */
static size_t hf_n_blocks(double blocks)
{
    const size_t most = HF_N_FRICTION_BLOCKS;
    if (blocks >= (double)most) {
        return most;
    }
    return blocks > 1 ? (size_t)blocks : 1;
}

/* Add the friction to the largest of its block of time. `past[j]` is the largest of the j blocks
 * before this one: so many blocks suffice at any rate. */
static void hf_note_friction(holdfast_slide *m, double time)
{
    const double passed = floor((time - m->block_start) * HF_BLOCKS_PER_SECOND);
    if (passed >= 1) {
        const size_t n = hf_n_blocks(passed);
        for (size_t j = HF_N_FRICTION_BLOCKS; j-- > n;) {
            m->past[j] = hf_max(m->past[j - n], m->largest);
        }
        hf_fill(m->past, n, 0); /* blocks without a sample */
        m->block_start += passed / HF_BLOCKS_PER_SECOND;
        m->largest = 0;
    }
    m->largest = hf_max(m->largest, m->friction);
}

/* Return the friction as a share of the largest of some seconds; 0 without shear. */
static hf_real hf_margin(const holdfast_slide *m, double seconds)
{
    const size_t n = hf_n_blocks(seconds * HF_BLOCKS_PER_SECOND + 0.5);
    return m->friction / hf_max(hf_max(m->past[n - 1], m->largest), HF_TINY);
}

/* Store N_i at the least F . n so far, if this is it: where the readings without contact are not
 * known, N_i counts from there. A skin can only be pressed. */
static void hf_note_least(const hf_finger *f, hf_real normal)
{
    if (normal > f->state->motion.least_normal) {
        return;
    }
    for (size_t i = 2 * f->n; i < 3 * f->n; ++i) {
        f->shares[f->n + i] = f->readings[i] - f->baseline[i];
    }
}

/* Append a sample to the rings: y_i, |F|, the frictions, the centre of pressure; and update s, L,
 * the tangent and the largest friction. After `hf_append_taxels` and the noise. */
HF_SHARED void hf_append_slide(const hf_finger *f, size_t now, double time, hf_real step)
{
    holdfast_slide *const m = &f->state->slide;
    holdfast_track *const track = &f->track[now];
    const hf_real n_used = hf_max(f->finger->n_used, 1);
    /* s = max(noise of all taxels / sqrt(3 m), that of the sensor's step). */
    const hf_real of_taxel = f->state->motion.taxel_noise / hf_sqrt(3 * n_used);
    m->noise = hf_max(of_taxel, f->finger->step_noise);
    m->force_noise = m->noise * hf_sqrt(n_used);
    const hf_real normal = hf_dot(track->force, f->finger->normal);
    if (f->hand->zero_unknown) {
        hf_note_least(f, normal);
    }
    const uint64_t kinds = hf_kinds_of_sliding(f->hand);
    const hf_real load = hf_store_slide(f, now), least = HF_LEAST_LOAD * m->force_noise;
    m->weight = hf_max(load, HF_TINY);
    m->load = hf_max(load, least);
    hf_real friction = 0, centre[3] = {0};
    if (hf_needs(kinds, HF_FALLING_SHARE, HF_RISING_SHARE) ||
        hf_needs(kinds, HF_TAXEL_FRICTION, HF_TAXEL_FRICTION) ||
        hf_needs(kinds, HF_TAXEL_FRICTION_RISE, HF_TAXEL_FRICTION_RISE)) {
        friction = hf_sum_shears(f, now, m->noise);
    }
    if (hf_needs(kinds, HF_CENTRE_SHIFT, HF_CENTRE_SHIFT)) {
        hf_sum_centre(f, centre);
    }
    /* F_t / |F_t|, r = min(|F_t| / max(|F_z|, 10 s sqrt(m)), 5), and the same of the taxels by w;
     * c = sum w_i r_i. */
    hf_real shear[3];
    for (size_t axis = 0; axis < 3; ++axis) {
        shear[axis] = track->force[axis] - normal * f->finger->normal[axis];
        track->centre[axis] = centre[axis] / m->weight;
    }
    const hf_real size = hf_sqrt(hf_square(shear));
    for (size_t axis = 0; axis < 3; ++axis) {
        m->tangent[axis] = shear[axis] / hf_max(size, HF_TINY);
    }
    track->friction = hf_min(size / hf_max(hf_abs(normal), least), HF_MAX_FRICTION);
    track->taxel_friction = friction / m->weight;
    track->amplitude = hf_sqrt(hf_square(track->force));
    if (f->state->motion.n_samples == 1) {
        hf_fill(m->past, HF_N_FRICTION_BLOCKS, 0);
        m->friction = HF_NAN;
        m->largest = 0;
        m->block_start = time;
    }
    if (hf_needs(kinds, HF_FRICTION_MARGIN, HF_FRICTION_MARGIN)) {
        m->friction = hf_smoothed(
            m->friction, track->friction, hf_gain(step, HF_FRICTION_SECONDS));
        hf_note_friction(m, time);
    }
}

/* Sums over the changes of the taxels over a lag. */
typedef struct {
    hf_real mean[2]; /* sum |N_i| dT_i */
    hf_real squares; /* sum |N_i| |dT_i|^2 */
    hf_real pressed; /* sum dN_i^2 */
    hf_real falling; /* sum |N_i| over the taxels with d|T_i| < -2 s */
    hf_real rising;  /* the same with d|T_i| > 2 s */
} hf_change_sums;

static hf_change_sums hf_sum_changes(const hf_finger *f, size_t now, size_t then)
{
    const size_t n = f->n;
    const hf_real *const own = hf_slide_at(f, now), *const old = hf_slide_at(f, then);
    const hf_real *const shares = f->shares;
    const hf_wide none = {0};
    hf_parts wx = hf_no_parts(), wy = wx, squares = wx, pressed = wx, falls = wx, rises = wx;
    for (size_t i = 0; i < n;) {
        for (size_t l = 0; l < HF_N_WIDE; ++l, i += HF_WIDTH) {
            const hf_vectors before = hf_load_vectors(old, n, i);
            const hf_vectors d = hf_minus(hf_load_vectors(own, n, i), before);
            const hf_wide w = hf_load(shares + i), x = w * d.x, y = w * d.y;
            const hf_wide square = before.x * before.x + before.y * before.y;
            wx.part[l] += x;
            wy.part[l] += y;
            squares.part[l] += x * d.x + y * d.y;
            pressed.part[l] += d.z * d.z;
            falls.part[l] += hf_where(square > hf_load(shares + n + i), w, none);
            rises.part[l] += hf_where(square < hf_load(shares + 2 * n + i), w, none);
        }
    }
    const hf_change_sums sums = {
        {hf_total_of(&wx), hf_total_of(&wy)}, hf_total_of(&squares), hf_total_of(&pressed),
        hf_total_of(&falls), hf_total_of(&rises)};
    return sums;
}

/* Fill what compares the taxels over a lag. */
static void hf_fill_spread(
    const hf_finger *f, uint64_t kinds, size_t now, size_t then, hf_real *out)
{
    const holdfast_slide *const m = &f->state->slide;
    const hf_real n_used = hf_max(f->finger->n_used, 1), by_load = n_used / m->load;
    const hf_real share = 1 / m->weight;
    const hf_change_sums sums = hf_sum_changes(f, now, then);
    if (hf_needs(kinds, HF_DIVERGENCE, HF_RELATIVE_DIVERGENCE)) {
        /* u = sum w_i dT_i, v = sqrt(sum w_i |dT_i|^2 - |u|^2): log((v + s) m / L) and
         * log((v + s) / (|u| + s)). */
        const hf_real x = share * sums.mean[0], y = share * sums.mean[1];
        const hf_real square = x * x + y * y;
        const hf_real spread = hf_sqrt(hf_max(share * sums.squares - square, 0)) + m->noise;
        if (hf_needs(kinds, HF_DIVERGENCE, HF_DIVERGENCE)) {
            out[HF_DIVERGENCE] = hf_log(spread * by_load);
        }
        if (hf_needs(kinds, HF_RELATIVE_DIVERGENCE, HF_RELATIVE_DIVERGENCE)) {
            out[HF_RELATIVE_DIVERGENCE] = hf_log(spread / (hf_sqrt(square) + m->noise));
        }
    }
    if (hf_needs(kinds, HF_NORMAL_DIVERGENCE, HF_NORMAL_DIVERGENCE)) {
        /* log((sqrt(sum dN_i^2 / m) + s) m / L). */
        const hf_real change = hf_sqrt(sums.pressed / n_used);
        out[HF_NORMAL_DIVERGENCE] = hf_log((change + m->noise) * by_load);
    }
    out[HF_FALLING_SHARE] = share * sums.falling;
    out[HF_RISING_SHARE] = share * sums.rising;
}

/* Fill the changes of the force, of its friction and of the centre of pressure over a lag. */
static void hf_fill_steps(
    const hf_finger *f, uint64_t kinds, const holdfast_track *now, const holdfast_track *then,
    hf_real *out)
{
    const holdfast_slide *const m = &f->state->slide;
    const hf_real share = 1 / m->load;
    hf_real change[3], shift[3];
    for (size_t axis = 0; axis < 3; ++axis) {
        change[axis] = now->force[axis] - then->force[axis];
        shift[axis] = now->centre[axis] - then->centre[axis];
    }
    const hf_real across = hf_dot(change, f->finger->normal);
    if (hf_needs(kinds, HF_SHEAR_BY_LOAD, HF_SHEAR_BY_LOAD)) {
        /* log((|dF_t| + s sqrt(m)) / L). */
        const hf_real square = hf_max(hf_square(change) - across * across, 0);
        out[HF_SHEAR_BY_LOAD] = hf_log((hf_sqrt(square) + m->force_noise) * share);
    }
    if (hf_needs(kinds, HF_CENTRE_SHIFT, HF_CENTRE_SHIFT)) {
        out[HF_CENTRE_SHIFT] = hf_log(hf_sqrt(hf_square(shift)) + HF_SHIFT_FLOOR); /* log |dc| */
    }
    /* dF_z / L, d|F| / L, dr, that of the taxels, and dF_t . F_t / (|F_t| L). */
    out[HF_NORMAL_BY_LOAD] = across * share;
    out[HF_FORCE_BY_LOAD] = (now->amplitude - then->amplitude) * share;
    out[HF_FRICTION_RISE] = now->friction - then->friction;
    out[HF_TAXEL_FRICTION_RISE] = now->taxel_friction - then->taxel_friction;
    out[HF_ALIGNMENT] = hf_dot(change, m->tangent) * share;
}

/* Fill the sums over the fast changes of the taxels, divided by their number: of first differences
 * of T, and of second differences of T, of N, of both, and of T about its mean. */
static void hf_sum_fast(const hf_finger *f, hf_second at, hf_real energies[HF_N_ENERGIES])
{
    const size_t n = f->n;
    const hf_real *const own = hf_slide_at(f, at.now), *const mid = hf_slide_at(f, at.before);
    const hf_real *const old = hf_slide_at(f, at.first);
    const hf_real a = at.newest, c = at.oldest;
    hf_parts first = hf_no_parts(), shear = first, normal = first, mx = first, my = first;
    for (size_t i = 0; i < n;) {
        for (size_t l = 0; l < HF_N_WIDE; ++l, i += HF_WIDTH) {
            const hf_vectors middle = hf_load_vectors(mid, n, i);
            const hf_vectors d = hf_minus(hf_load_vectors(own, n, i), middle);
            const hf_vectors e = hf_minus(middle, hf_load_vectors(old, n, i));
            /* a y(k) - 2 y(k-s) + c y(k-2s), as a + c = 2. */
            const hf_vectors second = {a * d.x - c * e.x, a * d.y - c * e.y, a * d.z - c * e.z};
            first.part[l] += d.x * d.x + d.y * d.y;
            shear.part[l] += second.x * second.x + second.y * second.y;
            normal.part[l] += second.z * second.z;
            mx.part[l] += second.x;
            my.part[l] += second.y;
        }
    }
    const hf_real share = 1 / hf_max(f->finger->n_used, 1);
    const hf_real mean[2] = {share * hf_total_of(&mx), share * hf_total_of(&my)};
    energies[0] = share * hf_total_of(&first);
    energies[1] = share * hf_total_of(&shear);
    energies[2] = share * hf_total_of(&normal);
    energies[3] = energies[1] + energies[2];
    energies[4] = hf_max(energies[1] - (mean[0] * mean[0] + mean[1] * mean[1]), 0);
}

/* Fill the energies of the fast changes, and their averages, that some finger needs. */
HF_SHARED void hf_fill_energies(
    const hf_finger *f, uint64_t kinds, hf_second at, hf_real step, hf_real *averages,
    hf_real *out)
{
    hf_real energies[HF_N_ENERGIES];
    hf_sum_fast(f, at, energies);
    const hf_real share = 1 / (f->state->slide.noise * f->state->slide.noise);
    for (int j = 0; j <= HF_N_ENERGY_TIMES; ++j) {
        const hf_real gain = j > 0 ? hf_gain(step, HF_ENERGY_SECONDS[j - 1]) : 1;
        for (int i = 0; i < HF_N_ENERGIES; ++i) {
            const int kind = HF_FAST + j * HF_N_ENERGIES + i;
            if (hf_needs(kinds, kind, kind)) {
                hf_real *const mean = j > 0 ? &averages[(j - 1) * HF_N_ENERGIES + i] : &energies[i];
                if (j > 0) {
                    *mean = hf_smoothed(*mean, energies[i], gain);
                }
                out[kind] = hf_log(1 + share * *mean) / 2; /* log sqrt(1 + v^2 / s^2) */
            }
        }
    }
}

/* Fill the features of sliding over one lag that some finger needs, but for the energies. */
HF_SHARED void hf_fill_slide(
    const hf_finger *f, const holdfast_lag *lag, size_t now, size_t then, hf_real *out)
{
    const holdfast_slide *const m = &f->state->slide;
    const uint64_t kinds = lag->sliding;
    out[HF_FRICTION] = f->track[now].friction;
    out[HF_TAXEL_FRICTION] = f->track[now].taxel_friction;
    if (hf_needs(kinds, HF_FORCE_TO_NOISE, HF_FORCE_TO_NOISE)) {
        out[HF_FORCE_TO_NOISE] = hf_log(1 + f->track[now].amplitude / m->force_noise);
    }
    if (hf_needs(kinds, HF_FRICTION_MARGIN, HF_FRICTION_MARGIN)) {
        out[HF_FRICTION_MARGIN] = hf_margin(m, lag->seconds);
    }
    if (hf_needs(kinds, HF_SHEAR_BY_LOAD, HF_CENTRE_SHIFT)) {
        hf_fill_steps(f, kinds, &f->track[now], &f->track[then], out);
    }
    if (hf_needs(kinds, HF_DIVERGENCE, HF_RISING_SHARE)) {
        hf_fill_spread(f, kinds, now, then, out);
    }
}
