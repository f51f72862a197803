/* Parts of photos in even light. */

#include "kernels.h"

#include <immintrin.h>
#include <math.h>
#include <stdlib.h>

enum { LANES = 8, COLUMNS = 16 };

/* Where pixels of the part lie in the light: at `factor` times their place and `shift` more, along each axis. */
struct placing {
    float x_factor, x_shift, y_factor, y_shift;
};

static inline int32_t within(float place, int32_t count) {
    const int32_t at = (int32_t)place;
    return at < 0 ? 0 : at < count ? at : count - 1;
}

/* A `row` of the light, bilinear at places `whole` + `share` (columns,); pixels of the border are repeated. */
FUSED static void draw_row(
    float *restrict drawn, const uint8_t *row, int32_t width, const float *whole, const float *share, ptrdiff_t columns) {
    for (ptrdiff_t x = 0; x < columns; x++) {
        const float left = row[within(whole[x], width)], right = row[within(whole[x] + 1.0f, width)];
        drawn[x] = fmaf(share[x], right - left, left);
    }
}

/* 255 `pixels` over what lies between two rows of light. Nothing remains where that is dark. */
FUSED static void divide_row(
    uint8_t *flat, const uint8_t *pixels, const float *upper, const float *lower, float share, ptrdiff_t columns) {
    const __m256 part = _mm256_set1_ps(share), white = _mm256_set1_ps(255.0f), zero = _mm256_setzero_ps();
    for (ptrdiff_t x = 0; x + LANES <= columns; x += LANES) {
        const __m256 above = _mm256_loadu_ps(upper + x), below = _mm256_loadu_ps(lower + x);
        const __m256 light = _mm256_round_ps(
            _mm256_fmadd_ps(part, _mm256_sub_ps(below, above), above), _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
        const __m256 value = _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(pixels + x))));
        const __m256 gray = _mm256_div_ps(_mm256_mul_ps(value, white), light);
        const __m256 lit = _mm256_and_ps(_mm256_min_ps(gray, white), _mm256_cmp_ps(light, zero, _CMP_GT_OQ));
        const __m256i levels = _mm256_cvtps_epi32(lit);
        const __m128i words = _mm_packs_epi32(_mm256_castsi256_si128(levels), _mm256_extracti128_si256(levels, 1));
        _mm_storel_epi64((__m128i *)(flat + x), _mm_packus_epi16(words, words));
    }
    for (ptrdiff_t x = columns - columns % LANES; x < columns; x++) {
        const float light = nearbyintf(fmaf(share, lower[x] - upper[x], upper[x]));
        const float gray = light > 0 ? pixels[x] * 255.0f / light : 0.0f;
        flat[x] = (uint8_t)nearbyintf(gray < 255.0f ? gray : 255.0f);
    }
}

/* `part` over its `light`, at the places of OpenCV: in whole vectors of columns, products are added to them without
   rounding. Returns 0 where memory is missing. */
FUSED int flatten_part(
    const struct image *part, const struct image *light, const struct placing *placing, const struct view *flat) {
    const ptrdiff_t columns = part->width, vectors = columns - columns % COLUMNS;
    float *memory = malloc(4 * columns * sizeof *memory);
    if (!memory) return 0;
    float *whole = memory, *share = whole + columns, *upper = share + columns, *lower = upper + columns;
    for (ptrdiff_t x = 0; x < columns; x++) {
        const float factor = placing->x_factor, shift = placing->x_shift;
        const float place = x < vectors ? fmaf((float)x, factor, shift) : (float)x * factor + shift;
        whole[x] = floorf(place);
        share[x] = place - whole[x];
    }
    int32_t upper_row = -1, lower_row = -1;
    for (ptrdiff_t y = 0; y < part->height; y++) {
        const float place = (float)y * placing->y_factor + placing->y_shift, row = floorf(place);
        const int32_t above = within(row, light->height), below = within(row + 1.0f, light->height);
        if (above != upper_row && above == lower_row) {
            float *swap = upper;
            upper = lower;
            lower = swap;
            lower_row = upper_row;
        } else if (above != upper_row)
            draw_row(upper, light->pixels + above * light->stride, light->width, whole, share, columns);
        upper_row = above;
        if (below != lower_row)
            draw_row(lower, light->pixels + below * light->stride, light->width, whole, share, columns);
        lower_row = below;
        divide_row(
            flat->pixels + y * flat->stride, part->pixels + y * part->stride, upper, lower, place - row, columns);
    }
    free(memory);
    return 1;
}
