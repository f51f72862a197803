/* How the page at photo points moves with the parameters of a developable sheet. */

#include "surface.h"

#include <immintrin.h>
#include <math.h>
#include <stdlib.h>

enum {
    GLOBAL = 5,   /* turn, log focal length, skew: parameters before those of the tables */
    FACTORS = 6,  /* of d phi and dP */
    LANES = 4,    /* columns of a table that are summed together */
};

/* What a bend or a slope of the rulings moves: at each node FACTORS rows of `width` columns, d phi (3) and dP (3). */
struct tables {
    double *values, *rates;
    int width;
};

/* Integrals over s of three rows of the rates, from number `row` on, by the trapezoidal rule, from s = 0, which is nearest
   to the node `origin`. `room` (3, width). */
AVX2 static void integrate(
    const struct sheet *sheet, int origin, const struct tables *tables, int row, double *restrict room) {
    const ptrdiff_t node = (ptrdiff_t)FACTORS * tables->width, size = (ptrdiff_t)3 * tables->width;
    const double *restrict rates = tables->rates + (ptrdiff_t)row * tables->width;
    double *restrict total = tables->values + (ptrdiff_t)row * tables->width;
    const double half = 0.5 * sheet->step, s = sheet->nodes[origin];
    for (ptrdiff_t i = 0; i < size; i++) room[i] = total[i] = 0;
    for (int n = 1; n < sheet->count; n++) {
        const double *before = rates + (n - 1) * node, *here = rates + n * node;
        double *restrict sum = total + n * node;
        for (ptrdiff_t i = 0; i < size; i++) sum[i] = room[i] += half * (here[i] + before[i]);
    }
    for (ptrdiff_t i = 0; i < size; i++) room[i] = total[origin * node + i] - s * rates[origin * node + i];
    for (int n = 0; n < sheet->count; n++)
        for (ptrdiff_t i = 0; i < size; i++) total[n * node + i] -= room[i];
}

/* d phi' = R dk + A k dw, dP' = d phi x A: of the slopes, then `still` columns of nothing, then of `splines` bends,
   whose values at the nodes are `basis` (count, splines); `bend` (count,) is k. */
AVX2 static void fill_tables(
    const struct sheet *sheet, const double *bend, const double *basis, int still, int splines,
    const struct tables *tables, double *room) {
    const ptrdiff_t width = tables->width, node = FACTORS * width;
    int origin = 0;
    for (int n = 0; n < sheet->count; n++) {
        const double s = sheet->nodes[n];
        if (fabs(s) < fabs(sheet->nodes[origin])) origin = n;
        for (int k = 0; k < 3; k++) {
            double *rate = tables->rates + n * node + k * width;
            rate[0] = bend[n] * sheet->A[3 * n + k] * s;
            rate[1] = bend[n] * sheet->A[3 * n + k] * (s * s);
            for (int i = 0; i < splines; i++) rate[2 + still + i] = sheet->R[3 * n + k] * basis[n * splines + i];
        }
    }
    integrate(sheet, origin, tables, 0, room);
    for (int n = 0; n < sheet->count; n++)
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double *phi_j = tables->values + n * node + j * width, *phi_k = tables->values + n * node + k * width;
            const double A_j = sheet->A[3 * n + j], A_k = sheet->A[3 * n + k];
            double *restrict rate = tables->rates + n * node + (3 + i) * width;
            for (ptrdiff_t c = 0; c < width; c++) rate[c] = phi_j[c] * A_k - phi_k[c] * A_j;
        }
    integrate(sheet, origin, tables, 3, room);
}

/* out (2, columns), whose rows are `stride` apart: sums of the tables' rows at share x of the way from the node `left` to
   the next one, times their `factors`. Between nodes they are parabolas: `rise` is (x - x^2) step / 2. */
AVX2 static void sum_tables(
    const struct tables *tables, int left, double x, double rise, const double factors[2][FACTORS], int columns,
    double *out, ptrdiff_t stride) {
    const ptrdiff_t width = tables->width, node = FACTORS * width;
    const __m256d share = _mm256_set1_pd(x), of_rates = _mm256_set1_pd(rise);
    for (int first = 0; first < columns; first += LANES) {
        const double *values = tables->values + left * node + first, *rates = tables->rates + left * node + first;
        __m256d sums[2] = {_mm256_setzero_pd(), _mm256_setzero_pd()};
        for (int factor = 0; factor < FACTORS; factor++, values += width, rates += width) {
            const __m256d here = _mm256_loadu_pd(values), there = _mm256_loadu_pd(values + node);
            const __m256d bent = _mm256_sub_pd(_mm256_loadu_pd(rates), _mm256_loadu_pd(rates + node));
            const __m256d straight = _mm256_add_pd(here, _mm256_mul_pd(share, _mm256_sub_pd(there, here)));
            const __m256d value = _mm256_add_pd(straight, _mm256_mul_pd(of_rates, bent));
            for (int axis = 0; axis < 2; axis++)
                sums[axis] = _mm256_add_pd(sums[axis], _mm256_mul_pd(_mm256_set1_pd(factors[axis][factor]), value));
        }
        for (int axis = 0; axis < 2; axis++) {
            double last[LANES], *to = out + axis * stride + first;
            const int all = first + LANES <= columns;
            _mm256_storeu_pd(all ? to : last, sums[axis]);
            for (int i = 0; !all && first + i < columns; i++) to[i] = last[i];
        }
    }
}

