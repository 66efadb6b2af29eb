/* Loops over the taxels of a finger that add up their forces and their motion.
 *
 * All numbers here are finite. Lanes without a taxel, and those of ignored taxels, hold zeros in
 * the readings and the rotations. Each loop takes HF_LANES taxels at a time, in the order of
 * `hf_sum`; the inner loop has no branch. */
#include "finger.h"

/* Compute F_tip = sum_i R_i (f_i - b_i) (DESIGN, section 1), and return the sum of the normal
 * readings. */
static hf_real hf_sum_taxels(const hf_finger *f, const hf_real *baseline, hf_real force[3])
{
    const size_t n = f->n;
    const hf_real *const r = f->readings, *const b = baseline, *const turn = f->rotations;
    hf_sum fx = {{0}}, fy = {{0}}, fz = {{0}}, normal = {{0}};
    for (size_t start = 0; start < n; start += HF_LANES) {
        for (size_t l = 0; l < HF_LANES; ++l) {
            const size_t i = start + l;
            const hf_real x = r[i] - b[i];
            const hf_real y = r[n + i] - b[n + i];
            const hf_real z = r[2 * n + i] - b[2 * n + i];
            fx.lane[l] += turn[i] * x + turn[n + i] * y + turn[2 * n + i] * z;
            fy.lane[l] += turn[3 * n + i] * x + turn[4 * n + i] * y + turn[5 * n + i] * z;
            fz.lane[l] += turn[6 * n + i] * x + turn[7 * n + i] * y + turn[8 * n + i] * z;
            normal.lane[l] += z;
        }
    }
    force[0] = hf_total(fx);
    force[1] = hf_total(fy);
    force[2] = hf_total(fz);
    return hf_total(normal);
}

/* Sums over the taxels at a sample. */
typedef struct {
    hf_real force[3];         /* F_tip */
    hf_real normal;           /* sum of the normal readings */
    hf_real weight;           /* sum p_i */
    hf_real pressure_squares; /* sum p_i^2 */
    hf_real squares;          /* sum |h_i|^2 */
    hf_real moved;            /* sum of the squared steps of the taxels */
} hf_taxel_sums;

/* Store the taxel forces of a sample at place `now` of the ring, and return sums over the taxels.
 *
 * `before` is the place of the sample before, or any other place without one: `moved` means
 * nothing then. */
static hf_taxel_sums hf_turn_taxels(const hf_finger *f, size_t now, size_t before)
{
    /* g_i = R_i (f_i - b_i), F = sum g_i, h_i = g_i - g_i(reference), p_i = |h_i . n|,
     * moved = sum |g_i(k) - g_i(k-1)|^2. */
    const size_t n = f->n;
    const hf_real *const r = f->readings, *const b = f->baseline, *const turn = f->rotations;
    const hf_real *const rest = f->reference, *const then = hf_forces_at(f, before);
    hf_real *const g = hf_forces_at(f, now), *const p = f->pressed;
    const hf_real nx = f->finger->normal[0], ny = f->finger->normal[1], nz = f->finger->normal[2];
    hf_sum fx = {{0}}, fy = {{0}}, fz = {{0}}, normal = {{0}};
    hf_sum weight = {{0}}, pressure_squares = {{0}}, squares = {{0}}, moved = {{0}};
    for (size_t start = 0; start < n; start += HF_LANES) {
        hf_real own[4][HF_LANES]; /* stored at the end: a store between would end the vectors */
        for (size_t l = 0; l < HF_LANES; ++l) {
            const size_t i = start + l;
            const hf_real x = r[i] - b[i];
            const hf_real y = r[n + i] - b[n + i];
            const hf_real z = r[2 * n + i] - b[2 * n + i];
            const hf_real gx = turn[i] * x + turn[n + i] * y + turn[2 * n + i] * z;
            const hf_real gy = turn[3 * n + i] * x + turn[4 * n + i] * y + turn[5 * n + i] * z;
            const hf_real gz = turn[6 * n + i] * x + turn[7 * n + i] * y + turn[8 * n + i] * z;
            const hf_real dx = gx - then[i], dy = gy - then[n + i], dz = gz - then[2 * n + i];
            const hf_real hx = gx - rest[i], hy = gy - rest[n + i], hz = gz - rest[2 * n + i];
            const hf_real pressed = hf_abs(hx * nx + hy * ny + hz * nz);
            own[0][l] = gx;
            own[1][l] = gy;
            own[2][l] = gz;
            own[3][l] = pressed;
            fx.lane[l] += gx;
            fy.lane[l] += gy;
            fz.lane[l] += gz;
            normal.lane[l] += z;
            moved.lane[l] += dx * dx + dy * dy + dz * dz;
            weight.lane[l] += pressed;
            pressure_squares.lane[l] += pressed * pressed;
            squares.lane[l] += hx * hx + hy * hy + hz * hz;
        }
        for (size_t l = 0; l < HF_LANES; ++l) {
            g[start + l] = own[0][l];
            g[n + start + l] = own[1][l];
            g[2 * n + start + l] = own[2][l];
            p[start + l] = own[3][l];
        }
    }
    const hf_taxel_sums sums = {
        {hf_total(fx), hf_total(fy), hf_total(fz)},
        hf_total(normal),
        hf_total(weight),
        hf_total(pressure_squares),
        hf_total(squares),
        hf_total(moved)};
    return sums;
}

