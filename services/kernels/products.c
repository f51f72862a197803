/* Normal equations of sparse rows, into a band and a border. */

#include "kernels.h"

#include <stdlib.h>

/* Rows of a sparse matrix with `width` entries each, of these columns; entries of one column add up. */
struct rows {
    ptrdiff_t count, width;
    const ptrdiff_t *columns;
    const double *entries;
};

/* Of J^T J: the lower band of the first `banded` unknowns, `below` numbers under each diagonal one; `side` (banded,
   border) couples them with the others, `corner` (border, border) these among themselves; `gradient` is J^T r. */
struct equations {
    ptrdiff_t banded, border, below;
    double *band, *side, *corner, *gradient;
};

/* A row's entries that are not zero, each place among the unknowns once and in ascending order. Returns their number. */
static ptrdiff_t sort_row(
    const struct rows *rows, ptrdiff_t row, const ptrdiff_t *places, ptrdiff_t *at, double *entries) {
    ptrdiff_t count = 0;
    for (ptrdiff_t i = row * rows->width; i < (row + 1) * rows->width; i++) {
        const double entry = rows->entries[i];
        if (entry == 0) continue;
        const ptrdiff_t place = places[rows->columns[i]];
        ptrdiff_t k = count;
        while (k > 0 && at[k - 1] > place) k--;
        if (k > 0 && at[k - 1] == place) {
            entries[k - 1] += entry;
            continue;
        }
        for (ptrdiff_t m = count; m > k; m--) {
            at[m] = at[m - 1];
            entries[m] = entries[m - 1];
        }
        at[k] = place;
        entries[k] = entry;
        count++;
    }
    return count;
}

/* How far below the diagonal the products of the rows lie among the first `banded` of `unknowns`, whose columns have
   these `places`; -1 where a column is none of them. */
ptrdiff_t measure_band(const struct rows *rows, const ptrdiff_t *places, ptrdiff_t unknowns, ptrdiff_t banded) {
    ptrdiff_t most = 0;
    for (ptrdiff_t row = 0; row < rows->count; row++) {
        ptrdiff_t first = banded, last = -1;
        for (ptrdiff_t i = row * rows->width; i < (row + 1) * rows->width; i++) {
            const ptrdiff_t column = rows->columns[i];
            if (column < 0 || column >= unknowns) return -1;
            const ptrdiff_t place = places[column];
            if (rows->entries[i] == 0 || place >= banded) continue;
            first = place < first ? place : first;
            last = place > last ? place : last;
        }
        most = last - first > most ? last - first : most;
    }
    return most;
}

/* Adds the products of `rows` with each other and with their `residuals` (count,). Returns 0 where memory is missing. */
int add_products(
    const struct rows *rows, const double *residuals, const ptrdiff_t *places, const struct equations *sums) {
    ptrdiff_t *at = malloc((rows->width + 1) * sizeof *at);
    double *entries = malloc((rows->width + 1) * sizeof *entries);
    const int good = at && entries;
    const ptrdiff_t banded = sums->banded, border = sums->border;
    for (ptrdiff_t row = 0; good && row < rows->count; row++) {
        const ptrdiff_t count = sort_row(rows, row, places, at, entries);
        ptrdiff_t inner = count;
        while (inner > 0 && at[inner - 1] >= banded) inner--;
        for (ptrdiff_t i = 0; i < count; i++) sums->gradient[at[i]] += entries[i] * residuals[row];
        for (ptrdiff_t i = 0; i < inner; i++) {
            double *column = sums->band + at[i] * (sums->below + 1), *side = sums->side + at[i] * border;
            for (ptrdiff_t k = i; k < inner; k++) column[at[k] - at[i]] += entries[i] * entries[k];
            for (ptrdiff_t k = inner; k < count; k++) side[at[k] - banded] += entries[i] * entries[k];
        }
        for (ptrdiff_t i = inner; i < count; i++)
            for (ptrdiff_t k = inner; k < count; k++)
                sums->corner[(at[i] - banded) * border + at[k] - banded] += entries[i] * entries[k];
    }
    free(at);
    free(entries);
    return good;
}
