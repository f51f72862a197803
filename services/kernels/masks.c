/* Masks, a byte a pixel, spread by squares, and thresholds by the windows round their pixels. */

#include "bytes.h"
#include "kernels.h"

#include <immintrin.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Words of bits (words,) of `count` bytes, and whether they are set; bits beyond are not. */
AVX2 static void pack(uint64_t *bits, const uint8_t *bytes, ptrdiff_t count) {
    uint8_t last[WORD] = {0};
    ptrdiff_t i = 0;
    for (; i + WORD <= count; i += WORD) bits[i / WORD] = set_bytes(bytes + i);
    if (i < count) {
        memcpy(last, bytes + i, count - i);
        bits[i / WORD] = set_bytes(last);
    }
}

AVX2 static void unpack(uint8_t *bytes, const uint64_t *bits, ptrdiff_t count) {
    const __m256i places = _mm256_set1_epi64x((int64_t)0x8040201008040201u), one = _mm256_set1_epi8(1);
    const __m256i of = _mm256_setr_epi64x(0, 0x0101010101010101, 0x0202020202020202, 0x0303030303030303);
    ptrdiff_t i = 0;
    for (; i + 32 <= count; i += 32) {
        const __m256i word = _mm256_set1_epi32((int32_t)(bits[i / WORD] >> i % WORD));
        const __m256i own = _mm256_and_si256(_mm256_shuffle_epi8(word, of), places);
        _mm256_storeu_si256((__m256i *)(bytes + i), _mm256_and_si256(_mm256_cmpeq_epi8(own, places), one));
    }
    for (; i < count; i++) bytes[i] = bits[i / WORD] >> i % WORD & 1;
}

/* Each bit of `row` (words,) is set where it or one of the `by` ones before it is, in steps that double. */
static void spread_bits(uint64_t *row, ptrdiff_t words, int by) {
    for (int reach = 1, step; reach <= by; reach += step) {
        step = reach <= by + 1 - reach ? reach : by + 1 - reach;
        const ptrdiff_t whole = step / WORD;
        const int part = step % WORD;
        for (ptrdiff_t i = words - 1; i >= whole; i--) {
            const uint64_t before = part && i > whole ? row[i - whole - 1] >> (WORD - part) : 0;
            row[i] |= row[i - whole] << part | before;
        }
    }
}

/* Moves bits by `by` places to the front. */
static void advance_bits(uint64_t *row, ptrdiff_t words, int by) {
    const ptrdiff_t whole = by / WORD;
    const int part = by % WORD;
    for (ptrdiff_t i = 0; i < words; i++) {
        const uint64_t own = i + whole < words ? row[i + whole] : 0;
        const uint64_t next = i + whole + 1 < words ? row[i + whole + 1] : 0;
        row[i] = part ? own >> part | next << (WORD - part) : own;
    }
}

struct bits {
    uint64_t *of;
    ptrdiff_t rows, words;
};

/* Sets the bits (rows, columns) with a set one in the square round them; nothing is set beyond. There is room for `half` a
   square more below and to the right. */
AVX2 static void spread(const struct bits *bits, ptrdiff_t rows, ptrdiff_t columns, int half) {
    const ptrdiff_t words = bits->words;
    for (ptrdiff_t y = 0; y < rows; y++) {
        spread_bits(bits->of + y * words, words, 2 * half);
        advance_bits(bits->of + y * words, words, half);
    }
    memset(bits->of + rows * words, 0, (bits->rows - rows) * words * sizeof *bits->of);
    for (int reach = 1, step; reach <= 2 * half; reach += step) {
        step = reach <= 2 * half + 1 - reach ? reach : 2 * half + 1 - reach;
        for (ptrdiff_t y = bits->rows - 1; y >= step; y--) {
            uint64_t *row = bits->of + y * words;
            const uint64_t *before = row - step * words;
            for (ptrdiff_t i = 0; i < words; i++) row[i] |= before[i];
        }
    }
    memmove(bits->of, bits->of + half * words, rows * words * sizeof *bits->of);
    const uint64_t kept = columns % WORD ? ((uint64_t)1 << columns % WORD) - 1 : ~(uint64_t)0;
    for (ptrdiff_t y = 0; y < rows; y++) {
        uint64_t *row = bits->of + y * words;
        row[(columns - 1) / WORD] &= kept;
        for (ptrdiff_t i = (columns - 1) / WORD + 1; i < words; i++) row[i] = 0;
    }
}

