/* The fingertip force of whole arrays. */
#include "batch.h"

#include <math.h>

void holdfast_fingertip_force(
    const double *readings, const double *baseline, const double *rotations, size_t n,
    size_t n_taxels, double *force)
{
    for (size_t k = 0; k < n; ++k) {
        const double *f = readings + 3 * n_taxels * k;
        const double *b = baseline, *turn = rotations;
        double sum_x = 0.0, sum_y = 0.0, sum_z = 0.0;
        /* F_tip = sum_i R_i (f_i - b_i) (DESIGN, section 1), one taxel after the other. */
        for (size_t i = 0; i < n_taxels; ++i, f += 3, b += 3, turn += 9) {
            const double x = f[0] - b[0], y = f[1] - b[1], z = f[2] - b[2];
            sum_x += turn[0] * x + turn[1] * y + turn[2] * z;
            sum_y += turn[3] * x + turn[4] * y + turn[5] * z;
            sum_z += turn[6] * x + turn[7] * y + turn[8] * z;
        }
        const int finite = isfinite(sum_x + sum_y + sum_z);
        force[3 * k] = finite ? sum_x : (double)NAN;
        force[3 * k + 1] = finite ? sum_y : (double)NAN;
        force[3 * k + 2] = finite ? sum_z : (double)NAN;
    }
}