/* Compute sum p_i r_i at a place of the ring, and return the moment about the normal,
 * n . sum r_i x g_i. */
static hf_real hf_moment(const hf_finger *f, size_t now, hf_real centre[3])
{
    const size_t n = f->n;
    const hf_real *const g = hf_forces_at(f, now), *const r = f->places, *const p = f->pressed;
    const hf_real nx = f->finger->normal[0], ny = f->finger->normal[1], nz = f->finger->normal[2];
    hf_sum cx = {{0}}, cy = {{0}}, cz = {{0}}, moment = {{0}};
    for (size_t start = 0; start < n; start += HF_LANES) {
        for (size_t l = 0; l < HF_LANES; ++l) {
            const size_t i = start + l;
            const hf_real gx = g[i], gy = g[n + i], gz = g[2 * n + i];
            const hf_real rx = r[i], ry = r[n + i], rz = r[2 * n + i];
            cx.lane[l] += p[i] * rx;
            cy.lane[l] += p[i] * ry;
            cz.lane[l] += p[i] * rz;
            moment.lane[l] +=
                (ry * gz - rz * gy) * nx + (rz * gx - rx * gz) * ny + (rx * gy - ry * gx) * nz;
        }
    }
    centre[0] = hf_total(cx);
    centre[1] = hf_total(cy);
    centre[2] = hf_total(cz);
    return hf_total(moment);
}

/* Squared motion of the taxels against their mean, and its part along the normal. */
typedef struct {
    hf_real moved;
    hf_real pressed;
} hf_residual;

/* Return the motion of the taxels from one place of the ring to another, against `mean`. */
static hf_residual hf_residual_of(
    const hf_finger *f, size_t now, size_t then, const hf_real mean[3])
{
    /* sum |u_i|^2 and sum (u_i . n)^2, with u_i = dg_i - mean dg. */
    const size_t n = f->n;
    const hf_real *const g = hf_forces_at(f, now), *const old = hf_forces_at(f, then);
    const hf_real *const used = f->used;
    const hf_real nx = f->finger->normal[0], ny = f->finger->normal[1], nz = f->finger->normal[2];
    const hf_real mx = mean[0], my = mean[1], mz = mean[2];
    hf_sum moved = {{0}}, pressed = {{0}};
    for (size_t start = 0; start < n; start += HF_LANES) {
        for (size_t l = 0; l < HF_LANES; ++l) {
            const size_t i = start + l;
            const hf_real x = used[i] * (g[i] - old[i] - mx);
            const hf_real y = used[i] * (g[n + i] - old[n + i] - my);
            const hf_real z = used[i] * (g[2 * n + i] - old[2 * n + i] - mz);
            const hf_real along = x * nx + y * ny + z * nz;
            moved.lane[l] += x * x + y * y + z * z;
            pressed.lane[l] += along * along;
        }
    }
    const hf_residual sums = {hf_total(moved), hf_total(pressed)};
    return sums;
}

