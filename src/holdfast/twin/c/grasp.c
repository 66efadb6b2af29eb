/* Set-points of the joints on the path on which the fingers close, see grasp.py. */
#include "steps.h"

enum { JOINTS_OF_FINGER = 4 };

/* Fill the angles of the joints for the gaps of the fingertips, linear between points of the path.
 *
 * `grid` are the m decreasing gaps of the path, evenly spaced [m], `joints` (n_fingers, m, 4) the
 * angles there [rad]. The joints of a finger are those from its `first` on. */
static void fill_targets(
    const double *grid, size_t m, const double *joints, const int *first, const double *depths,
    size_t n_fingers, double *out)
{
    const double last = (double)(m - 1);
    for (size_t i = 0; i < n_fingers; ++i) {
        const double way = (grid[0] - depths[i]) / (grid[0] - grid[m - 1]);
        const double at = smaller(larger(0.0, way), 1.0) * last; /* NaN: the first point */
        const size_t k = at < last - 1 ? (size_t)at : m - 2;
        const double share = at - (double)k;
        const double *const low = &joints[JOINTS_OF_FINGER * (i * m + k)];
        const double *const high = low + JOINTS_OF_FINGER;
        for (size_t j = 0; j < JOINTS_OF_FINGER; ++j) {
            out[(size_t)first[i] + j] = (1 - share) * low[j] + share * high[j];
        }
    }
}
