/* Loops over the taxels of a finger that add up their forces and their motion.
 *
 * All numbers here are finite. Lanes without a taxel, and those of ignored taxels, hold zeros in
 * the readings and the rotations. */
#include "finger.h"

/* Sums over the taxels at a sample. */
typedef struct {
    hf_real force[3];         /* F_tip */
    hf_real normal;           /* sum of the normal readings */
    hf_real weight;           /* sum p_i */
    hf_real pressure_squares; /* sum p_i^2 */
    hf_real squares;          /* sum |h_i|^2 */
    hf_real moved;            /* sum of the squared steps of the taxels */
    hf_real centre[3];        /* sum p_i r_i */
    hf_real moment;           /* about the normal */
} hf_taxel_sums;

/* Return the part of a vector along the normal, which is usually an axis. */
static inline hf_real hf_along(const holdfast_finger *finger, hf_real x, hf_real y, hf_real z)
{
    if (finger->normal_axis == 0) {
        return x;
    }
    if (finger->normal_axis == 2) {
        return z;
    }
    return x * finger->normal[0] + y * finger->normal[1] + z * finger->normal[2];
}

/* Compute F_tip = sum_i R_i (f_i - b_i) (DESIGN, section 1), and return the sum of the normal
 * readings. */
static hf_real hf_sum_taxels(const hf_finger *f, const hf_real *baseline, hf_real force[3])
{
    const size_t n = f->n;
    const hf_real *const r = f->readings, *const b = baseline, *const turn = f->rotations;
    hf_real fx = 0, fy = 0, fz = 0, normal = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const hf_real x = r[i] - b[i], y = r[n + i] - b[n + i], z = r[2 * n + i] - b[2 * n + i];
        fx += turn[i] * x + turn[n + i] * y + turn[2 * n + i] * z;
        fy += turn[3 * n + i] * x + turn[4 * n + i] * y + turn[5 * n + i] * z;
        fz += turn[6 * n + i] * x + turn[7 * n + i] * y + turn[8 * n + i] * z;
        normal += z;
    }
    force[0] = fx;
    force[1] = fy;
    force[2] = fz;
    return normal;
}

/* Store the taxel forces of a sample at place `now` of the ring, and return sums over the taxels.
 *
 * `before` is the place of the sample before, or any other place without one: `moved` means
 * nothing then. */
static hf_taxel_sums hf_turn_taxels(const hf_finger *f, size_t now, size_t before)
{
    /* g_i = R_i (f_i - b_i), F = sum g_i, h_i = g_i - g_i(reference), p_i = |h_i . n|:
     * centre c = sum p_i r_i / sum p_i, moment = n . sum r_i x g_i,
     * moved = sum |g_i(k) - g_i(k-1)|^2. */
    const size_t n = f->n;
    const hf_real *const r = f->readings, *const b = f->baseline, *const turn = f->rotations;
    const hf_real *const rest = f->reference, *const place = f->places;
    const hf_real *const then = hf_forces_at(f, before);
    hf_real *const g = hf_forces_at(f, now);
    hf_taxel_sums s = {{0, 0, 0}, 0, 0, 0, 0, 0, {0, 0, 0}, 0};
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const hf_real x = r[i] - b[i], y = r[n + i] - b[n + i], z = r[2 * n + i] - b[2 * n + i];
        const hf_real gx = turn[i] * x + turn[n + i] * y + turn[2 * n + i] * z;
        const hf_real gy = turn[3 * n + i] * x + turn[4 * n + i] * y + turn[5 * n + i] * z;
        const hf_real gz = turn[6 * n + i] * x + turn[7 * n + i] * y + turn[8 * n + i] * z;
        const hf_real dx = gx - then[i], dy = gy - then[n + i], dz = gz - then[2 * n + i];
        const hf_real hx = gx - rest[i], hy = gy - rest[n + i], hz = gz - rest[2 * n + i];
        const hf_real pressed = hf_abs(hf_along(f->finger, hx, hy, hz));
        s.normal += z;
        s.moved += dx * dx + dy * dy + dz * dz;
        s.force[0] += gx;
        s.force[1] += gy;
        s.force[2] += gz;
        s.weight += pressed;
        s.pressure_squares += pressed * pressed;
        s.squares += hx * hx + hy * hy + hz * hz;
        g[i] = gx;
        g[n + i] = gy;
        g[2 * n + i] = gz;
        f->pressed[i] = pressed;
        if (f->hand->has_centres) {
            const hf_real px = place[i], py = place[n + i], pz = place[2 * n + i];
            s.centre[0] += pressed * px;
            s.centre[1] += pressed * py;
            s.centre[2] += pressed * pz;
            s.moment += hf_along(
                f->finger, py * gz - pz * gy, pz * gx - px * gz, px * gy - py * gx);
        }
    }
    return s;
}

