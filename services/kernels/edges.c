/* Steps of colour along lines across a curve. */

#include "kernels.h"

#include <immintrin.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CHANNELS = 3, TAPS = 5 };

/* Three channels of a pixel and of the one to its right, and two numbers that mean nothing. */
AVX2 static inline __m256 colors_at(const uint8_t *pixel) {
    return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)pixel)));
}

AVX2 static inline __m256 last_colors(const uint8_t *pixel, ptrdiff_t right) {
    const uint8_t *next = pixel + right;
    return _mm256_setr_ps(pixel[0], pixel[1], pixel[2], next[0], next[1], next[2], 0.0f, 0.0f);
}

AVX2 static inline __m128 mix(__m128 first, __m128 second, __m128 part) {
    return _mm_add_ps(first, _mm_mul_ps(_mm_broadcastss_ps(part), _mm_sub_ps(second, first)));
}

/* Between both pixels of `colors_at`. */
AVX2 static inline __m128 mix_pair(__m256 pair, __m128 part) {
    const __m256i next = _mm256_setr_epi32(3, 4, 5, 6, 7, 7, 7, 7);
    const __m128 right = _mm256_castps256_ps128(_mm256_permutevar8x32_ps(pair, next));
    return mix(_mm256_castps256_ps128(pair), right, part);
}

/* Bilinear at `place` (x, y), which is an `image`'s; the first three numbers are the channels. */
AVX2 static inline __m128 sample(const struct image *image, __m128 place) {
    const __m128i whole = _mm_cvttps_epi32(place);
    const __m128 part = _mm_sub_ps(place, _mm_cvtepi32_ps(whole));
    const int32_t column = _mm_cvtsi128_si32(whole), row = _mm_extract_epi32(whole, 1);
    const uint8_t *upper = image->pixels + row * image->stride + (ptrdiff_t)column * CHANNELS;
    const uint8_t *lower = upper + (row + 1 < image->height ? image->stride : 0);
    __m256 above, below;
    /* Eight bytes are loaded for six. */
    if (column + 2 < image->width) {
        above = colors_at(upper);
        below = colors_at(lower);
    } else {
        const ptrdiff_t right = column + 1 < image->width ? CHANNELS : 0;
        above = last_colors(upper, right);
        below = last_colors(lower, right);
    }
    return mix(mix_pair(above, part), mix_pair(below, part), _mm_movehdup_ps(part));
}

/* Means `colors` (steps, 3) over `sides` places beside each other, across a curve at `point`: at point + offset * normal +
   aside * (the normal turned by a quarter). Pixels of the border are repeated, and NaN is taken for 0. */
AVX2 static void sample_profile(
    const struct image *image, const double *point, const double *normal, const double *offsets, ptrdiff_t steps,
    const double *aside, ptrdiff_t sides, float *colors) {
    const __m128d middle = _mm_loadu_pd(point), across = _mm_loadu_pd(normal);
    const __m128d along = _mm_setr_pd(-normal[1], normal[0]);
    const __m128 last = _mm_setr_ps((float)(image->width - 1), (float)(image->height - 1), 0.0f, 0.0f);
    for (ptrdiff_t step = 0; step < steps; step++) {
        const __m128d at = _mm_add_pd(middle, _mm_mul_pd(_mm_set1_pd(offsets[step]), across));
        __m128 sum = _mm_setzero_ps();
        for (ptrdiff_t side = 0; side < sides; side++) {
            const __m128 place = _mm_cvtpd_ps(_mm_add_pd(at, _mm_mul_pd(_mm_set1_pd(aside[side]), along)));
            sum = _mm_add_ps(sum, sample(image, _mm_min_ps(_mm_max_ps(place, _mm_setzero_ps()), last)));
        }
        float mean[4];
        _mm_storeu_ps(mean, _mm_div_ps(sum, _mm_set1_ps((float)sides)));
        memcpy(colors + step * CHANNELS, mean, CHANNELS * sizeof *mean);
    }
}

/* The profiles (count, steps, 3) of `points` and `normals` (count, 2), with `tangential` (count, sides) places beside. */
AVX2 void sample_profiles(
    const struct image *image, const double *points, const double *normals, ptrdiff_t count, const double *offsets,
    ptrdiff_t steps, const double *tangential, ptrdiff_t sides, float *colors) {
    for (ptrdiff_t n = 0; n < count; n++)
        sample_profile(
            image, points + 2 * n, normals + 2 * n, offsets, steps, tangential + n * sides, sides,
            colors + n * steps * CHANNELS);
}

/* Of the profiles `colors` (count, steps, 3), at the `sought` steps from `begin` on: the `difference` (count, sought, 3) of
   the means of the steps from `first` to `last` on both sides, and how steeply colours change there `along` it, levels in
   a step (count, sought). Returns 0 where memory is missing. */
AVX2 int measure_steps(
    const float *colors, ptrdiff_t count, ptrdiff_t steps, ptrdiff_t begin, ptrdiff_t sought, ptrdiff_t first,
    ptrdiff_t last, double *difference, double *along) {
    static const float weights[TAPS] = {1 / 16.0f, 4 / 16.0f, 6 / 16.0f, 4 / 16.0f, 1 / 16.0f};
    double *sums = malloc((steps + 1) * CHANNELS * sizeof *sums);
    float *blurred = malloc((sought + 2) * CHANNELS * sizeof *blurred);
    const int good = sums && blurred;
    for (ptrdiff_t n = 0; good && n < count; n++) {
        const float *profile = colors + n * steps * CHANNELS;
        for (int c = 0; c < CHANNELS; c++) sums[c] = 0;
        for (ptrdiff_t i = 0; i < steps * CHANNELS; i++) sums[i + CHANNELS] = sums[i] + profile[i];
        /* From the step before the first one that is sought on. */
        for (ptrdiff_t i = 0; i < (sought + 2) * CHANNELS; i++) {
            const float *here = profile + (begin - 1 - TAPS / 2) * CHANNELS + i;
            blurred[i] = 0.0f;
            for (int k = 0; k < TAPS; k++) blurred[i] += weights[k] * here[k * CHANNELS];
        }
        for (ptrdiff_t m = 0; m < sought; m++) {
            const double *at = sums + (begin + m) * CHANNELS;
            double *way = difference + (n * sought + m) * CHANNELS, square = 0, sum = 0;
            for (int c = 0; c < CHANNELS; c++) {
                const double inner = at[(1 - first) * CHANNELS + c] - at[-last * CHANNELS + c];
                const double outer = at[(last + 1) * CHANNELS + c] - at[first * CHANNELS + c];
                way[c] = (outer - inner) / (last - first + 1);
                square += way[c] * way[c];
                sum += 0.5 * (blurred[(m + 2) * CHANNELS + c] - blurred[m * CHANNELS + c]) * way[c];
            }
            const double contrast = sqrt(square);
            along[n * sought + m] = sum / (contrast > 1e-6 ? contrast : 1e-6);
        }
    }
    free(blurred);
    free(sums);
    return good;
}
