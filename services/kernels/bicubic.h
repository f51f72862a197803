/* What the kernels that draw share: where pixels of a line are seen, and the line drawn from there. */

#ifndef BICUBIC_H
#define BICUBIC_H

#include "kernels.h"

enum {
    CHANNELS = 3,
    LINE_PX = 64, /* pixels whose places are computed together */
    NODE_PX = 16, /* GRID_STEP_PX of `services/imaging/node_grid.py` */
};

static inline int between(int value, int least, int most) {
    return value < least ? least : value > most ? most : value;
}

/* Where pixels of a line are seen: the first of four columns and rows, and the place within a pixel. */
struct places {
    int32_t column[LINE_PX], row[LINE_PX], across[LINE_PX], down[LINE_PX];
};

/* Rows of nodes above and below a row of pixels, and the share of the lower one. Nodes are NODE_PX pixels apart, the
   first one half of that before the first pixel's edge: values are bilinear between them. */
struct between_rows {
    int upper;
    float part;
};

static inline struct between_rows between_rows(int row) {
    const float down = (row % NODE_PX + 0.5f) / NODE_PX + 0.5f;
    /* Nodes above and below: those of the row itself, or of the half cell before it. */
    const struct between_rows found = {row / NODE_PX + (down >= 1.0f), down >= 1.0f ? down - 1.0f : down};
    return found;
}

/* Of `x` and `y` (count,) in pixels; these have room for eight more. What is no number is far away. */
void places_at(struct places *places, const float *x, const float *y, int count);

/* The line (count, CHANNELS) seen at `places`, by the `weights` (1024, 4) of four neighbours. Beyond the image they have
   the value `beyond`; those of its border, where that is negative. */
void draw_line(
    const struct image *image, const struct places *places, int count, const int16_t *weights, int beyond,
    uint8_t *drawn);

#endif
