/* Connected components of masks, by their runs along rows. */

#include "bytes.h"
#include "kernels.h"

#include <stdlib.h>
#include <string.h>

struct run {
    int32_t first, last, root, number;
};

/* The `count` runs of a mask in the order of its rows; those of row y begin at `begins[y]`. */
struct runs {
    struct run *of;
    ptrdiff_t *begins;
    ptrdiff_t count, room;
};

/* Adds the runs of a row (count,). Returns 0 where memory is missing. */
AVX2 static int add_row(struct runs *runs, const uint8_t *row, ptrdiff_t count) {
    if (runs->room < runs->count + count / 2 + 1) {
        const ptrdiff_t room = 2 * runs->room + count;
        struct run *more = realloc(runs->of, room * sizeof *more);
        if (!more) return 0;
        runs->of = more;
        runs->room = room;
    }
    uint64_t inside = 0;
    int32_t first = 0;
    for (ptrdiff_t x = 0; x < count; x += WORD) {
        uint8_t last[WORD] = {0};
        if (x + WORD > count) memcpy(last, row + x, count - x);
        const uint64_t bits = set_bytes(x + WORD > count ? last : row + x);
        for (uint64_t changes = bits ^ (bits << 1 | inside); changes; changes &= changes - 1) {
            const int32_t at = (int32_t)x + __builtin_ctzll(changes);
            if (bits >> (at - x) & 1)
                first = at;
            else
                runs->of[runs->count++] = (struct run){first, at - 1, 0, 0};
        }
        inside = bits >> (WORD - 1);
    }
    if (inside) runs->of[runs->count++] = (struct run){first, (int32_t)count - 1, 0, 0};
    return 1;
}

static int32_t root_of(struct run *runs, int32_t at) {
    while (runs[at].root != at) {
        runs[at].root = runs[runs[at].root].root;
        at = runs[at].root;
    }
    return at;
}

/* Joins the runs of two rows that touch, at corners too. */
static void join_rows(struct run *runs, ptrdiff_t above, ptrdiff_t begin, ptrdiff_t end) {
    ptrdiff_t i = above, k = begin;
    while (i < begin && k < end) {
        if (runs[i].first <= runs[k].last + 1 && runs[k].first <= runs[i].last + 1) {
            const int32_t one = root_of(runs, (int32_t)i), other = root_of(runs, (int32_t)k);
            if (one < other)
                runs[other].root = one;
            else
                runs[one].root = other;
        }
        if (runs[i].last < runs[k].last)
            i++;
        else
            k++;
    }
}

/* Numbers components, from 1 on, by their first blocks of 2 x 2 pixels, row by row of blocks, as OpenCV does. */
static int32_t number_runs(struct runs *runs, ptrdiff_t rows) {
    int32_t total = 1;
    for (ptrdiff_t y = 0; y < rows; y += 2) {
        const ptrdiff_t middle = runs->begins[y + 1], end = y + 2 < rows ? runs->begins[y + 2] : runs->count;
        ptrdiff_t i = runs->begins[y], k = middle;
        while (i < middle || k < end) {
            const int upper = k >= end || (i < middle && runs->of[i].first / 2 <= runs->of[k].first / 2);
            const ptrdiff_t at = upper ? i++ : k++;
            struct run *root = runs->of + root_of(runs->of, (int32_t)at);
            if (!root->number) root->number = total++;
            runs->of[at].number = root->number;
        }
    }
    return total;
}

/* Numbers of the components of `mask` into `labels` (height, width), which is zero. Returns how many there are with the
   ground, or 0 where memory is missing. */
int label_mask(const struct image *mask, int32_t *labels) {
    const ptrdiff_t rows = mask->height, columns = mask->width;
    struct runs runs = {NULL, malloc((rows + 2) * sizeof(ptrdiff_t)), 0, 0};
    int good = runs.begins != NULL;
    for (ptrdiff_t y = 0; good && y < rows; y++) {
        runs.begins[y] = runs.count;
        good = add_row(&runs, mask->pixels + y * mask->stride, columns);
        if (!good) break;
        for (ptrdiff_t i = runs.begins[y]; i < runs.count; i++) runs.of[i].root = (int32_t)i;
        if (y) join_rows(runs.of, runs.begins[y - 1], runs.begins[y], runs.count);
    }
    int32_t total = 0;
    if (good) {
        runs.begins[rows] = runs.begins[rows + 1] = runs.count;
        total = number_runs(&runs, rows);
        for (ptrdiff_t y = 0; y < rows; y++)
            for (ptrdiff_t i = runs.begins[y]; i < runs.begins[y + 1]; i++)
                for (ptrdiff_t x = runs.of[i].first; x <= runs.of[i].last; x++)
                    labels[y * columns + x] = runs.of[i].number;
    }
    free(runs.of);
    free(runs.begins);
    return total;
}

/* Bounds and area `stats` (total, 5) of components: first and last column, first and last row, and pixels; `sums`
   (2, total) of their columns and rows. The first columns and rows are those of an image's end before, the last ones are
   -1, all others 0. Returns 0 where memory is missing. */