static void invert(const struct bits *bits, ptrdiff_t rows, ptrdiff_t columns) {
    const ptrdiff_t last = (columns - 1) / WORD;
    for (ptrdiff_t y = 0; y < rows; y++) {
        uint64_t *row = bits->of + y * bits->words;
        for (ptrdiff_t i = 0; i <= last; i++) row[i] = ~row[i];
        if (columns % WORD) row[last] &= ((uint64_t)1 << columns % WORD) - 1;
    }
}

/* The `mask` spread by squares of 2 `half` + 1 pixels into the view `found`. If it `closes`, what lies beyond it is then
   spread by the same squares, and taken away. Returns 0 where memory is missing. */
AVX2 int spread_mask(const struct image *mask, const struct view *found, int half, int closes) {
    const ptrdiff_t rows = mask->height, columns = mask->width;
    struct bits bits = {NULL, rows + 2 * (ptrdiff_t)half, (columns + 2 * (ptrdiff_t)half) / WORD + 1};
    bits.of = calloc(bits.rows * bits.words, sizeof *bits.of);
    if (!bits.of) return 0;
    for (ptrdiff_t y = 0; y < rows; y++) pack(bits.of + y * bits.words, mask->pixels + y * mask->stride, columns);
    spread(&bits, rows, columns, half);
    if (closes) {
        invert(&bits, rows, columns);
        spread(&bits, rows, columns, half);
        invert(&bits, rows, columns);
    }
    for (ptrdiff_t y = 0; y < rows; y++) unpack(found->pixels + y * found->stride, bits.of + y * bits.words, columns);
    free(bits.of);
    return 1;
}

/* The pixel that is shown at `at` where an image of `count` is reflected at its ends. */
static ptrdiff_t reflected(ptrdiff_t at, ptrdiff_t count) {
    while (at < 0 || at >= count) at = at < 0 ? -1 - at : 2 * count - 1 - at;
    return at;
}

AVX2 static void change_sums(
    uint32_t *restrict sums, uint32_t *restrict squares, const uint8_t *added, const uint8_t *removed, ptrdiff_t count) {
    for (ptrdiff_t x = 0; x < count; x++) {
        const uint32_t in = added[x], out = removed[x];
        sums[x] += in - out;
        squares[x] += in * in - out * out;
    }
}

/* `columns` (count + 2 half,) with the first and last `half` reflected from those between. */
static void reflect_ends(uint32_t *columns, ptrdiff_t count, int half) {
    for (ptrdiff_t x = 0; x < half; x++) {
        columns[x] = columns[half + reflected(x - half, count)];
        columns[half + count + x] = columns[half + reflected(count + x, count)];
    }
}

/* The `sums` and `squares` (count,) of windows of 2 `half` + 1 columns, from those of columns (count + 2 half,). */
static void slide(
    uint32_t *restrict sums, uint32_t *restrict squares, const uint32_t *columns, const uint32_t *column_squares,
    ptrdiff_t count, int half) {
    uint32_t sum = 0, square = 0;
    for (ptrdiff_t x = 0; x < 2 * half; x++) {
        sum += columns[x];
        square += column_squares[x];
    }
    for (ptrdiff_t x = 0; x < count; x++) {
        sums[x] = sum += columns[x + 2 * half];
        squares[x] = square += column_squares[x + 2 * half];
        sum -= columns[x];
        square -= column_squares[x];
    }
}

struct threshold {
    float k, contrast;
    int32_t half;
};

