/* Bicubic drawing of colour images.

   A pixel of the view is seen at (x, y) of the photo, rounded to 1/1024 of a pixel. Its 16 neighbours are weighted by
   products of one weight for the column and one for the row, in units of 2^-15. AVX2 multiplies the four neighbours of
   a row with their weights, all channels at once. */

#include "bicubic.h"

#include <immintrin.h>
#include <string.h>

enum {
    BITS = 10,          /* of a place within a pixel, along one axis */
    STEPS = 1 << BITS,
    ONE = 1 << 15,      /* the sum of weights */
    LOADED_PX = 6,      /* pixels that 16 bytes may touch */
};

/* Places in the image by `x` and `y`, numbers that are `step` apart and `stride` from row to row; or the homography `H`
   (3, 3) of the view to the image. */
struct map {
    const float *x, *y;
    ptrdiff_t stride, step;
    const double *H;
};

/* `x` and `y` in steps. */
AVX2 static inline void set_places(struct places *places, const int32_t *x, const int32_t *y, int count) {
    for (int i = 0; i < count; i++) {
        places->column[i] = (x[i] >> BITS) - 1;
        places->row[i] = (y[i] >> BITS) - 1;
        places->across[i] = x[i] & (STEPS - 1);
        places->down[i] = y[i] & (STEPS - 1);
    }
}

AVX2 void places_at(struct places *places, const float *x, const float *y, int count) {
    const __m256 steps = _mm256_set1_ps(STEPS), most = _mm256_set1_ps(FARTHEST_PX), least = _mm256_set1_ps(-FARTHEST_PX);
    int32_t whole[2][LINE_PX];
    for (int axis = 0; axis < 2; axis++)
        for (int i = 0; i < count; i += 8) {
            /* The second operand is taken where the first is NaN. */
            const __m256 at = _mm256_max_ps(_mm256_loadu_ps((axis ? y : x) + i), least);
            const __m256i in_steps = _mm256_cvtps_epi32(_mm256_mul_ps(_mm256_min_ps(at, most), steps));
            _mm256_storeu_si256((__m256i *)(whole[axis] + i), in_steps);
        }
    set_places(places, whole[0], whole[1], count);
}

AVX2 static void places_by_map(struct places *places, const struct map *map, int left, int row, int count) {
    const ptrdiff_t first = row * map->stride + left * map->step;
    float x[LINE_PX] = {0}, y[LINE_PX] = {0};
    for (int i = 0; i < count; i++) {
        x[i] = map->x[first + i * map->step];
        y[i] = map->y[first + i * map->step];
    }
    places_at(places, x, y, count);
}

/* Between nodes along both axes. `left` is a multiple of NODE_PX. */
AVX2 static void places_between(struct places *places, const struct map *map, int left, int row, int count) {
    const struct between_rows rows = between_rows(row);
    const int first = left / NODE_PX;
    float x[LINE_PX] = {0}, y[LINE_PX] = {0};
    for (int axis = 0; axis < 2; axis++) {
        const float *nodes = axis ? map->y : map->x;
        float here[LINE_PX / NODE_PX + 2];
        for (int k = 0; k < LINE_PX / NODE_PX + 2 && k * NODE_PX < count + NODE_PX + NODE_PX / 2; k++) {
            const float *above = nodes + rows.upper * map->stride + (first + k) * map->step, *below = above + map->stride;
            here[k] = *above + rows.part * (*below - *above);
        }
        float *places_of = axis ? y : x;
        for (int k = 0; k * NODE_PX < count + NODE_PX / 2; k++) {
            const float value = here[k], rise = here[k + 1] - here[k];
            const int begin = between(k * NODE_PX - NODE_PX / 2, 0, count);
            const int end = between(k * NODE_PX + NODE_PX / 2, 0, count);
            for (int i = begin; i < end; i++) places_of[i] = value + ((i + 0.5f) / NODE_PX + 0.5f - k) * rise;
        }
    }
    places_at(places, x, y, count);
}

