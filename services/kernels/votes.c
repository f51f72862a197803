/* The bin of displacements that stands out most, over all scales. */

#include "kernels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NEAR = 1, FAR = 6 }; /* reach of a group, and of its surroundings, bins */

/* Votes of one scale: bins (.., 2), among which `sums` has the integral of counts over a box of bins. */
struct box {
    int64_t left, top, width, height;
    int32_t *sums; /* (height + 1, width + 1) */
};

static inline int64_t within(int64_t value, int64_t least, int64_t most) {
    return value < least ? least : value > most ? most : value;
}

/* Sum of the bins at most `reach` away from (x, y). */
static inline int32_t sum_round(const struct box *box, int64_t x, int64_t y, int64_t reach) {
    const int64_t left = within(x - reach - box->left, 0, box->width), top = within(y - reach - box->top, 0, box->height);
    const int64_t right = within(x + reach + 1 - box->left, 0, box->width);
    const int64_t bottom = within(y + reach + 1 - box->top, 0, box->height);
    const int32_t *above = box->sums + top * (box->width + 1), *below = box->sums + bottom * (box->width + 1);
    return below[right] - below[left] - above[right] + above[left];
}

/* Counts become their integral. */
static void integrate(struct box *box) {
    const int64_t pitch = box->width + 1;
    for (int64_t y = 1; y <= box->height; y++) {
        int32_t *here = box->sums + y * pitch, along = 0;
        const int32_t *above = here - pitch;
        for (int64_t x = 1; x <= box->width; x++) here[x] = (along += here[x]) + above[x];
    }
}

/* Standard deviations of a Poisson count by which a group exceeds its surroundings. */
static inline float surprise(int32_t group, int32_t around) {
    enum { NEAR_BINS = (2 * NEAR + 1) * (2 * NEAR + 1), FAR_BINS = (2 * FAR + 1) * (2 * FAR + 1) };
    const float expected = (float)(around - group) * (float)((double)NEAR_BINS / (FAR_BINS - NEAR_BINS));
    return ((float)group - expected) / sqrtf(expected + 1.0f);
}

/* `found` becomes the scale, column and row of the bin whose group is most surprising, the first of those that are
   alike. `bins` (scales, matches, 2) are displacements; those that are `voting` (scales, matches) count, one at least.
   Rows run on from scale to scale as if all stood in one column, with gaps of `2 FAR + 1` rows: a bin just above a
   scale's first row is the last one of the gap. Returns 0 where memory is missing. */
int outstanding_bin(const double *bins, const uint8_t *voting, ptrdiff_t scales, ptrdiff_t matches, int64_t *found) {
    int64_t *at = malloc(2 * scales * matches * sizeof *at);
    ptrdiff_t *ends = malloc(scales * sizeof *ends);
    if (!at || !ends) {
        free(at);
        free(ends);
        return 0;
    }
    int64_t left = INT64_MAX, top = INT64_MAX, right = INT64_MIN, bottom = INT64_MIN;
    ptrdiff_t votes = 0;
    for (ptrdiff_t scale = 0; scale < scales; scale++) {
        for (ptrdiff_t i = scale * matches; i < (scale + 1) * matches; i++) {
            if (!voting[i]) continue;
            const int64_t x = (int64_t)floor(bins[2 * i]), y = (int64_t)floor(bins[2 * i + 1]);
            at[2 * votes] = x, at[2 * votes + 1] = y, votes++;
            left = x < left ? x : left, right = x > right ? x : right;
            top = y < top ? y : top, bottom = y > bottom ? y : bottom;
        }
        ends[scale] = votes;
    }
    const int64_t pitch = bottom - top + 1 + 2 * FAR + 1;
    int32_t *sums = malloc((right - left + 2) * (bottom - top + 2) * sizeof *sums);
    float most = -INFINITY;
    int64_t best = 0;
    for (ptrdiff_t scale = 0, first = 0; sums && scale < scales; first = ends[scale++]) {
        const ptrdiff_t end = ends[scale];
        if (first == end) continue;
        int64_t x0 = at[2 * first], x1 = x0, y0 = at[2 * first + 1], y1 = y0;
        for (ptrdiff_t i = first + 1; i < end; i++) {
            const int64_t x = at[2 * i], y = at[2 * i + 1];
            x0 = x < x0 ? x : x0, x1 = x > x1 ? x : x1;
            y0 = y < y0 ? y : y0, y1 = y > y1 ? y : y1;
        }
        struct box box = {x0, y0, x1 - x0 + 1, y1 - y0 + 1, sums};
        memset(sums, 0, (box.width + 1) * (box.height + 1) * sizeof *sums);
        for (ptrdiff_t i = first; i < end; i++)
            sums[(at[2 * i + 1] - y0 + 1) * (box.width + 1) + at[2 * i] - x0 + 1]++;
        integrate(&box);
        for (ptrdiff_t i = first; i < end; i++) {
            for (int64_t y = at[2 * i + 1] - NEAR; y <= at[2 * i + 1] + NEAR; y++) {
                const int64_t row = scale * pitch + y - top;
                if (row < 0) continue;
                for (int64_t x = at[2 * i] - NEAR; x <= at[2 * i] + NEAR; x++) {
                    if (x < left || x > right) continue;
                    const int32_t group = sum_round(&box, x, y, NEAR);
                    const float here = surprise(group, sum_round(&box, x, y, FAR));
                    const int64_t place = row * (right - left + 1) + x - left;
                    if (here > most || (here == most && place < best)) most = here, best = place;
                }
            }
        }
    }
    const int64_t row = best / (right - left + 1);
    found[0] = row / pitch, found[1] = left + best % (right - left + 1), found[2] = top + row % pitch;
    const int good = sums != NULL;
    free(at);
    free(ends);
    free(sums);
    return good;
}
