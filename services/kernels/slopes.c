/* Profiles of the ink in windows: along rows of several slopes, and along the rows and columns of a turned image. */

#include "kernels.h"

#include <immintrin.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TAPS = 4, LANES = 8, BLOCK = 128 };

/* Windows have `rows` and `columns`, of which `margin` rows above and below are in reserve for shifts. Strips of the same
   number of columns are summed. For each slope and strip there is a shift in whole rows and the weights of four rows. */
struct windows {
    const float *centres, *along, *across;
    const int32_t *shifts;
    const float *weights;
    int32_t count, rows, columns, margin, strips, slopes;
};

/* For each pixel, and two beyond each border, whether there is ink there (1), to the right (2), below (4), and both (8). */
struct corners {
    uint8_t *of;
    int32_t width, height;
};

FUSED static void join_rows(uint8_t *restrict of, const uint8_t *upper, const uint8_t *lower, ptrdiff_t width) {
    for (ptrdiff_t x = 0; x < width; x++)
        of[x] = (uint8_t)(upper[x] | upper[x + 1] << 1 | lower[x] << 2 | lower[x + 1] << 3);
}

FUSED static int find_corners(struct corners *corners, const struct image *ink) {
    const ptrdiff_t width = ink->width + 3, height = ink->height + 3;
    corners->width = (int32_t)width;
    corners->height = (int32_t)height;
    /* Eight bytes more, since four are loaded for one. */
    corners->of = malloc(width * height + 8);
    uint8_t *padded = calloc(2, width + 1);
    if (!corners->of || !padded) {
        free(corners->of);
        free(padded);
        return 0;
    }
    uint8_t *upper = padded, *lower = padded + width + 1;
    for (ptrdiff_t y = 0; y < height; y++) {
        /* The row y of the corners is that of the pixels from y - 2 on. */
        if (y >= 1 && y - 1 < ink->height)
            memcpy(lower + 2, ink->pixels + (y - 1) * ink->stride, ink->width);
        else
            memset(lower + 2, 0, ink->width);
        join_rows(corners->of + y * width, upper, lower, width);
        uint8_t *swap = upper;
        upper = lower;
        lower = swap;
    }
    free(padded);
    return 1;
}

FUSED static inline __m256 corner(__m256i bits, int which) {
    const __m256i one = _mm256_set1_epi32(1);
    return _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(bits, which), one));
}

/* Ink `drawn` (columns,) at the places from (x, y) on by steps (u * dx, u * dy), bilinear. Products are added without
   rounding them, as OpenCV does. There is room for whole vectors. */
FUSED static void draw_row(
    float *drawn, const struct corners *corners, float x, float y, float dx, float dy, const float *u, int columns) {
    const __m256i low = _mm256_set1_epi32(-2), stride = _mm256_set1_epi32(corners->width);
    const __m256i right = _mm256_set1_epi32(corners->width - 3), bottom = _mm256_set1_epi32(corners->height - 3);
    const __m256i shift = _mm256_set1_epi32(2 * corners->width + 2), used = _mm256_set1_epi32(15);
    const __m256 left = _mm256_set1_ps(x), top = _mm256_set1_ps(y);
    for (int c = 0; c < columns; c += LANES) {
        const __m256 step = _mm256_loadu_ps(u + c);
        const __m256 px = _mm256_add_ps(left, _mm256_mul_ps(step, _mm256_set1_ps(dx)));
        const __m256 py = _mm256_add_ps(top, _mm256_mul_ps(step, _mm256_set1_ps(dy)));
        const __m256 fx = _mm256_floor_ps(px), fy = _mm256_floor_ps(py);
        const __m256i ix = _mm256_min_epi32(_mm256_max_epi32(_mm256_cvttps_epi32(fx), low), right);
        const __m256i iy = _mm256_min_epi32(_mm256_max_epi32(_mm256_cvttps_epi32(fy), low), bottom);
        const __m256i at = _mm256_add_epi32(_mm256_add_epi32(_mm256_mullo_epi32(iy, stride), ix), shift);
        const __m256i bits = _mm256_i32gather_epi32((const int *)corners->of, at, 1);
        if (_mm256_testz_si256(bits, used)) {
            _mm256_storeu_ps(drawn + c, _mm256_setzero_ps());
            continue;
        }
        const __m256 a = _mm256_sub_ps(px, fx), b = _mm256_sub_ps(py, fy);
        const __m256 p00 = corner(bits, 0), p01 = corner(bits, 1), p10 = corner(bits, 2), p11 = corner(bits, 3);
        const __m256 above = _mm256_fmadd_ps(a, _mm256_sub_ps(p01, p00), p00);
        const __m256 below = _mm256_fmadd_ps(a, _mm256_sub_ps(p11, p10), p10);
        _mm256_storeu_ps(drawn + c, _mm256_fmadd_ps(b, _mm256_sub_ps(below, above), above));
    }
}

