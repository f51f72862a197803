/* Photos in matched light on the reduced mosaic, in single precision: sums over pixels, and means of cells. */

#include "kernels.h"

#include <immintrin.h>
#include <stdlib.h>

enum { CHANNELS = 3, CELL = 4 };

/* A box of the mosaic of `width` x `height` pixels; `page` has three channels, `weight` and `bright` one; strides are
   those of single precision numbers. */
struct canvas_box {
    float *page, *weight;
    const float *bright;
    ptrdiff_t page_stride, weight_stride, bright_stride;
    int32_t width, height;
};

/* A photo in this box, packed: colours and their gains, and what it shows of it. */
struct lit_view {
    const float *image, *gain, *feather;
    const uint8_t *shown;
};

/* Each number of a row once for each channel. */
AVX2 static void for_channels(float *restrict wide, const float *restrict row, ptrdiff_t width) {
    for (ptrdiff_t x = 0; x < width; x++) wide[3 * x] = wide[3 * x + 1] = wide[3 * x + 2] = row[x];
}

/* The view in its light is added to the page, each pixel with the weight of its feather. Returns 0 where memory is
   missing. */
AVX2 int add_lit(const struct canvas_box *box, const struct lit_view *view) {
    const ptrdiff_t width = box->width, numbers = CHANNELS * width;
    float *wide = malloc((numbers + 1) * sizeof *wide);
    for (ptrdiff_t y = 0; wide && y < box->height; y++) {
        float *restrict page = box->page + y * box->page_stride, *restrict weight = box->weight + y * box->weight_stride;
        const float *restrict image = view->image + y * numbers, *restrict gain = view->gain + y * numbers;
        const float *restrict feather = view->feather + y * width, *restrict share = wide;
        for_channels(wide, feather, width);
        for (ptrdiff_t i = 0; i < numbers; i++) page[i] += image[i] * gain[i] * share[i];
        for (ptrdiff_t x = 0; x < width; x++) weight[x] += feather[x];
    }
    free(wide);
    return wide != NULL;
}

/* The page over its weights, `least` at least, in place; `strongest` is its strongest channel. All are packed. */
AVX2 void end_mean(
    float *restrict page, const float *restrict weight, ptrdiff_t count, float least, float *restrict strongest) {
    for (ptrdiff_t i = 0; i < count; i++) {
        const float share = weight[i] > least ? weight[i] : least;
        const float red = page[3 * i] / share, green = page[3 * i + 1] / share, blue = page[3 * i + 2] / share;
        const float more = red > green ? red : green;
        page[3 * i] = red;
        page[3 * i + 1] = green;
        page[3 * i + 2] = blue;
        strongest[i] = more > blue ? more : blue;
    }
}

/* Of each cell of the box the mean colours of the page and of the view in its light, six numbers, and the `share` of its
   pixels that count: where the page is bright and the view shows it. Others count as black. Sums are those of OpenCV,
   row by row. */
AVX2 void compare_cells(const struct canvas_box *box, const struct lit_view *view, float *means, float *share) {
    const ptrdiff_t width = box->width, columns = width / CELL, rows = box->height / CELL;
    const __m128i three = _mm_setr_epi32(-1, -1, -1, 0);
    for (ptrdiff_t cell = 0; cell < rows * columns; cell++) {
        const ptrdiff_t top = cell / columns * CELL, left = cell % columns * CELL;
        __m128 there = _mm_setzero_ps(), here = there;
        int counted = 0;
        for (ptrdiff_t y = top; y < top + CELL; y++) {
            const float *page = box->page + y * box->page_stride, *bright = box->bright + y * box->bright_stride;
            const float *image = view->image + CHANNELS * y * width, *gain = view->gain + CHANNELS * y * width;
            __m128 of_page = _mm_setzero_ps(), of_view = of_page;
            for (ptrdiff_t x = left; x < left + CELL; x++) {
                const int counts = view->shown[y * width + x] && bright[x] > 0.0f;
                const __m128i used = _mm_and_si128(three, _mm_set1_epi32(-counts));
                const __m128 color = _mm_maskload_ps(image + CHANNELS * x, used);
                of_page = _mm_add_ps(of_page, _mm_maskload_ps(page + CHANNELS * x, used));
                of_view = _mm_add_ps(of_view, _mm_mul_ps(color, _mm_maskload_ps(gain + CHANNELS * x, used)));
                counted += counts;
            }
            there = _mm_add_ps(there, of_page);
            here = _mm_add_ps(here, of_view);
        }
        const __m128 part = _mm_set1_ps(1.0f / (CELL * CELL));
        float *mean = means + 2 * CHANNELS * cell;
        _mm_maskstore_ps(mean, three, _mm_mul_ps(there, part));
        _mm_maskstore_ps(mean + CHANNELS, three, _mm_mul_ps(here, part));
        share[cell] = (float)counted * (1.0f / (CELL * CELL));
    }
}
