/* Print of a photo in cells of the page, relative to its paper, and which photo a word is taken from. */

#include "kernels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* `count` cells. `light` and `weight` are sums over windows of the paper's level and of the cells that show it; `energy`
   has two numbers for each cell. */
struct cell_levels {
    ptrdiff_t count;
    const uint8_t *gray, *shown;
    const float *light, *weight, *energy;
};

/* What these cells show relative to their paper; where they are not shown it is zero, and they are not `bare`. */
struct related {
    float *darkness, *slope, *energy;
    uint8_t *bare;
};

AVX2 void relate_cells(
    const struct cell_levels *cells, float least_weight, float darkest, float bare_level, const struct related *into) {
    const uint8_t *restrict gray = cells->gray, *restrict shown = cells->shown;
    const float *restrict light = cells->light, *restrict weight = cells->weight, *restrict energy = cells->energy;
    float *restrict darkness = into->darkness, *restrict slope = into->slope, *restrict related = into->energy;
    uint8_t *restrict bare = into->bare;
    for (ptrdiff_t i = 0; i < cells->count; i++) {
        const float share = weight[i] > least_weight ? weight[i] : least_weight;
        const float smooth = light[i] / share;
        const float paper = smooth > darkest ? smooth : darkest;
        const float level = (float)gray[i] / paper, squared = paper * paper;
        const float across = energy[2 * i] / squared, down = energy[2 * i + 1] / squared;
        darkness[i] = shown[i] ? 1.0f - level : 0.0f;
        related[2 * i] = shown[i] ? across : 0.0f;
        related[2 * i + 1] = shown[i] ? down : 0.0f;
        bare[i] = shown[i] & (level > bare_level);
    }
    for (ptrdiff_t i = 0; i < cells->count; i++) slope[i] = sqrtf(related[2 * i] + related[2 * i + 1]);
}

/* `strength` becomes 255 `values` / `largest` where it is larger, `values` exceed `least`, and that `share` of the
   largest; no largest counts as less than `least`. */
AVX2 void raise_strength(
    const float *restrict values, const float *restrict largest, ptrdiff_t count, float least, float share,
    uint8_t *restrict strength) {
    for (ptrdiff_t i = 0; i < count; i++) {
        const float most = largest[i] > least ? largest[i] : least, relative = values[i] / most;
        const float positive = relative > 0.0f ? relative : 0.0f, part = positive < 1.0f ? positive : 1.0f;
        const int is_strong = (values[i] > least) & (part > share);
        const uint8_t own = is_strong ? (uint8_t)(int32_t)(255.0f * part) : 0;
        strength[i] = own > strength[i] ? own : strength[i];
    }
}

/* `energy` (count, 2) without `noise` (2), at least zero. */
AVX2 void remove_noise(float *restrict energy, ptrdiff_t count, const float *noise) {
    const float across = noise[0], down = noise[1];
    for (ptrdiff_t i = 0; i < count; i++) {
        const float first = energy[2 * i] - across, second = energy[2 * i + 1] - down;
        energy[2 * i] = first > 0.0f ? first : 0.0f;
        energy[2 * i + 1] = second > 0.0f ? second : 0.0f;
    }
}

enum { BITS = 11, BINS = 1 << BITS };

/* The value at the place `rank` of the sorted `values`, whose order is that of their bits: none is negative. */
static uint32_t value_at(const uint32_t *values, ptrdiff_t count, ptrdiff_t rank) {
    uint32_t known = 0, mask = 0;
    for (int shift = 32 - BITS; ; shift = shift > BITS ? shift - BITS : 0) {
        ptrdiff_t counts[BINS] = {0};
        for (ptrdiff_t i = 0; i < count; i++)
            if ((values[i] & mask) == known) counts[values[i] >> shift & (BINS - 1)]++;
        /* Bits that the last step has seen before are zero in all but one bin, or known. */
        int bin = 0;
        while (rank >= counts[bin]) rank -= counts[bin++];
        known |= (uint32_t)bin << shift;
        mask |= (uint32_t)(BINS - 1) << shift;
        if (shift == 0) return known;
    }
}

/* Medians of the two numbers of `values` (count, 2), none negative, where `mask` is set; of an even number the mean of
   the middle ones, of none 0. Returns 0 where memory is missing. */
int masked_medians(const float *values, const uint8_t *mask, ptrdiff_t count, float *medians) {
    uint32_t *kept = malloc((count + 1) * sizeof *kept);
    for (int k = 0; kept && k < 2; k++) {
        ptrdiff_t used = 0;
        for (ptrdiff_t i = 0; i < count; i++) {
            memcpy(kept + used, values + 2 * i + k, sizeof *kept);
            used += mask[i] != 0;
        }
        medians[k] = 0.0f;
        if (used == 0) continue;
        const uint32_t upper = value_at(kept, used, used / 2), lower = used % 2 ? upper : value_at(kept, used, used / 2 - 1);
        float high, low;
        memcpy(&high, &upper, sizeof high);
        memcpy(&low, &lower, sizeof low);
        medians[k] = (low + high) / 2.0f;
    }
    free(kept);
    return kept != NULL;
}

/* Sums of the two numbers of `values` (count, 2), one after the other, where `mask` is set; returns of how many. */
ptrdiff_t masked_sums(const float *values, const uint8_t *mask, ptrdiff_t count, float *sums) {
    ptrdiff_t used = 0;
    float across = 0.0f, down = 0.0f;
    for (ptrdiff_t i = 0; i < count; i++) {
        if (!mask[i]) continue;
        across += values[2 * i];
        down += values[2 * i + 1];
        used++;
    }
    sums[0] = across;
    sums[1] = down;
    return used;
}
