/* How often colours occur in parts of a photo. */

#include "kernels.h"

#include <stdlib.h>

enum { CHANNELS = 3, LIGHT = 18, RED = 32, BLUE = 32, BINS = LIGHT * RED * BLUE, BLOCK = 8 };
static const float BIN = 6.0f;

static inline int32_t within(int32_t bin, int32_t count) { return bin < 0 ? 0 : bin < count ? bin : count - 1; }

static inline uint16_t code_of(const int32_t *bins) {
    return (uint16_t)((within(bins[0], LIGHT) * RED + within(bins[1], RED)) * BLUE + within(bins[2], BLUE));
}

/* Number `codes` (count,) of the bins of `colors` (count, 3), CIE Lab. */
AVX2 void color_codes(const float *colors, ptrdiff_t count, uint16_t *codes) {
    static const float middle[CHANNELS] = {0.0f, RED / 2, BLUE / 2};
    float shift[BLOCK * CHANNELS];
    int32_t bins[BLOCK * CHANNELS];
    for (int i = 0; i < BLOCK * CHANNELS; i++) shift[i] = middle[i % CHANNELS];
    for (ptrdiff_t begin = 0; begin < count; begin += BLOCK) {
        const float *block = colors + begin * CHANNELS;
        const int here = (int)(count - begin < BLOCK ? count - begin : BLOCK);
        if (here == BLOCK)
            for (int i = 0; i < BLOCK * CHANNELS; i++) bins[i] = (int32_t)(block[i] / BIN + shift[i]);
        else
            for (int i = 0; i < here * CHANNELS; i++) bins[i] = (int32_t)(block[i] / BIN + shift[i]);
        for (int k = 0; k < here; k++) codes[begin + k] = code_of(bins + k * CHANNELS);
    }
}

/* Number `counts` (BINS,) of the `codes` (count,) in every bin, where `inside` (count,) is not 0. */
AVX2 void count_colors(const uint16_t *codes, const uint8_t *inside, ptrdiff_t count, int64_t *counts) {
    for (int bin = 0; bin < BINS; bin++) counts[bin] = 0;
    for (ptrdiff_t i = 0; i < count; i++)
        if (codes[i] < BINS) counts[codes[i]] += inside[i] != 0;
}

/* sums = values + half of both neighbours, which are `step` apart in cycles of `length` of them. */
AVX2 static void add_neighbours(const float *restrict values, float *restrict sums, int step, int length) {
    const int cycle = step * length;
    for (int begin = 0; begin < BINS; begin += cycle)
        for (int k = 0; k < length; k++) {
            const float *here = values + begin + k * step;
            const float *before = values + begin + (k ? k - 1 : length - 1) * step;
            const float *after = values + begin + (k + 1 < length ? k + 1 : 0) * step;
            for (int i = 0; i < step; i++)
                sums[begin + k * step + i] = here[i] + 0.5f * (before[i] + after[i]);
        }
}

/* The `counts` (BINS,) with half of those of neighbours along each axis: `smooth` (BINS,). Returns 0 where memory is
   missing. */
AVX2 int smooth_colors(const int64_t *counts, float *smooth) {
    float *work = malloc(BINS * sizeof *work);
    if (!work) return 0;
    for (int bin = 0; bin < BINS; bin++) smooth[bin] = (float)counts[bin];
    add_neighbours(smooth, work, RED * BLUE, LIGHT);
    add_neighbours(work, smooth, BLUE, RED);
    for (int begin = 0; begin < BINS; begin += BLUE) {
        const float *row = smooth + begin;
        float *sums = work + begin;
        sums[0] = row[0] + 0.5f * (row[BLUE - 1] + row[1]);
        for (int i = 1; i < BLUE - 1; i++) sums[i] = row[i] + 0.5f * (row[i - 1] + row[i + 1]);
        sums[BLUE - 1] = row[BLUE - 1] + 0.5f * (row[BLUE - 2] + row[0]);
    }
    for (int bin = 0; bin < BINS; bin++) smooth[bin] = work[bin];
    free(work);
    return 1;
}
