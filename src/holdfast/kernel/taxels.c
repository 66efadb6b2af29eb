/* Loops over the taxels of a finger that add up their forces and their motion.
 *
 * All numbers here are finite. Lanes without a taxel, and those of ignored taxels, hold zeros in
 * the readings and the rotations. lanes.h has the order of the sums. */
#include "finger.h"

/* Return v . n for the normal n of the patch. In an exported header whose normals are all the same
 * axis, that is a component: products with 0 and 1 change no finite number. */
static inline hf_wide hf_along(hf_vectors v, const hf_real n[3])
{
#ifdef HOLDFAST_NORMAL_AXIS
    (void)n;
    return HOLDFAST_NORMAL_AXIS == 0 ? v.x : HOLDFAST_NORMAL_AXIS == 1 ? v.y : v.z;
#else
    return v.x * n[0] + v.y * n[1] + v.z * n[2];
#endif
}

/* Compute F_tip = sum_i R_i (f_i - b_i), and return the sum of the normal readings, which are z in
 * the taxel frames. */
HF_SHARED hf_real hf_sum_taxels(const hf_finger *f, const hf_real *baseline, hf_real force[3])
{
    const size_t n = f->n;
    hf_sum fx, fy, fz, normal;
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        hf_wide x = {0}, y = {0}, z = {0}, readings_z = {0};
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_vectors reading =
                hf_minus(hf_load_vectors(f->readings, n, i), hf_load_vectors(baseline, n, i));
            const hf_vectors g = hf_turned(f->rotations, n, i, reading);
            x += g.x;
            y += g.y;
            z += g.z;
            readings_z += reading.z;
        }
        hf_put(&fx, lane, x);
        hf_put(&fy, lane, y);
        hf_put(&fz, lane, z);
        hf_put(&normal, lane, readings_z);
    }
    force[0] = hf_total(fx);
    force[1] = hf_total(fy);
    force[2] = hf_total(fz);
    return hf_total(normal);
}

/* Store the taxel forces of a sample at index `now` of the ring, and return sums over the taxels.
 *
 * `before` is the index of the sample before, or any other index without one: `moved` means
 * nothing then. */
HF_SHARED hf_taxel_sums hf_turn_taxels(const hf_finger *f, size_t now, size_t before)
{
    /* g_i = R_i (f_i - b_i), F = sum g_i, h_i = g_i - g_i(reference), p_i = |h_i . n|,
     * moved = sum |g_i(k) - g_i(k-1)|^2. */
    const size_t n = f->n;
    hf_real *const ring = hf_forces_at(f, now);
    const hf_real *const then = hf_forces_at(f, before);
    hf_sum fx, fy, fz, normal, weight, squares, moved;
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        hf_wide x = {0}, y = {0}, z = {0}, readings_z = {0};
        hf_wide p = {0}, hh = {0}, steps = {0};
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_vectors reading =
                hf_minus(hf_load_vectors(f->readings, n, i), hf_load_vectors(f->baseline, n, i));
            const hf_vectors g = hf_turned(f->rotations, n, i, reading);
            const hf_vectors h = hf_minus(g, hf_load_vectors(f->reference, n, i));
            const hf_wide pressed = hf_wide_abs(hf_along(h, f->finger->normal));
            steps += hf_squares(hf_minus(g, hf_load_vectors(then, n, i)));
            hf_store(ring + i, g.x);
            hf_store(ring + n + i, g.y);
            hf_store(ring + 2 * n + i, g.z);
            hf_store(f->pressed + i, pressed);
            x += g.x;
            y += g.y;
            z += g.z;
            readings_z += reading.z;
            p += pressed;
            hh += hf_squares(h);
        }
        hf_put(&fx, lane, x);
        hf_put(&fy, lane, y);
        hf_put(&fz, lane, z);
        hf_put(&normal, lane, readings_z);
        hf_put(&weight, lane, p);
        hf_put(&squares, lane, hh);
        hf_put(&moved, lane, steps);
    }
    const hf_taxel_sums sums = {
        {hf_total(fx), hf_total(fy), hf_total(fz)},
        hf_total(normal),
        hf_total(weight),
        hf_total(squares),
        hf_total(moved)};
    return sums;
}

/* Compute sum p_i r_i at an index of the ring, and return the moment about the normal,
 * n . sum r_i x g_i. */
HF_SHARED hf_real hf_moment(const hf_finger *f, size_t now, hf_real centre[3])
{
    const size_t n = f->n;
    const hf_real *const ring = hf_forces_at(f, now);
    hf_sum cx, cy, cz, moment;
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        hf_wide x = {0}, y = {0}, z = {0}, m = {0};
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_vectors g = hf_load_vectors(ring, n, i);
            const hf_vectors r = hf_load_vectors(f->positions, n, i);
            const hf_vectors product = {
                r.y * g.z - r.z * g.y, r.z * g.x - r.x * g.z, r.x * g.y - r.y * g.x};
            const hf_wide p = hf_load(f->pressed + i);
            x += p * r.x;
            y += p * r.y;
            z += p * r.z;
            m += hf_along(product, f->finger->normal);
        }
        hf_put(&cx, lane, x);
        hf_put(&cy, lane, y);
        hf_put(&cz, lane, z);
        hf_put(&moment, lane, m);
    }
    centre[0] = hf_total(cx);
    centre[1] = hf_total(cy);
    centre[2] = hf_total(cz);
    return hf_total(moment);
}

/* Return the motion of the taxels from one index of the ring to another, against `mean`. */
HF_SHARED hf_residual
hf_residual_of(const hf_finger *f, size_t now, size_t then, const hf_real mean[3])
{
    /* sum |u_i|^2 and sum (u_i . n)^2, with u_i = dg_i - mean dg. */
    const size_t n = f->n;
    const hf_real *const g = hf_forces_at(f, now), *const old = hf_forces_at(f, then);
    hf_sum moved, pressed;
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        hf_wide squares = {0}, along = {0};
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_wide used = hf_load(f->used + i);
            const hf_vectors d = hf_minus(hf_load_vectors(g, n, i), hf_load_vectors(old, n, i));
            const hf_vectors u = {
                used * (d.x - mean[0]), used * (d.y - mean[1]), used * (d.z - mean[2])};
            const hf_wide normal = hf_along(u, f->finger->normal);
            squares += hf_squares(u);
            along += normal * normal;
        }
        hf_put(&moved, lane, squares);
        hf_put(&pressed, lane, along);
    }
    const hf_residual sums = {hf_total(moved), hf_total(pressed)};
    return sums;
}

/* Return sums over the normal parts p_i = g_i . n at an index of the ring. */
HF_SHARED hf_normal_sums hf_sum_normals(const hf_finger *f, size_t now)
{
    const size_t n = f->n;
    const hf_real *const ring = hf_forces_at(f, now);
    hf_sum risen, risen_squares, squares, all;
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        hf_wide part = {0}, up = {0}, both = {0}, whole = {0};
        const hf_wide none = {0};
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_vectors g = hf_load_vectors(ring, n, i);
            const hf_wide pressed = hf_along(g, f->finger->normal);
            const hf_wide above = hf_greater(pressed, none);
            part += above;
            up += above * above;
            both += pressed * pressed;
            whole += hf_squares(g);
        }
        hf_put(&risen, lane, part);
        hf_put(&risen_squares, lane, up);
        hf_put(&squares, lane, both);
        hf_put(&all, lane, whole);
    }
    const hf_normal_sums sums = {
        hf_total(risen), hf_total(risen_squares), hf_total(squares), hf_total(all)};
    return sums;
}