/* Of the pixels (left, row), (left + 1, row), ... */
AVX2 static void places_by_homography(struct places *places, const struct map *map, int left, int row, int count) {
    const double *H = map->H;
    const double start[3] = {H[0] * left + H[1] * row + H[2], H[3] * left + H[4] * row + H[5],
                             H[6] * left + H[7] * row + H[8]};
    const __m256d most = _mm256_set1_pd((double)FARTHEST_PX * STEPS), least = _mm256_set1_pd(-(double)FARTHEST_PX * STEPS);
    int32_t whole[2][LINE_PX];
    for (int i = 0; i < count; i += 4) {
        const __m256d at = _mm256_set_pd(i + 3, i + 2, i + 1, i);
        __m256d moved[3];
        for (int k = 0; k < 3; k++)
            moved[k] = _mm256_add_pd(_mm256_set1_pd(start[k]), _mm256_mul_pd(_mm256_set1_pd(H[3 * k]), at));
        const __m256d scale = _mm256_div_pd(_mm256_set1_pd(STEPS), moved[2]);
        for (int axis = 0; axis < 2; axis++) {
            const __m256d seen = _mm256_mul_pd(moved[axis], scale);
            const __m256d near = _mm256_min_pd(_mm256_max_pd(seen, least), most);
            _mm_storeu_si128((__m128i *)(whole[axis] + i), _mm256_cvtpd_epi32(near));
        }
    }
    set_places(places, whole[0], whole[1], count);
}

/* Any pixel. Beyond the image neighbours have the value `beyond`; those of its border, where that is negative. */
static void draw_one(
    const struct image *image, const struct places *places, int i, const int16_t *weights, int beyond, uint8_t *drawn) {
    const int16_t *across = weights + 4 * places->across[i], *down = weights + 4 * places->down[i];
    for (int channel = 0; channel < CHANNELS; channel++) {
        int32_t sum = ONE / 2;
        for (int k = 0; k < 16; k++) {
            const int column = places->column[i] + k % 4, row = places->row[i] + k / 4;
            const int x = between(column, 0, image->width - 1), y = between(row, 0, image->height - 1);
            const int within = beyond < 0 || (x == column && y == row);
            const int weight = (across[k % 4] * down[k / 4] + ONE / 2) >> 15;
            sum += weight * (within ? image->pixels[y * image->stride + x * CHANNELS + channel] : beyond);
        }
        drawn[channel] = (uint8_t)between(sum >> 15, 0, 255);
    }
}

/* Sums of one pixel in 2^-15: red, green, blue, and one that means nothing; in two halves that add up. */
AVX2 static inline __m256i sum_of(const uint8_t *first, ptrdiff_t stride, const int16_t *across, const int16_t *down) {
    /* RGBRGBRGBRGB -> RRRR GGGG BBBB, of two rows. */
    const __m256i by_channel = _mm256_setr_epi8(
        0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11, -1, -1, -1, -1, 0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11, -1, -1, -1, -1);
    /* Of four numbers of 16 bits: each four times. */
    const __m256i each_four = _mm256_setr_epi8(
        0, 1, 0, 1, 0, 1, 0, 1, 2, 3, 2, 3, 2, 3, 2, 3, 4, 5, 4, 5, 4, 5, 4, 5, 6, 7, 6, 7, 6, 7, 6, 7);
    int64_t columns, rows;
    memcpy(&columns, across, sizeof columns);
    memcpy(&rows, down, sizeof rows);
    const __m256i weights = _mm256_mulhrs_epi16(
        _mm256_set1_epi64x(columns), _mm256_shuffle_epi8(_mm256_set1_epi64x(rows), each_four));
    const __m256i zero = _mm256_setzero_si256();
    __m256i red_green = zero, blue = zero;
    for (int pair = 0; pair < 2; pair++) {
        /* Rows 0 and 2, then 1 and 3: as halves of `weights` hold them. */
        const __m128i upper = _mm_loadu_si128((const __m128i *)(first + pair * stride));
        const __m128i lower = _mm_loadu_si128((const __m128i *)(first + (pair + 2) * stride));
        const __m256i values = _mm256_shuffle_epi8(_mm256_set_m128i(lower, upper), by_channel);
        const __m256i row_weights =
            pair ? _mm256_unpackhi_epi64(weights, weights) : _mm256_unpacklo_epi64(weights, weights);
        red_green = _mm256_add_epi32(red_green, _mm256_madd_epi16(_mm256_unpacklo_epi8(values, zero), row_weights));
        blue = _mm256_add_epi32(blue, _mm256_madd_epi16(_mm256_unpackhi_epi8(values, zero), row_weights));
    }
    return _mm256_hadd_epi32(red_green, blue);
}

