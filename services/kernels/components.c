/* Boxes of the connected components of a mask. */

#include "kernels.h"

#include <stdlib.h>
#include <string.h>

/* A run of pixels along a row, and the run that stands for its component so far. */
struct run {
    int32_t first, last, parent;
};

/* Of one component: its box, and the first block of 2 x 2 pixels that it reaches, by which OpenCV numbers components. */
struct component {
    int64_t block;
    int32_t left, top, right, bottom;
};

static int32_t root_of(struct run *runs, int32_t run) {
    while (runs[run].parent != run) run = runs[run].parent = runs[runs[run].parent].parent;
    return run;
}

static int by_block(const void *one, const void *other) {
    const int64_t a = ((const struct component *)one)->block, b = ((const struct component *)other)->block;
    return (a > b) - (a < b);
}

/* The first pixel from `at` on that is set, or that is not. Zeros are skipped eight at a time. */
static inline int32_t next_set(const uint8_t *row, int32_t at, int32_t width) {
    uint64_t eight;
    while (at + 8 <= width && (memcpy(&eight, row + at, sizeof eight), !eight)) at += 8;
    while (at < width && !row[at]) at++;
    return at;
}

static inline int32_t next_clear(const uint8_t *row, int32_t at, int32_t width) {
    while (at < width && row[at]) at++;
    return at;
}

/* `boxes` (most, 4) become left, top, width and height of the components of `mask`, joined along sides and corners, in
   OpenCV's order. Returns their number, of which no more than `most` are written; -1 where memory is missing. */
ptrdiff_t component_boxes(const struct image *mask, int32_t *boxes, ptrdiff_t most) {
    ptrdiff_t room = 1 << 14, count = 0, found = 0;
    struct run *runs = malloc(room * sizeof *runs);
    ptrdiff_t *starts = malloc((mask->height + 1) * sizeof *starts);
    for (int y = 0; runs && starts && y < mask->height; y++) {
        const uint8_t *row = mask->pixels + y * mask->stride;
        starts[y] = count;
        ptrdiff_t above = y ? starts[y - 1] : 0;
        for (int32_t x = next_set(row, 0, mask->width); x < mask->width; x = next_set(row, x, mask->width)) {
            if (count == room) {
                struct run *more = realloc(runs, 2 * room * sizeof *runs);
                if (!more) free(runs);
                runs = more, room *= 2;
                if (!runs) break;
            }
            const int32_t first = x;
            x = next_clear(row, x, mask->width);
            int32_t parent = (int32_t)count;
            runs[count] = (struct run){first, x - 1, parent};
            while (above < starts[y] && runs[above].last < first - 1) above++;
            for (ptrdiff_t k = above; k < starts[y] && runs[k].first <= x; k++) {
                const int32_t other = root_of(runs, (int32_t)k);
                if (other < parent) runs[parent].parent = other, parent = other;
                else runs[other].parent = parent;
            }
            count++;
        }
    }
    struct component *components = NULL;
    int32_t *number = NULL;
    if (runs && starts) {
        starts[mask->height] = count;
        number = malloc((count + 1) * sizeof *number);
        for (ptrdiff_t k = 0; number && k < count; k++) {
            const int32_t root = root_of(runs, (int32_t)k);
            number[k] = root == k ? (int32_t)found++ : number[root];
        }
        components = number ? malloc((found + 1) * sizeof *components) : NULL;
    }
    if (!components) {
        free(runs);
        free(starts);
        free(number);
        return -1;
    }
    for (ptrdiff_t k = 0; k < found; k++) components[k] = (struct component){INT64_MAX, INT32_MAX, 0, -1, 0};
    for (int y = 0; y < mask->height; y++) {
        for (ptrdiff_t k = starts[y]; k < starts[y + 1]; k++) {
            struct component *one = components + number[k];
            const int64_t block = (int64_t)(y / 2) * mask->width + runs[k].first / 2;
            if (one->right < 0) one->top = y;
            one->bottom = y;
            one->left = runs[k].first < one->left ? runs[k].first : one->left;
            one->right = runs[k].last > one->right ? runs[k].last : one->right;
            one->block = block < one->block ? block : one->block;
        }
    }
    qsort(components, found, sizeof *components, by_block);
    for (ptrdiff_t k = 0; k < found && k < most; k++) {
        const struct component one = components[k];
        const int32_t box[4] = {one.left, one.top, one.right - one.left + 1, one.bottom - one.top + 1};
        memcpy(boxes + 4 * k, box, sizeof box);
    }
    free(runs);
    free(starts);
    free(number);
    free(components);
    return found;
}
