/* Best paths down the rows of grids, by dynamic programming, and what paths across rays gain. */

#include "kernels.h"

#include <math.h>
#include <stdlib.h>

/* Best sums `best` of `score`, both (grids, rows, columns), over paths from the first row to every sample; shifts of up
   to `most` columns a row have the `costs` (2 most + 1). Returns 0 where memory is missing. */
AVX2 int accumulate_scores(
    const double *score, double *best, ptrdiff_t grids, ptrdiff_t rows, ptrdiff_t columns, int most,
    const double *costs) {
    /* A row with `most` samples beside it on both sides that no path reaches. */
    double *wide = malloc((columns + 2 * most) * sizeof *wide);
    if (!wide) return 0;
    for (ptrdiff_t i = 0; i < columns + 2 * most; i++) wide[i] = -INFINITY;
    for (ptrdiff_t row = 0; row < grids * rows; row++) {
        const double *gained = score + row * columns;
        double *reached = best + row * columns;
        if (row % rows == 0) {
            for (ptrdiff_t i = 0; i < columns; i++) reached[i] = gained[i];
        } else {
            for (ptrdiff_t i = 0; i < columns; i++) reached[i] = wide[i] - costs[0];
            for (int shift = 1; shift <= 2 * most; shift++)
                for (ptrdiff_t i = 0; i < columns; i++) {
                    const double sum = wide[i + shift] - costs[shift];
                    reached[i] = reached[i] > sum ? reached[i] : sum;
                }
            for (ptrdiff_t i = 0; i < columns; i++) reached[i] += gained[i];
        }
        for (ptrdiff_t i = 0; i < columns; i++) wide[most + i] = reached[i];
    }
    free(wide);
    return 1;
}

/* Columns `paths` (count, rows) of the paths that end at the columns `ends` of the last rows of the grids number
   `grids`, both (count,). Of shifts that are as good the first one is taken. */
void trace_back(
    const double *best, ptrdiff_t rows, ptrdiff_t columns, int most, const double *costs, const ptrdiff_t *grids,
    const ptrdiff_t *ends, ptrdiff_t count, ptrdiff_t *paths) {
    for (ptrdiff_t path = 0; path < count; path++) {
        ptrdiff_t at = ends[path];
        ptrdiff_t *columns_of = paths + path * rows;
        columns_of[rows - 1] = at;
        for (ptrdiff_t row = rows - 2; row >= 0; row--) {
            const double *sums = best + (grids[path] * rows + row) * columns;
            const ptrdiff_t first = at - most > 0 ? at - most : 0;
            const ptrdiff_t last = at + most < columns - 1 ? at + most : columns - 1;
            ptrdiff_t to = first;
            double most_sum = -INFINITY;
            for (ptrdiff_t from = first; from <= last; from++) {
                const double sum = sums[from] - costs[from - at + most];
                if (sum > most_sum) {
                    most_sum = sum;
                    to = from;
                }
            }
            columns_of[row] = at = to;
        }
    }
}

/* What a path gains at every sample, `score` (rays, samples): the `edges` there, and `weight` times the sum of the `odds` so
   far, of which there are as many a ray as `step` (0: one, 1: samples) says. At the `last` sample that is shown, (rays,), it
   gains `leaving` in place of an edge; it may not go beyond that, nor to samples before `least`, (rays,). */
void score_rays(
    const double *edges, const double *odds, ptrdiff_t step, const ptrdiff_t *last, const double *least, ptrdiff_t rays,
    ptrdiff_t samples, double weight, double leaving, double *score) {
    for (ptrdiff_t ray = 0; ray < rays; ray++) {
        const double *edge = edges + ray * samples, *odd = odds + ray * (step ? samples : 1);
        double *gained = score + ray * samples, sum = 0;
        const double first = least[ray] < (double)last[ray] ? least[ray] : (double)last[ray];
        for (ptrdiff_t i = 0; i <= last[ray]; i++) {
            sum += odd[i * step];
            gained[i] = (double)i < first ? -INFINITY : (i == last[ray] ? leaving : edge[i]) + weight * sum;
        }
        for (ptrdiff_t i = last[ray] + 1; i < samples; i++) gained[i] = -INFINITY;
    }
}
