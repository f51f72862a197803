/* Ridges of successive windows, linked to lines. */

#include "kernels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Ridges (count,), by window and in it in the order in which they are given; heights `y`. A line may miss `gap` windows.
   The next ridge lies less than `bend` away from where the last few lead to, and less than `drift` a window from the
   last one; each window in between costs `wait`. */
struct ridges {
    const int64_t *window;
    const double *y;
    ptrdiff_t count;
    int64_t gap;
    double bend, drift, wait;
};

/* How far a line goes down from one window to the next by its last few ridges, whose last one is `tail`. */
static inline double slope_of(const struct ridges *ridges, const int64_t *before, int64_t tail) {
    const int64_t second = before[tail];
    if (second < 0 || before[second] < 0) return 0.0;
    const int64_t third = before[second], first = before[third] >= 0 ? before[third] : third;
    const int64_t apart = ridges->window[tail] - ridges->window[first];
    return (ridges->y[tail] - ridges->y[first]) / (double)(apart > 1 ? apart : 1);
}

/* `before` (count,) becomes the ridge before each one in its line, -1 before the first, and `length` (count,) the number
   of ridges up to it; `tails` (count,) the last ridges of all lines. Each of two linked ridges is the best match of the
   other, the first one of those that are as good. Returns the number of lines, -1 where memory is missing. */
ptrdiff_t link_ridges(const struct ridges *ridges, int64_t *before, int64_t *length, int64_t *tails) {
    const ptrdiff_t count = ridges->count;
    int64_t *open = malloc((3 * count + 1) * sizeof *open);
    double *least = malloc((count + 1) * sizeof *least);
    if (!open || !least) {
        free(open);
        free(least);
        return -1;
    }
    int64_t *best = open + count, *best_tail = best + count;
    ptrdiff_t ended = 0, lines = 0;
    for (ptrdiff_t first = 0, end; first < count; first = end) {
        const int64_t window = ridges->window[first];
        for (end = first; end < count && ridges->window[end] == window; end++) {
            before[end] = -1, length[end] = 1;
            least[end] = INFINITY;
        }
        /* Lines end in the order of the windows in which they do, with or without ridges. */
        const int64_t previous = first ? ridges->window[first - 1] : window;
        for (int64_t now = previous + 1; now <= window && now <= previous + ridges->gap + 2; now++) {
            ptrdiff_t kept = 0;
            for (ptrdiff_t i = 0; i < lines; i++) {
                if (now - ridges->window[open[i]] > ridges->gap) tails[ended++] = open[i];
                else open[kept++] = open[i];
            }
            lines = kept;
        }
        for (ptrdiff_t i = 0; i < lines; i++) {
            const int64_t tail = open[i];
            const double y = ridges->y[tail], ago = (double)(window - ridges->window[tail]);
            const double led = y + slope_of(ridges, before, tail) * ago;
            const double drift = ridges->drift * ago, wait = ridges->wait * ago;
            double nearest = INFINITY;
            best[i] = -1;
            for (ptrdiff_t j = first; j < end; j++) {
                const double apart = fabs(ridges->y[j] - led);
                if (!(apart < ridges->bend && fabs(ridges->y[j] - y) < drift)) continue;
                const double cost = apart + wait;
                if (cost < nearest) nearest = cost, best[i] = j;
                if (cost < least[j]) least[j] = cost, best_tail[j] = i;
            }
        }
        for (ptrdiff_t i = 0; i < lines; i++) {
            const int64_t j = best[i];
            if (j < 0 || best_tail[j] != i) continue;
            before[j] = open[i], length[j] = length[open[i]] + 1;
            open[i] = j;
        }
        for (ptrdiff_t j = first; j < end; j++)
            if (before[j] < 0) open[lines++] = j;
    }
    memcpy(tails + ended, open, lines * sizeof *open);
    free(open);
    free(least);
    return ended + lines;
}