/* The sum of `count` numbers, in pairs as NumPy adds them. */
static float sum_pairs(const float *v, ptrdiff_t count) {
    if (count < 8) {
        float sum = 0;
        for (ptrdiff_t i = 0; i < count; i++) sum += v[i];
        return sum;
    }
    if (count > BLOCK) {
        const ptrdiff_t half = count / 2 - count / 2 % 8;
        return sum_pairs(v, half) + sum_pairs(v + half, count - half);
    }
    float s[8];
    memcpy(s, v, sizeof s);
    ptrdiff_t i = 8;
    for (; i < count - count % 8; i += 8)
        for (int k = 0; k < 8; k++) s[k] += v[i + k];
    float sum = ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
    for (; i < count; i++) sum += v[i];
    return sum;
}

/* The sum of the products of `count` numbers, in the order of NumPy's `einsum`. */
FUSED static float sum_products(const float *v, const float *w, int count) {
    __m128 sum = _mm_setzero_ps();
    int i = 0;
    for (; count - i >= 16; i += 16)
        for (int k = 12; k >= 0; k -= 4)
            sum = _mm_add_ps(_mm_mul_ps(_mm_loadu_ps(v + i + k), _mm_loadu_ps(w + i + k)), sum);
    for (; i < count; i += 4) {
        float a[4] = {0}, b[4] = {0};
        const int left = count - i < 4 ? count - i : 4;
        memcpy(a, v + i, left * sizeof *a);
        memcpy(b, w + i, left * sizeof *b);
        sum = _mm_add_ps(_mm_mul_ps(_mm_loadu_ps(a), _mm_loadu_ps(b)), sum);
    }
    const __m128 pairs = _mm_hadd_ps(sum, sum);
    return _mm_cvtss_f32(_mm_hadd_ps(pairs, pairs));
}

/* `v` (1, 2, 1) / 4 along `rows` numbers; the first and the last one stay. */
FUSED static void smooth(float *restrict smoothed, const float *restrict v, int rows) {
    smoothed[0] = v[0];
    for (int r = 1; r < rows - 1; r++) smoothed[r] = (0.25f * v[r - 1] + 0.5f * v[r]) + 0.25f * v[r + 1];
    smoothed[rows - 1] = v[rows - 1];
}

/* A profile (height,) of one slope: the sum of the `strips` (strips, room), each shifted. */
FUSED static void add_strips(
    float *profile, const float *strips, ptrdiff_t room, int count, int height, int margin, const int32_t *shifts,
    const float *weights) {
    for (int r = 0; r < height; r += 4 * LANES) {
        __m256 sum[4] = {_mm256_setzero_ps(), _mm256_setzero_ps(), _mm256_setzero_ps(), _mm256_setzero_ps()};
        for (int j = 0; j < count; j++)
            for (int i = 0; i < TAPS; i++) {
                const float *from = strips + j * room + margin + shifts[j] - 1 + i + r;
                const __m256 weight = _mm256_broadcast_ss(weights + TAPS * j + i);
                for (int k = 0; k < 4; k++)
                    sum[k] = _mm256_fmadd_ps(weight, _mm256_loadu_ps(from + LANES * k), sum[k]);
            }
        for (int k = 0; k < 4; k++) _mm256_storeu_ps(profile + r + LANES * k, sum[k]);
    }
}

/* Standard deviations (slopes,) of `profiles` (slopes, room); `means` and `squares` have room for one each. */
static void deviations(
    double *energies, float *means, float *squares, const float *profiles, ptrdiff_t room, int slopes, int height) {
    for (int k = 0; k < slopes; k++) means[k] = squares[k] = 0;
    for (int r = 0; r < height; r++)
        for (int k = 0; k < slopes; k++) means[k] += profiles[k * room + r];
    for (int k = 0; k < slopes; k++) means[k] /= (float)height;
    for (int r = 0; r < height; r++)
        for (int k = 0; k < slopes; k++) {
            const float off = profiles[k * room + r] - means[k];
            squares[k] += off * off;
        }
    for (int k = 0; k < slopes; k++) energies[k] = sqrtf(squares[k] / (float)height);
}

/* Of each window of `ink`: the deviations `energies` (count, slopes) of its profiles, its smoothed ink `amount` (count,)
   without the margins, and the same ink as it is: `mass` (count,), and `moment` (count,), its sum of distances in columns
   from the middle. Returns 0 where memory is missing. */
