/* The fingertip force of whole arrays, with the sums of lanes.h: the bits of a stream. */
#include "batch.h"

#include "finger.h"

void holdfast_fingertip_force(
    const double *readings, const double *baseline, const double *rotations, size_t n,
    size_t n_taxels, double *force)
{
    for (size_t k = 0; k < n; ++k) {
        const double *f = readings + 3 * n_taxels * k;
        const double *b = baseline, *turn = rotations;
        hf_sum sum_x = {{0}}, sum_y = {{0}}, sum_z = {{0}};
        /* F_tip = sum_i R_i (f_i - b_i). */
        for (size_t i = 0; i < n_taxels; ++i, f += 3, b += 3, turn += 9) {
            const double x = f[0] - b[0], y = f[1] - b[1], z = f[2] - b[2];
            hf_add(&sum_x, i, turn[0] * x + turn[1] * y + turn[2] * z);
            hf_add(&sum_y, i, turn[3] * x + turn[4] * y + turn[5] * z);
            hf_add(&sum_z, i, turn[6] * x + turn[7] * y + turn[8] * z);
        }
        const double total_x = hf_total(sum_x), total_y = hf_total(sum_y);
        const double total_z = hf_total(sum_z);
        const bool is_finite = isfinite(total_x + total_y + total_z);
        force[3 * k] = is_finite ? total_x : (double)NAN;
        force[3 * k + 1] = is_finite ? total_y : (double)NAN;
        force[3 * k + 2] = is_finite ? total_z : (double)NAN;
    }
}