int measure_labels(const struct image *mask, const int32_t *labels, int32_t total, int32_t *stats, double *sums) {
    struct runs runs = {NULL, NULL, 0, 0};
    for (ptrdiff_t y = 0; y < mask->height; y++) {
        runs.count = 0;
        if (!add_row(&runs, mask->pixels + y * mask->stride, mask->width)) {
            free(runs.of);
            return 0;
        }
        for (ptrdiff_t i = 0; i < runs.count; i++) {
            const struct run run = runs.of[i];
            const int32_t number = labels[y * mask->width + run.first], length = run.last - run.first + 1;
            int32_t *own = stats + 5 * (ptrdiff_t)number;
            own[0] = run.first < own[0] ? run.first : own[0];
            own[1] = run.last > own[1] ? run.last : own[1];
            own[2] = y < own[2] ? (int32_t)y : own[2];
            own[3] = (int32_t)y;
            own[4] += length;
            sums[number] += (double)length * (run.first + run.last) / 2;
            sums[total + number] += (double)length * y;
        }
    }
    free(runs.of);
    return 1;
}

/* Marks in `found` (height, width), which is zero, the pixels of `mask` whose numbers `labels` (height, width) are
   `chosen` (total,); others than these numbers are not. */
AVX2 void keep_labels(
    const struct image *mask, const int32_t *labels, const uint8_t *chosen, int32_t total, uint8_t *found) {
    const ptrdiff_t columns = mask->width;
    for (ptrdiff_t y = 0; y < mask->height; y++) {
        const uint8_t *row = mask->pixels + y * mask->stride;
        for (ptrdiff_t x = 0; x < columns; x += WORD) {
            uint8_t last[WORD] = {0};
            if (x + WORD > columns) memcpy(last, row + x, columns - x);
            for (uint64_t bits = set_bytes(x + WORD > columns ? last : row + x); bits; bits &= bits - 1) {
                const ptrdiff_t at = y * columns + x + __builtin_ctzll(bits);
                found[at] = labels[at] < total && chosen[labels[at]];
            }
        }
    }
}

static const float SIDE = 0.955f, CORNER = 1.3693f, FAR = 1e9f;

static inline float least(float a, float b) { return a < b ? a : b; }

/* Rows of distances: of two rows beside each other, with a pixel beyond each end, and of the pixels of all runs. */
struct distances {
    float *own, *beside, *of;
};

/* Each pixel of the run is as far from the ground as it `was`, or by a step from the row beside or from the pixel before
   it, on the way from `begin` by `way`. */
static inline float step_on(const struct distances *rows, ptrdiff_t x, int way, float was) {
    const float aside = least(rows->beside[x - 1], rows->beside[x + 1]) + CORNER;
    const float straight = least(rows->own[x - way], rows->beside[x]) + SIDE;
    return rows->own[x] = least(was, least(aside, straight));
}

static void clear(float *row, const struct run *run, const struct run *end) {
    for (; run < end; run++) memset(row + run->first, 0, (run->last - run->first + 1) * sizeof *row);
}

static void swap(struct distances *rows) {
    float *row = rows->own;
    rows->own = rows->beside;
    rows->beside = row;
}

/* All is far beyond the image. */
static void begin_beyond(struct distances *rows, ptrdiff_t columns) {
    for (ptrdiff_t x = -1; x <= columns; x++) {
        rows->beside[x] = FAR;
        rows->own[x] = x < 0 || x == columns ? FAR : 0;
    }
}

/* Sums `total` (count,) over the pixels of each component of their distances from the ground, by steps to neighbours of
   3 x 3 pixels, with OpenCV's lengths. Returns 0 where memory is missing. */
int sum_distances(const struct image *mask, const int32_t *labels, double *total, int32_t count) {
    const ptrdiff_t height = mask->height, columns = mask->width;
    struct runs runs = {NULL, malloc((height + 1) * sizeof(ptrdiff_t)), 0, 0};
    float *two = malloc(2 * (columns + 2) * sizeof *two);
    int good = two && runs.begins;
    ptrdiff_t pixels = 0;
    for (ptrdiff_t y = 0; good && y < height; y++) {
        runs.begins[y] = runs.count;
        good = add_row(&runs, mask->pixels + y * mask->stride, columns);
        for (ptrdiff_t i = runs.begins[y]; i < runs.count; i++) {
            runs.of[i].root = (int32_t)pixels;
            pixels += runs.of[i].last - runs.of[i].first + 1;
        }
    }
    float *of = good ? malloc((pixels + 1) * sizeof *of) : NULL;
    good = of != NULL;
    if (good) {
        runs.begins[height] = runs.count;
        struct distances rows = {two + 1, two + columns + 3, of};
        begin_beyond(&rows, columns);
        for (ptrdiff_t y = 0; y < height; y++) {
            const struct run *begin = runs.of + runs.begins[y], *end = runs.of + runs.begins[y + 1];
            for (const struct run *run = begin; run < end; run++)
                for (ptrdiff_t x = run->first; x <= run->last; x++)
                    of[run->root + x - run->first] = step_on(&rows, x, 1, FAR);
            if (y)
                clear(rows.beside, runs.of + runs.begins[y - 1], begin);
            else
                memset(rows.beside, 0, columns * sizeof *two);
            swap(&rows);
        }
        begin_beyond(&rows, columns);
        for (ptrdiff_t y = height - 1; y >= 0; y--) {
            const struct run *begin = runs.of + runs.begins[y], *end = runs.of + runs.begins[y + 1];
            for (const struct run *run = begin; run < end; run++) {
                double sum = 0;
                for (ptrdiff_t x = run->last; x >= run->first; x--)
                    sum += step_on(&rows, x, -1, of[run->root + x - run->first]);
                const int32_t number = labels[y * columns + run->first];
                if (number < count) total[number] += sum;
            }
            if (y < height - 1)
                clear(rows.beside, end, runs.of + runs.begins[y + 2]);
            else
                memset(rows.beside, 0, columns * sizeof *two);
            swap(&rows);
        }
    }
    free(of);
    free(two);
    free(runs.of);
    free(runs.begins);
    return good;
}