/* Three samples of a second difference: a g(k) - 2 g(k-s) + c g(k-2s). */
typedef struct {
    size_t now; /* places in the ring */
    size_t before;
    size_t first;
    hf_real newest; /* weight a; 1 at even times */
    hf_real oldest; /* weight c; 1 at even times */
} hf_second;

/* Sums over the second differences d_i of the taxels. */
typedef struct {
    hf_real squares;     /* sum |d_i|^2 */
    hf_real shared;      /* sum p_i |d_i|^2 */
    hf_real along;       /* sum p_i (d_i . n)^2 */
    hf_real weighted[3]; /* sum p_i d_i */
    hf_real top;         /* largest |d_i|^2 of the taxels with p_i > mean p; 0 without any */
} hf_second_sums;

static hf_second_sums hf_second_differences(const hf_finger *f, hf_second at)
{
    const size_t n = f->n;
    const hf_real *const g = hf_forces_at(f, at.now), *const mid = hf_forces_at(f, at.before);
    const hf_real *const old = hf_forces_at(f, at.first), *const p = f->pressed;
    const hf_real a = at.newest, c = at.oldest;
    const hf_real mean = f->state->motion.pressure / f->finger->n_used;
    const hf_real nx = f->finger->normal[0], ny = f->finger->normal[1], nz = f->finger->normal[2];
    hf_sum squares = {{0}}, shared = {{0}}, along = {{0}}, px = {{0}}, py = {{0}}, pz = {{0}};
    hf_sum top = {{0}};
    for (size_t start = 0; start < n; start += HF_LANES) {
        for (size_t l = 0; l < HF_LANES; ++l) {
            const size_t i = start + l;
            const hf_real x = a * g[i] - 2 * mid[i] + c * old[i];
            const hf_real y = a * g[n + i] - 2 * mid[n + i] + c * old[n + i];
            const hf_real z = a * g[2 * n + i] - 2 * mid[2 * n + i] + c * old[2 * n + i];
            const hf_real square = x * x + y * y + z * z, pushed = x * nx + y * ny + z * nz;
            const hf_real rival = p[i] > mean ? square : 0;
            squares.lane[l] += square;
            shared.lane[l] += p[i] * square;
            along.lane[l] += p[i] * (pushed * pushed);
            px.lane[l] += p[i] * x;
            py.lane[l] += p[i] * y;
            pz.lane[l] += p[i] * z;
            top.lane[l] = rival > top.lane[l] ? rival : top.lane[l];
        }
    }
    const hf_second_sums sums = {
        hf_total(squares),
        hf_total(shared),
        hf_total(along),
        {hf_total(px), hf_total(py), hf_total(pz)},
        hf_max(hf_max(top.lane[0], top.lane[1]), hf_max(top.lane[2], top.lane[3]))};
    return sums;
}

/* Return the sum of max(g_i . n, 0) over the taxels at a place of the ring. */
static hf_real hf_risen(const hf_finger *f, size_t now)
{
    const size_t n = f->n;
    const hf_real *const g = hf_forces_at(f, now), *const normal = f->finger->normal;
    hf_sum risen = {{0}};
    for (size_t start = 0; start < n; start += HF_LANES) {
        for (size_t l = 0; l < HF_LANES; ++l) {
            const size_t i = start + l;
            const hf_real pressed =
                g[i] * normal[0] + g[n + i] * normal[1] + g[2 * n + i] * normal[2];
            risen.lane[l] += pressed > 0 ? pressed : 0;
        }
    }
    return hf_total(risen);
}