/* The first columns of a point's rows `moved`, and its `factors`. A point that moves by dX moves on the page by
   G dX = -J (f dX - x dX_z) / Z. Where the frame turns by d phi about the columns of `axes` (3, 4), the last of which is
   the skew's, dX = d phi x arm. */
AVX2 static inline void vary_point(
    const struct sheet *sheet, const struct points *points, ptrdiff_t i, const double *axes,
    double factors[2][FACTORS], double *moved, ptrdiff_t stride) {
    const double focal = sheet->focal, x = points->photo[2 * i], y = points->photo[2 * i + 1];
    const double t = points->sheet[2 * i + 1];
    double X[3], R[3];
    for (int k = 0; k < 3; k++) {
        X[k] = points->X[k * points->count + i];
        R[k] = t * points->R[k * points->count + i];
    }
    const double arm[3] = {X[0] - sheet->anchor[0], X[1] - sheet->anchor[1], X[2] - focal};
    for (int axis = 0; axis < 2; axis++) {
        const double J[2] = {points->jacobians[4 * i + 2 * axis] / X[2], points->jacobians[4 * i + 2 * axis + 1] / X[2]};
        const double G[3] = {-focal * J[0], -focal * J[1], J[0] * x + J[1] * y};
        double turned[3], by_axis[4];
        cross(arm, G, turned);
        cross(R, G, factors[axis]);
        for (int k = 0; k < 3; k++) factors[axis][3 + k] = G[k];
        for (int k = 0; k < 4; k++) by_axis[k] = turned[0] * axes[k] + turned[1] * axes[4 + k] + turned[2] * axes[8 + k];
        double *row = moved + axis * stride;
        for (int k = 0; k < 3; k++) row[k] = by_axis[k];
        row[3] = focal * G[2] - X[2] * G[2];
        row[4] = by_axis[3] + (axis ? -points->page[2 * i] : points->page[2 * i + 1]);
    }
}

/* Derivatives `moved` (count, 2, stride) of the page at `points` by turn about the columns of `axes`, log focal length,
   skew, slopes, `still` parameters that move nothing, and bends; the rest of a row is not written. Returns 0 where
   memory is missing. */
AVX2 int vary_points(
    const struct sheet *sheet, const struct points *points, const double *axes, const double *bend,
    const double *basis, int still, int splines, double *moved, ptrdiff_t stride) {
    const int columns = 2 + still + splines;
    struct tables tables = {.width = (columns + LANES - 1) / LANES * LANES};
    const size_t size = (size_t)sheet->count * FACTORS * tables.width;
    double *memory = calloc(2 * size + 3 * tables.width, sizeof *memory);
    if (!memory) return 0;
    tables.values = memory;
    tables.rates = memory + size;
    fill_tables(sheet, bend, basis, still, splines, &tables, memory + 2 * size);
    for (ptrdiff_t i = 0; i < points->count; i++) {
        double factors[2][FACTORS], *rows = moved + i * 2 * stride;
        vary_point(sheet, points, i, axes, factors, rows, stride);
        const double s = points->sheet[2 * i], t = points->sheet[2 * i + 1];
        const int left = node_before(sheet, s);
        const double x = (s - sheet->nodes[left]) / sheet->step, inside = x * (1 - x);
        sum_tables(
            &tables, left, x, 0.5 * sheet->step * (inside < 0 ? 0 : inside), factors, columns, rows + GLOBAL, stride);
        /* d(a, b) = t dw (1, 0), and dX = t A dw. */
        for (int axis = 0; axis < 2; axis++) {
            const double *G = factors[axis] + 3, *A = points->A + i;
            const double along = G[0] * A[0] + G[1] * A[points->count] + G[2] * A[2 * points->count] +
                                 (axis ? -sheet->sine : sheet->cosine);
            rows[axis * stride + GLOBAL] += along * (t * s);
            rows[axis * stride + GLOBAL + 1] += along * (t * s * s);
        }
    }
    free(memory);
    return 1;
}
