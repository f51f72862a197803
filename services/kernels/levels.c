/* Levels of print: shares of the paper's level, as OpenCV divides, and how often they occur. */

#include "kernels.h"

#include <immintrin.h>

enum { LANES = 8 };

/* The share of white that counts as the paper's own level; shares from `ink_end` on are no ink, those from `paper_first`
   to `paper_last` are paper. Channels of neutral ink differ by less than `chroma_end`. */
struct print_shares {
    float scale;
    int32_t ink_end, paper_first, paper_last, chroma_end;
};

/* Tiles (rows, columns) of an image, each with `bins` counts of shares. */
struct tile_counts {
    int64_t *counts;
    int32_t rows, columns, bins;
};

AVX2 static inline __m256i eight(const uint8_t *bytes) {
    return _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)bytes));
}

AVX2 static inline void store_eight(uint8_t *bytes, __m256i values) {
    const __m128i words = _mm_packs_epi32(_mm256_castsi256_si128(values), _mm256_extracti128_si256(values, 1));
    _mm_storel_epi64((__m128i *)bytes, _mm_packus_epi16(words, words));
}

/* `level` over `ground`, which is not 0: to the nearest number, or an even one, at most 255. */
AVX2 static inline int share_of(int level, int ground, float scale) {
    const int share = _mm_cvtss_si32(_mm_set_ss((float)level * scale / (float)ground));
    return share < 255 ? share : 255;
}

/* Which pixels of `gray` are ink and which are paper, 0/1, by their shares of the `ground`: all of one size, and packed. */
AVX2 void mark_print(
    const uint8_t *gray, const uint8_t *ground, ptrdiff_t count, const struct print_shares *print, uint8_t *is_ink,
    uint8_t *is_paper) {
    const __m256 scale = _mm256_set1_ps(print->scale);
    const __m256i one = _mm256_set1_epi32(1), white = _mm256_set1_epi32(255), ink_end = _mm256_set1_epi32(print->ink_end);
    const __m256i below = _mm256_set1_epi32(print->paper_first - 1), above = _mm256_set1_epi32(print->paper_last + 1);
    ptrdiff_t i = 0;
    for (; i + LANES <= count; i += LANES) {
        const __m256 level = _mm256_cvtepi32_ps(eight(gray + i)), light = _mm256_cvtepi32_ps(eight(ground + i));
        const __m256i exact = _mm256_cvtps_epi32(_mm256_div_ps(_mm256_mul_ps(level, scale), light));
        const __m256i share = _mm256_min_epi32(exact, white);
        const __m256i like_paper = _mm256_and_si256(_mm256_cmpgt_epi32(share, below), _mm256_cmpgt_epi32(above, share));
        store_eight(is_ink + i, _mm256_and_si256(_mm256_cmpgt_epi32(ink_end, share), one));
        store_eight(is_paper + i, _mm256_and_si256(like_paper, one));
    }
    for (; i < count; i++) {
        const int share = share_of(gray[i], ground[i], print->scale);
        is_ink[i] = share < print->ink_end;
        is_paper[i] = share >= print->paper_first && share <= print->paper_last;
    }
}

/* Count the strongest channel's shares of the `ground` where `is_ink` and the ink is neutral, in equal tiles of `image`,
   which has three channels; `ground` and `is_ink` are packed. */
AVX2 void count_ink(
    const struct image *image, const uint8_t *ground, const uint8_t *is_ink, const struct print_shares *print,
    const struct tile_counts *tiles) {
    const ptrdiff_t height = image->height, width = image->width;
    for (ptrdiff_t y = 0; y < height; y++) {
        const uint8_t *pixels = image->pixels + y * image->stride, *light = ground + y * width, *ink = is_ink + y * width;
        int64_t *row = tiles->counts + y * tiles->rows / height * tiles->columns * tiles->bins;
        for (ptrdiff_t x = 0; x < width; x++) {
            if (!ink[x]) continue;
            const int red = pixels[3 * x], green = pixels[3 * x + 1], blue = pixels[3 * x + 2];
            const int upper = red > green ? red : green, lower = red > green ? green : red;
            const int strongest = upper > blue ? upper : blue, weakest = lower < blue ? lower : blue;
            if (share_of(strongest - weakest, light[x], print->scale) >= print->chroma_end) continue;
            const int bin = share_of(strongest, light[x], print->scale) * tiles->bins / 256;
            row[x * tiles->columns / width * tiles->bins + bin]++;
        }
    }
}