/* Squared motion of the taxels against their mean, and its part along the normal. */
typedef struct {
    hf_real moved;
    hf_real pressed;
} hf_residual;

/* Return the motion of the taxels from one place of the ring to another, against `mean`. */
static hf_residual hf_residual_of(const hf_finger *f, size_t now, size_t then, const hf_real mean[3])
{
    /* sum |u_i|^2 and sum (u_i . n)^2, with u_i = dg_i - mean dg. */
    const size_t n = f->n;
    const hf_real *const g = hf_forces_at(f, now), *const old = hf_forces_at(f, then);
    hf_residual sum = {0, 0};
    for (size_t i = 0; i < f->n_taxels; ++i) {
        if (!f->ignored[i]) {
            const hf_real x = g[i] - old[i] - mean[0];
            const hf_real y = g[n + i] - old[n + i] - mean[1];
            const hf_real z = g[2 * n + i] - old[2 * n + i] - mean[2];
            const hf_real along = hf_along(f->finger, x, y, z);
            sum.moved += x * x + y * y + z * z;
            sum.pressed += along * along;
        }
    }
    return sum;
}

/* Three samples of a second difference: a g(k) - 2 g(k-s) + c g(k-2s). */
typedef struct {
    size_t now;     /* places in the ring */
    size_t before;
    size_t first;
    hf_real newest; /* weight a; 1 at even times */
    hf_real oldest; /* weight c; 1 at even times */
} hf_second;

/* Sums over the second differences d_i of the taxels. */
typedef struct {
    hf_real squares;  /* sum |d_i|^2 */
    hf_real shared;   /* sum p_i |d_i|^2 */
    hf_real along;    /* sum p_i (d_i . n)^2 */
    hf_real weighted[3]; /* sum p_i d_i */
    hf_real top;      /* largest |d_i|^2 of the taxels with p_i > mean p; else at most 0 */
} hf_second_sums;

static hf_second_sums hf_second_differences(const hf_finger *f, hf_second at)
{
    const size_t n = f->n;
    const hf_real *const g = hf_forces_at(f, at.now), *const mid = hf_forces_at(f, at.before);
    const hf_real *const old = hf_forces_at(f, at.first);
    const hf_real mean = f->state->motion.pressure / f->finger->n_used;
    hf_second_sums s = {0, 0, 0, {0, 0, 0}, 0};
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const hf_real x = at.newest * g[i] - 2 * mid[i] + at.oldest * old[i];
        const hf_real y = at.newest * g[n + i] - 2 * mid[n + i] + at.oldest * old[n + i];
        const hf_real z =
            at.newest * g[2 * n + i] - 2 * mid[2 * n + i] + at.oldest * old[2 * n + i];
        const hf_real square = x * x + y * y + z * z, pressed = f->pressed[i];
        const hf_real pushed = hf_along(f->finger, x, y, z);
        s.squares += square;
        s.shared += pressed * square;
        s.along += pressed * (pushed * pushed);
        s.weighted[0] += pressed * x;
        s.weighted[1] += pressed * y;
        s.weighted[2] += pressed * z;
        /* The sign is a selection, not a branch, which half of the taxels would mispredict. */
        const hf_real rival = -hf_copysign(square, mean - pressed);
        s.top = rival > s.top ? rival : s.top;
    }
    return s;
}

/* Return the sum of max(g_i . n, 0) over the taxels at a place of the ring. */
static hf_real hf_risen(const hf_finger *f, size_t now)
{
    const size_t n = f->n;
    const hf_real *const g = hf_forces_at(f, now), *const normal = f->finger->normal;
    hf_real risen = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const hf_real pressed = g[i] * normal[0] + g[n + i] * normal[1] + g[2 * n + i] * normal[2];
        risen += (pressed + hf_abs(pressed)) / 2; /* max(p, 0), without a branch */
    }
    return risen;
}
