/* How well smooth sides describe pieces of a closed curve. */

#include "kernels.h"

#include <math.h>
#include <stdlib.h>

enum { TERMS = 3 };

/* The solution of A x = b, of a symmetric positive definite A; both are overwritten. */
static void solve(double A[TERMS][TERMS], double *b) {
    for (int i = 0; i < TERMS; i++)
        for (int k = i + 1; k < TERMS; k++) {
            const double share = A[k][i] / A[i][i];
            for (int j = i; j < TERMS; j++) A[k][j] -= share * A[i][j];
            b[k] -= share * b[i];
        }
    for (int i = TERMS - 1; i >= 0; i--) {
        for (int j = i + 1; j < TERMS; j++) b[i] -= A[i][j] * b[j];
        b[i] /= A[i][i];
    }
}

/* Sum of squared distances of the points (samples, 2), of which those with the weight 1 count, from their parabola;
   none counts more than `jag`. They are overwritten. */
AVX2 static double misfit(double *x, double *y, const double *weight, ptrdiff_t samples, double jag) {
    double total = 0, mean_x = 0, mean_y = 0, xx = 0, xy = 0, yy = 0;
    for (ptrdiff_t i = 0; i < samples; i++) {
        total += weight[i];
        mean_x += weight[i] * x[i];
        mean_y += weight[i] * y[i];
    }
    total = total > 1.0 ? total : 1.0;
    mean_x /= total;
    mean_y /= total;
    for (ptrdiff_t i = 0; i < samples; i++) {
        x[i] -= mean_x;
        y[i] -= mean_y;
        xx += weight[i] * x[i] * x[i];
        xy += weight[i] * x[i] * y[i];
        yy += weight[i] * y[i] * y[i];
    }
    const double angle = 0.5 * atan2(2 * xy, xx - yy), c = cos(angle), s = sin(angle);
    double A[TERMS][TERMS] = {{0}}, b[TERMS] = {0}, sums[5] = {0};
    for (ptrdiff_t i = 0; i < samples; i++) {
        const double along = x[i] * c + y[i] * s, across = y[i] * c - x[i] * s;
        x[i] = along;
        y[i] = across;
        double power = weight[i];
        for (int k = 0; k < 5; k++, power *= along) {
            sums[k] += power;
            if (k < TERMS) b[k] += power * across;
        }
    }
    for (int i = 0; i < TERMS; i++)
        for (int j = 0; j < TERMS; j++) A[i][j] = sums[i + j] + (i == j ? 1e-6 : 0.0);
    solve(A, b);
    double sum = 0;
    for (ptrdiff_t i = 0; i < samples; i++) {
        double off = fabs(y[i] - (b[0] + b[1] * x[i] + b[2] * x[i] * x[i]));
        off = off < jag ? off : jag;
        sum += weight[i] * off * off;
    }
    return sum;
}

/* The misfits `cost` (pieces,) of the pieces of a closed `curve` (count, 2) that begin at the points `starts` (pieces,) and
   are `lengths` (pieces,) long. Each is looked at in `samples` places, which lie at `shares` (samples,) of it. Of the
   points those that are `shown` (count,) count. Returns 0 where memory is missing. */
AVX2 int piece_costs(
    const double *curve, const uint8_t *shown, ptrdiff_t count, const ptrdiff_t *starts, const ptrdiff_t *lengths,
    ptrdiff_t pieces, const double *shares, ptrdiff_t samples, double jag, double *cost) {
    double *x = malloc(3 * samples * sizeof *x);
    if (!x) return 0;
    double *y = x + samples, *weight = y + samples;
    for (ptrdiff_t piece = 0; piece < pieces; piece++) {
        for (ptrdiff_t i = 0; i < samples; i++) {
            const ptrdiff_t at = (starts[piece] + (ptrdiff_t)nearbyint(shares[i] * (double)lengths[piece])) % count;
            x[i] = curve[2 * at];
            y[i] = curve[2 * at + 1];
            weight[i] = shown[at] ? 1.0 : 0.0;
        }
        cost[piece] = misfit(x, y, weight, samples, jag) * (double)lengths[piece] / (double)samples;
    }
    free(x);
    return 1;
}