/* Four pixels, all of whose neighbours are within the image. */
AVX2 static inline void draw_four(
    const struct image *image, const struct places *places, int i, const int16_t *weights, uint8_t *drawn) {
    __m256i sums[4];
    for (int k = 0; k < 4; k++) {
        const ptrdiff_t at = places->row[i + k] * image->stride + (ptrdiff_t)places->column[i + k] * CHANNELS;
        sums[k] = sum_of(
            image->pixels + at, image->stride, weights + 4 * places->across[i + k], weights + 4 * places->down[i + k]);
    }
    const __m256i half = _mm256_set1_epi32(ONE / 2);
    __m256i two[2];
    for (int k = 0; k < 2; k++) {
        /* Halves: pixel k, pixel k + 2. */
        const __m256i upper = _mm256_permute2x128_si256(sums[k], sums[k + 2], 0x20);
        const __m256i lower = _mm256_permute2x128_si256(sums[k], sums[k + 2], 0x31);
        two[k] = _mm256_srai_epi32(_mm256_add_epi32(_mm256_add_epi32(upper, lower), half), 15);
    }
    /* R0 G0 B0 - R1 G1 B1 -, R2 G2 B2 - R3 G3 B3 - */
    const __m256i all = _mm256_packs_epi32(two[0], two[1]);
    const __m128i bytes = _mm_packus_epi16(_mm256_castsi256_si128(all), _mm256_extracti128_si256(all, 1));
    const __m128i order = _mm_setr_epi8(0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, -1, -1, -1, -1);
    const __m128i pixels = _mm_shuffle_epi8(bytes, order);
    const int64_t eight = _mm_cvtsi128_si64(pixels);
    const int32_t rest = _mm_extract_epi32(pixels, 2);
    memcpy(drawn, &eight, sizeof eight);
    memcpy(drawn + sizeof eight, &rest, sizeof rest);
}

AVX2 void draw_line(
    const struct image *image, const struct places *places, int count, const int16_t *weights, int beyond,
    uint8_t *drawn) {
    const int last_column = image->width - LOADED_PX, last_row = image->height - 4;
    for (int i = 0; i < count;) {
        int within = i + 4 <= count;
        for (int k = i; within && k < i + 4; k++)
            within = places->column[k] >= 0 && places->column[k] <= last_column && places->row[k] >= 0 &&
                     places->row[k] <= last_row;
        if (within)
            draw_four(image, places, i, weights, drawn + (ptrdiff_t)i * CHANNELS);
        else
            draw_one(image, places, i, weights, beyond, drawn + (ptrdiff_t)i * CHANNELS);
        i += within ? 4 : 1;
    }
}

static void draw(
    const struct image *image, const struct view *view, const int16_t *weights, int beyond, const struct map *map,
    void (*find)(struct places *, const struct map *, int left, int row, int count)) {
    struct places places;
    for (int row = 0; row < view->height; row++)
        for (int left = 0; left < view->width; left += LINE_PX) {
            const int count = between(view->width - left, 0, LINE_PX);
            find(&places, map, left, row, count);
            draw_line(
                image, &places, count, weights, beyond, view->pixels + row * view->stride + (ptrdiff_t)left * CHANNELS);
        }
}

/* The view of `image`: `weights` (1024, 4) are those of four neighbours. Its pixels are seen where `map` says. */
void draw_by_map(
    const struct image *image, const struct view *view, const int16_t *weights, int beyond, const struct map *map) {
    draw(image, view, weights, beyond, map, places_by_map);
}

/* The same between the nodes of `map`. */
void draw_between_nodes(
    const struct image *image, const struct view *view, const int16_t *weights, int beyond, const struct map *map) {
    draw(image, view, weights, beyond, map, places_between);
}

/* The same under the map's homography. */
void draw_by_homography(
    const struct image *image, const struct view *view, const int16_t *weights, int beyond, const struct map *map) {
    draw(image, view, weights, beyond, map, places_by_homography);
}
