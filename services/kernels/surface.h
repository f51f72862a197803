/* What the kernels of developable sheets share. Names and equations are those of services/sheet/developable: P(s) is the
   a-axis, A(s) its direction, R(s) the ruling vector; a point of the sheet is X(s, t) = P(s) + t R(s). */

#ifndef SURFACE_H
#define SURFACE_H

#include "kernels.h"

/* Tables at `count` nodes, `step` apart: places (count,), P, A, R (count, 3). Nodes from `first` to `last` face the
   camera. The text's axes are turned by the skew, of which these are cosine and sine. */
struct sheet {
    const double *nodes, *P, *A, *R;
    int32_t count, first, last;
    double step, focal, slopes[2], cosine, sine, anchor[2];
};

/* Points: in the photo (count, 2), on the sheet (s, t) (count, 2) and on the page (count, 2), d page / d photo
   (count, 2, 2); the point in space, A and R (3, count). */
struct points {
    ptrdiff_t count;
    double *photo, *sheet, *page, *jacobians, *X, *A, *R;
};

static inline void cross(const double *a, const double *b, double *out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline double slope_at(const struct sheet *sheet, double s) {
    return sheet->slopes[0] * s + sheet->slopes[1] * s * s;
}

static inline double slope_rate(const struct sheet *sheet, double s) {
    return sheet->slopes[0] + 2 * sheet->slopes[1] * s;
}

/* The node before s, of those that have one after them. */
static inline int node_before(const struct sheet *sheet, double s) {
    double at = (s - sheet->nodes[0]) / sheet->step;
    at = at > 0 ? at : 0;
    at = at < sheet->count - 2 ? at : sheet->count - 2;
    return (int)at;
}

#endif
