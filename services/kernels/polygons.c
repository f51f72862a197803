/* Points and closed curves. */

#include "kernels.h"

#include <math.h>
#include <stdlib.h>

/* Distances (count,) of `points` (count, 2) from the closed curve through `corners` (sides, 2), above 0 within it.
   Returns 0 where memory is missing. */
AVX2 int polygon_distances(
    const double *points, ptrdiff_t count, const double *corners, ptrdiff_t sides, double *distances) {
    if (!count) return 1;
    double *x = malloc(3 * count * sizeof *x);
    if (!x) return 0;
    double *y = x + count, *crossed = y + count;
    for (ptrdiff_t i = 0; i < count; i++) {
        x[i] = points[2 * i];
        y[i] = points[2 * i + 1];
        crossed[i] = 0.0;
        distances[i] = INFINITY;
    }
    for (ptrdiff_t side = 0; side < sides; side++) {
        const double *from = corners + 2 * side, *to = corners + 2 * (side + 1 < sides ? side + 1 : 0);
        const double x0 = from[0], y0 = from[1], y1 = to[1], dx = to[0] - x0, dy = y1 - y0;
        const double square = dx * dx + dy * dy, scale = square > 0 ? 1 / square : 0;
        for (ptrdiff_t i = 0; i < count; i++) {
            const double ahead = x[i] - x0, down = y[i] - y0;
            double along = (ahead * dx + down * dy) * scale;
            along = along > 0.0 ? along : 0.0;
            along = along < 1.0 ? along : 1.0;
            const double off_x = ahead - along * dx, off_y = down - along * dy;
            const double squared = off_x * off_x + off_y * off_y;
            distances[i] = squared < distances[i] ? squared : distances[i];
            /* A ray to the right crosses the side. */
            const double upper = y0 > y[i] ? 1.0 : 0.0, lower = y1 > y[i] ? 1.0 : 0.0;
            const double left = ahead * dy < down * dx ? 1.0 : 0.0;
            const double is_left = dy > 0.0 ? left : 1.0 - left;
            crossed[i] += upper == lower ? 0.0 : is_left;
        }
    }
    for (ptrdiff_t i = 0; i < count; i++) {
        const double distance = sqrt(distances[i]);
        distances[i] = fmod(crossed[i], 2.0) > 0.5 ? distance : -distance;
    }
    free(x);
    return 1;
}