/* Which of eight pixels are ink: darker than mean + k deviation, where the deviation is above the contrast. */
AVX2 static inline __m256 ink_of(__m256 value, __m256 mean, __m256 square, const struct threshold *by) {
    const __m256 variance = _mm256_sub_ps(square, _mm256_mul_ps(mean, mean));
    const __m256 deviation = _mm256_sqrt_ps(_mm256_max_ps(variance, _mm256_setzero_ps()));
    const __m256 level = _mm256_add_ps(mean, _mm256_mul_ps(deviation, _mm256_set1_ps(by->k)));
    return _mm256_and_ps(
        _mm256_cmp_ps(deviation, _mm256_set1_ps(by->contrast), _CMP_GT_OQ), _mm256_cmp_ps(value, level, _CMP_LT_OQ));
}

/* The `ink` of a row of `gray` (count,) within `area` (count,), from the sums of the windows round its pixels. Means of the
   last pixels, that fill no vector, are rounded once: OpenCV does it so. */
AVX2 static void threshold_row(
    uint8_t *ink, const uint8_t *gray, const uint8_t *area, const uint32_t *sums, const uint32_t *squares,
    ptrdiff_t count, const struct threshold *by) {
    const double share = 1.0 / ((2.0 * by->half + 1) * (2.0 * by->half + 1));
    const __m256 scale = _mm256_set1_ps((float)share);
    ptrdiff_t x = 0;
    for (; x + 8 <= count; x += 8) {
        uint64_t seen;
        memcpy(&seen, area + x, 8);
        if (!seen) continue;
        const __m256 value = _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(gray + x))));
        const __m256 sum = _mm256_cvtepi32_ps(_mm256_loadu_si256((const __m256i *)(sums + x)));
        const __m256 square = _mm256_cvtepi32_ps(_mm256_loadu_si256((const __m256i *)(squares + x)));
        const int dark =
            _mm256_movemask_ps(ink_of(value, _mm256_mul_ps(sum, scale), _mm256_mul_ps(square, scale), by));
        for (int k = 0; k < 8; k++) ink[x + k] = area[x + k] && dark >> k & 1;
    }
    for (; x < count; x++) {
        const float mean = (float)((int32_t)sums[x] * share), square = (float)((int32_t)squares[x] * share);
        const float variance = square - mean * mean, deviation = sqrtf(variance > 0 ? variance : 0.0f);
        ink[x] = area[x] && deviation > by->contrast && gray[x] < mean + deviation * by->k;
    }
}

/* Niblack's threshold of `gray` within `area`, in windows of 2 half + 1 pixels a side, of at most 181, into the view `ink`
   of zeros. Returns 0 where memory is missing. */
AVX2 int threshold_windows(
    const struct image *gray, const struct image *area, const struct view *ink, const struct threshold *by) {
    const ptrdiff_t columns = gray->width, rows = gray->height;
    const int half = by->half;
    const ptrdiff_t wide = columns + 2 * (ptrdiff_t)half;
    uint32_t *memory = calloc(2 * (wide + columns), sizeof *memory);
    uint8_t *nothing = calloc(columns, 1);
    const int good = memory && nothing;
    if (good) {
        uint32_t *down = memory, *down_squares = down + wide, *sums = down_squares + wide, *squares = sums + columns;
        for (ptrdiff_t y = -half; y < half; y++)
            change_sums(
                down + half, down_squares + half, gray->pixels + reflected(y, rows) * gray->stride, nothing, columns);
        const uint8_t *before = nothing;
        for (ptrdiff_t y = 0; y < rows; y++) {
            const uint8_t *next = gray->pixels + reflected(y + half, rows) * gray->stride;
            change_sums(down + half, down_squares + half, next, before, columns);
            before = gray->pixels + reflected(y - half, rows) * gray->stride;
            reflect_ends(down, columns, half);
            reflect_ends(down_squares, columns, half);
            slide(sums, squares, down, down_squares, columns, half);
            threshold_row(
                ink->pixels + y * ink->stride, gray->pixels + y * gray->stride, area->pixels + y * area->stride, sums,
                squares, columns, by);
        }
    }
    free(memory);
    free(nothing);
    return good;
}