FUSED int measure_windows(
    const struct image *ink, const struct windows *windows, double *energies, float *amount, float *mass,
    float *moment) {
    const int rows = windows->rows, columns = windows->columns, margin = windows->margin, strips = windows->strips;
    const int height = rows - 2 * margin, slopes = windows->slopes, width = columns / strips;
    /* Whole vectors are written behind the last row, and read behind the last strip. */
    const ptrdiff_t room = rows + 4 * LANES, all = (ptrdiff_t)rows * columns + LANES;
    float *memory = calloc(all + columns + LANES + (strips + 1 + slopes) * room + 2 * slopes, sizeof *memory);
    struct corners corners;
    if (!memory || !find_corners(&corners, ink)) {
        free(memory);
        return 0;
    }
    float *drawn = memory, *u = drawn + all, *summed = u + columns + LANES;
    float *once = summed + strips * room, *profiles = once + room, *means = profiles + slopes * room;
    for (int c = 0; c < columns; c++) u[c] = (float)(c - (columns - 1) / 2.0);
    for (ptrdiff_t n = 0; n < windows->count; n++) {
        const float *at = windows->centres + 2 * n, *along = windows->along + 2 * n, *across = windows->across + 2 * n;
        for (int r = 0; r < rows; r++) {
            const float v = (float)(r - (rows - 1) / 2.0);
            float *row = drawn + (ptrdiff_t)r * columns;
            draw_row(row, &corners, at[0] + v * across[0], at[1] + v * across[1], along[0], along[1], u, columns);
            for (int j = 0; j < strips; j++) {
                float sum = row[j * width];
                for (int c = 1; c < width; c++) sum += row[j * width + c];
                summed[j * room + r] = sum;
            }
        }
        const float *middle = drawn + (ptrdiff_t)margin * columns;
        mass[n] = sum_pairs(middle, (ptrdiff_t)height * columns);
        moment[n] = amount[n] = 0;
        for (int r = 0; r < height; r++) moment[n] = sum_products(middle + (ptrdiff_t)r * columns, u, columns) + moment[n];
        for (int j = 0; j < strips; j++) {
            smooth(once, summed + j * room, rows);
            smooth(summed + j * room, once, rows);
            for (int r = 0; r < height; r++) amount[n] += summed[j * room + margin + r];
        }
        for (int k = 0; k < slopes; k++)
            add_strips(
                profiles + k * room, summed, room, strips, height, margin, windows->shifts + k * strips,
                windows->weights + (ptrdiff_t)k * strips * TAPS);
        deviations(energies + n * slopes, means, means + slopes, profiles, room, slopes, height);
    }
    free(corners.of);
    free(memory);
    return 1;
}

/* The sum of `count` numbers; of shares of ink it is exact. */
AVX2 static double sum_exactly(const float *v, ptrdiff_t count) {
    __m256d sums = _mm256_setzero_pd();
    ptrdiff_t i = 0;
    for (; i + 4 <= count; i += 4) sums = _mm256_add_pd(sums, _mm256_cvtps_pd(_mm_loadu_ps(v + i)));
    double of[4], sum = 0;
    _mm256_storeu_pd(of, sums);
    for (; i < count; i++) sum += v[i];
    return sum + of[0] + of[1] + of[2] + of[3];
}

AVX2 static void add_floats(double *restrict sums, const float *restrict v, ptrdiff_t count) {
    for (ptrdiff_t i = 0; i < count; i++) sums[i] += v[i];
}

/* Standard deviation of a profile (count,), which is overwritten, in NumPy's order of sums. */
static float deviation(float *profile, ptrdiff_t count) {
    const float mean = sum_pairs(profile, count) / (float)count;
    for (ptrdiff_t i = 0; i < count; i++) {
        profile[i] -= mean;
        profile[i] *= profile[i];
    }
    return sqrtf(sum_pairs(profile, count) / (float)count);
}

/* A turned image (height, width) of shares of ink, with `stride` numbers from row to row. Windows reach `reach` pixels to
   both sides of their middles across a profile, and `half` along what is summed for it; beyond the image is nothing. */
struct turned {
    const float *pixels;
    ptrdiff_t stride;
    int32_t width, height, reach, half;
};

/* Of windows with the middles `places` (count, 2), deviations of the profiles of rows, `energies` (count, step), and of
   those of columns, `between` numbers further. Returns 0 where memory is missing. */
AVX2 int measure_turned(
    const struct turned *turned, const int32_t *places, ptrdiff_t count, double *energies, ptrdiff_t step,
    ptrdiff_t between) {
    const ptrdiff_t size = 2 * (ptrdiff_t)turned->reach + 1;
    const double share = 1.0 / (2.0 * turned->half + 1);
    double *sums = malloc(size * sizeof *sums);
    float *profile = malloc(size * sizeof *profile);
    const int good = sums && profile;
    for (ptrdiff_t n = 0; good && n < count; n++) {
        const ptrdiff_t x = places[2 * n], y = places[2 * n + 1];
        const ptrdiff_t left = x > turned->half ? x - turned->half : 0, top = y > turned->half ? y - turned->half : 0;
        const ptrdiff_t right = x + turned->half < turned->width ? x + turned->half + 1 : turned->width;
        const ptrdiff_t bottom = y + turned->half < turned->height ? y + turned->half + 1 : turned->height;
        const float *first = turned->pixels + (y - turned->reach) * turned->stride + left;
        for (ptrdiff_t r = 0; r < size; r++)
            profile[r] = (float)(sum_exactly(first + r * turned->stride, right - left) * share);
        energies[n * step] = deviation(profile, size);
        memset(sums, 0, size * sizeof *sums);
        for (ptrdiff_t row = top; row < bottom; row++)
            add_floats(sums, turned->pixels + row * turned->stride + x - turned->reach, size);
        for (ptrdiff_t r = 0; r < size; r++) profile[r] = (float)(sums[r] * share);
        energies[n * step + between] = deviation(profile, size);
    }
    free(sums);
    free(profile);
    return good;
}
