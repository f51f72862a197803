/* Images reduced by area averages: each pixel is the mean of what it covers. */

#include "kernels.h"

#include <immintrin.h>
#include <math.h>
#include <stdlib.h>

/* What `to` pixels along one axis cover: of each the first pixel of the image, and its shares (taps, to) of that one and
   the next ones. */
struct cover {
    int32_t *first;
    float *share;
    int to, taps;
};

static int make_cover(struct cover *cover, int from, int to) {
    const double step = (double)from / to;
    cover->to = to;
    cover->taps = (int)ceil(step) + 1;
    cover->first = malloc(to * sizeof *cover->first);
    cover->share = malloc((size_t)to * cover->taps * sizeof *cover->share);
    if (!cover->first || !cover->share) return 0;
    for (int i = 0; i < to; i++) {
        const double begin = i * step, end = (i + 1) * step;
        cover->first[i] = (int)begin;
        for (int k = 0; k < cover->taps; k++) {
            const double low = fmax(begin, cover->first[i] + k), high = fmin(end, cover->first[i] + k + 1.0);
            const int within = cover->first[i] + k < from;
            cover->share[(ptrdiff_t)k * to + i] = within && high > low ? (float)((high - low) / step) : 0.0f;
        }
    }
    return 1;
}

/* sums += share * row, of `count` bytes. */
AVX2 static void add_row(float *restrict sums, const uint8_t *restrict row, float share, ptrdiff_t count) {
    for (ptrdiff_t i = 0; i < count; i++) sums[i] += share * row[i];
}

AVX2 static void average(
    uint8_t *restrict drawn, const float *restrict sums, const struct cover *across, int channels) {
    const int to = across->to;
    const __m256 half = _mm256_set1_ps(0.5f);
    const __m256i each = _mm256_set1_epi32(channels);
    for (int c = 0; c < channels; c++) {
        int i = 0;
        for (; i + 8 <= to; i += 8) {
            const __m256i first = _mm256_loadu_si256((const __m256i *)(across->first + i));
            const __m256i at = _mm256_mullo_epi32(first, each);
            __m256 mean = half;
            for (int k = 0; k < across->taps; k++) {
                const __m256 covered = _mm256_i32gather_ps(sums + k * channels + c, at, 4);
                const __m256 share = _mm256_loadu_ps(across->share + (ptrdiff_t)k * to + i);
                mean = _mm256_add_ps(mean, _mm256_mul_ps(share, covered));
            }
            int32_t whole[8];
            _mm256_storeu_si256((__m256i *)whole, _mm256_cvttps_epi32(mean));
            for (int k = 0; k < 8; k++) drawn[(i + k) * channels + c] = (uint8_t)(whole[k] < 255 ? whole[k] : 255);
        }
        for (; i < to; i++) {
            float mean = 0.5f;
            for (int k = 0; k < across->taps; k++)
                mean += across->share[(ptrdiff_t)k * to + i] * sums[(across->first[i] + k) * channels + c];
            /* Shares of very many pixels add up to a little more than 1. */
            drawn[i * channels + c] = (uint8_t)(mean < 255.0f ? mean : 255.0f);
        }
    }
}

/* `view`, not larger than `image`, both with `channels` bytes a pixel. Returns 0 where memory is missing. */
int reduce_area(const struct image *image, const struct view *view, int channels) {
    struct cover across = {0}, down = {0};
    const ptrdiff_t count = (ptrdiff_t)image->width * channels;
    int good = make_cover(&across, image->width, view->width) && make_cover(&down, image->height, view->height);
    /* The last pixel's taps may lead beyond the row, with a share of nothing. */
    const ptrdiff_t room = count + (ptrdiff_t)across.taps * channels;
    float *sums = good ? malloc(room * sizeof *sums) : NULL;
    good = sums != NULL;
    for (int row = 0; good && row < view->height; row++) {
        for (ptrdiff_t i = 0; i < room; i++) sums[i] = 0.0f;
        for (int k = 0; k < down.taps; k++) {
            const float share = down.share[(ptrdiff_t)k * down.to + row];
            if (share > 0.0f) add_row(sums, image->pixels + (down.first[row] + k) * image->stride, share, count);
        }
        average(view->pixels + row * view->stride, sums, &across, channels);
    }
    free(sums);
    free(across.first);
    free(across.share);
    free(down.first);
    free(down.share);
    return good;
}
