/* Edges of strokes, and how far their directions are from those of a field. */

#include "kernels.h"

#include <immintrin.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TAPS = 9, HALO = TAPS / 2, LANES = 8 };

/* M_PI is not of the C standard. */
#define PI 3.14159265358979323846

/* Edge pixels in the order of rows: index in the image, and gradient. */
struct edges {
    int32_t *at;
    float *x, *y;
    ptrdiff_t count;
};

/* Every `step`-th strength of pixels of the area; `left` of these come before the next one. */
struct sampled {
    float *strengths;
    ptrdiff_t count, step, left;
};

/* Directions as (cosine, sine) of the doubled angle (rows, columns, 2); nodes are `spacing` apart from (x, y) on. */
struct field {
    const float *doubled;
    int32_t rows, columns;
    double x, y, spacing;
};

/* The pixel that is seen at `at`, of `count` of a line, which is reflected at the middles of its end pixels. */
static int reflected(int at, int count) {
    while (count > 1 && (at < 0 || at >= count)) at = at < 0 ? -at : 2 * count - 2 - at;
    return count > 1 ? at : 0;
}

/* Horizontal filters of a row: smoothed, and its slope, in the chunks that are `needed`. */
AVX2 static void filter_row(
    const uint8_t *row, int width, const uint8_t *needed, const float *smooth, const float *slope, float *padded,
    float *smoothed, float *sloped) {
    for (int i = 0; i < width; i++) padded[HALO + i] = row[i];
    for (int k = 1; k <= HALO; k++) {
        padded[HALO - k] = row[reflected(-k, width)];
        padded[HALO + width - 1 + k] = row[reflected(width - 1 + k, width)];
    }
    for (int first = 0; first < width; first += LANES) {
        if (!needed[first / LANES]) continue;
        const float *at = padded + first;
        __m256 sum = _mm256_mul_ps(_mm256_set1_ps(smooth[HALO]), _mm256_loadu_ps(at + HALO));
        __m256 rise = _mm256_setzero_ps();
        for (int k = HALO + 1; k < TAPS; k++) {
            const __m256 right = _mm256_loadu_ps(at + k), left = _mm256_loadu_ps(at + TAPS - 1 - k);
            sum = _mm256_add_ps(sum, _mm256_mul_ps(_mm256_set1_ps(smooth[k]), _mm256_add_ps(right, left)));
            rise = _mm256_add_ps(rise, _mm256_mul_ps(_mm256_set1_ps(slope[k]), _mm256_sub_ps(right, left)));
        }
        _mm256_storeu_ps(smoothed + first, sum);
        _mm256_storeu_ps(sloped + first, rise);
    }
}

/* The lanes that are set in a mask, moved to the front. */
AVX2 static inline __m256i lanes_first(unsigned mask) {
    /* A byte for each lane, those that are set gathered by their bits. */
    uint64_t lanes = 0x0706050403020100u, bytes = 0, found = 0;
    for (int k = 0; k < LANES; k++)
        if (mask >> k & 1) found |= (lanes >> 8 * k & 0xff) << bytes, bytes += 8;
    return _mm256_cvtepu8_epi32(_mm_cvtsi64_si128((long long)found));
}

/* Adds the edges of the rows from `first` to before `last` of `gray`, within `area` (as large), whose gradient is above
   `least`, and samples of all strengths there. Gradients are those of filters (9,): `smooth`, and the odd `slope`.
   `edges` has room for eight more than there are pixels. Returns 0 where memory is missing. */
AVX2 int find_edges(
    const struct image *gray, const uint8_t *area, int first, int last, const float *smooth, const float *slope,
    float least, struct edges *edges, struct sampled *sampled) {
    const int width = gray->width, chunks = (width + LANES - 1) / LANES, room = chunks * LANES;
    float *padded = malloc((room + TAPS) * sizeof *padded);
    float *filtered = malloc((size_t)2 * TAPS * room * sizeof *filtered);
    uint8_t *needed = calloc(chunks, 1);
    __m256i *order = aligned_alloc(sizeof *order, (1 << LANES) * sizeof *order);
    const int good = padded && filtered && needed && order;
    if (good) {
        for (unsigned mask = 0; mask < 1u << LANES; mask++) order[mask] = lanes_first(mask);
        for (int y = first; y < last; y++)
            for (int x = 0; x < width; x++) needed[x / LANES] |= area[(ptrdiff_t)y * width + x];
        for (int i = 0; i < room + TAPS; i++) padded[i] = 0.0f;
    }
    for (int seen = first - HALO; good && seen < last + HALO; seen++) {
        const int slot = (seen - first + HALO) % TAPS;
        float *own = filtered + (ptrdiff_t)2 * slot * room;
        const uint8_t *row = gray->pixels + reflected(seen, gray->height) * gray->stride;
        filter_row(row, width, needed, smooth, slope, padded, own, own + room);
        const int y = seen - HALO;
        if (y < first) continue;
        const float *rows[TAPS];
        for (int k = 0; k < TAPS; k++) rows[k] = filtered + (ptrdiff_t)2 * ((slot + 1 + k) % TAPS) * room;
        const uint8_t *inside = area + (ptrdiff_t)y * width;
        for (int x = 0; x < width; x += LANES) {
            uint64_t bytes = 0;
            if (x + LANES <= width) memcpy(&bytes, inside + x, sizeof bytes);
            else memcpy(&bytes, inside + x, width - x);
            if (!bytes) continue;
            const __m256i within = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128((long long)bytes));
            const unsigned of_area =
                (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(within, _mm256_setzero_si256())));
            __m256 gx = _mm256_mul_ps(_mm256_set1_ps(smooth[HALO]), _mm256_loadu_ps(rows[HALO] + room + x));
            __m256 gy = _mm256_setzero_ps();
            for (int k = HALO + 1; k < TAPS; k++) {
                const float *below = rows[k] + x, *above = rows[TAPS - 1 - k] + x;
                const __m256 both = _mm256_add_ps(_mm256_loadu_ps(below + room), _mm256_loadu_ps(above + room));
                const __m256 rise = _mm256_sub_ps(_mm256_loadu_ps(below), _mm256_loadu_ps(above));
                gx = _mm256_add_ps(gx, _mm256_mul_ps(_mm256_set1_ps(smooth[k]), both));
                gy = _mm256_add_ps(gy, _mm256_mul_ps(_mm256_set1_ps(slope[k]), rise));
            }
            const __m256 strength = _mm256_sqrt_ps(_mm256_add_ps(_mm256_mul_ps(gx, gx), _mm256_mul_ps(gy, gy)));
            const int pixels = __builtin_popcount(of_area);
            if (sampled->left < pixels) {
                float strengths[LANES];
                _mm256_storeu_ps(
                    strengths, _mm256_permutevar8x32_ps(strength, _mm256_load_si256(order + of_area)));
                for (; sampled->left < pixels; sampled->left += sampled->step)
                    sampled->strengths[sampled->count++] = strengths[sampled->left];
            }
            sampled->left -= pixels;
            const __m256 above = _mm256_cmp_ps(strength, _mm256_set1_ps(least), _CMP_GT_OQ);
            const unsigned found = (unsigned)_mm256_movemask_ps(above) & of_area;
            if (!found) continue;
            const __m256i taken = _mm256_load_si256(order + found);
            const int32_t at = y * width + x;
            const __m256i places = _mm256_add_epi32(_mm256_set1_epi32(at), taken);
            _mm256_storeu_si256((__m256i *)(edges->at + edges->count), places);
            _mm256_storeu_ps(edges->x + edges->count, _mm256_permutevar8x32_ps(gx, taken));
            _mm256_storeu_ps(edges->y + edges->count, _mm256_permutevar8x32_ps(gy, taken));
            edges->count += __builtin_popcount(found);
        }
    }
    free(order);
    free(needed);
    free(filtered);
    free(padded);
    return good;
}

/* Angle of (x, y), to 3e-7 (S. L. Moshier, Cephes, atanf). */
AVX2 static inline __m256 angle_of(__m256 y, __m256 x) {
    const __m256 sign = _mm256_set1_ps(-0.0f), one = _mm256_set1_ps(1.0f);
    const __m256 wide = _mm256_andnot_ps(sign, x), tall = _mm256_andnot_ps(sign, y);
    const __m256 less = _mm256_min_ps(wide, tall), more = _mm256_max_ps(wide, tall);
    /* Of nothing, the angle is 0. */
    __m256 ratio = _mm256_div_ps(less, _mm256_max_ps(more, _mm256_set1_ps(1e-30f)));
    const __m256 far = _mm256_cmp_ps(ratio, _mm256_set1_ps(0.41421356f), _CMP_GT_OQ);
    ratio = _mm256_blendv_ps(ratio, _mm256_div_ps(_mm256_sub_ps(ratio, one), _mm256_add_ps(ratio, one)), far);
    const __m256 square = _mm256_mul_ps(ratio, ratio);
    __m256 sum = _mm256_set1_ps(8.05374449538e-2f);
    sum = _mm256_sub_ps(_mm256_mul_ps(sum, square), _mm256_set1_ps(1.38776856032e-1f));
    sum = _mm256_add_ps(_mm256_mul_ps(sum, square), _mm256_set1_ps(1.99777106478e-1f));
    sum = _mm256_sub_ps(_mm256_mul_ps(sum, square), _mm256_set1_ps(3.33329491539e-1f));
    __m256 angle = _mm256_add_ps(_mm256_mul_ps(_mm256_mul_ps(sum, square), ratio), ratio);
    angle = _mm256_add_ps(angle, _mm256_and_ps(far, _mm256_set1_ps((float)(PI / 4))));
    const __m256 steep = _mm256_cmp_ps(tall, wide, _CMP_GT_OQ);
    angle = _mm256_blendv_ps(angle, _mm256_sub_ps(_mm256_set1_ps((float)(PI / 2)), angle), steep);
    angle = _mm256_blendv_ps(angle, _mm256_sub_ps(_mm256_set1_ps((float)PI), angle), x);
    return _mm256_xor_ps(angle, _mm256_and_ps(sign, y));
}

/* `doubled` (2,) at (x, y), bilinear between nodes, constant beyond them. */
static inline void direction_at(const struct field *field, float x, float y, float *doubled) {
    const float last_x = (float)(field->columns - 1), last_y = (float)(field->rows - 1);
    float u = (float)((x - field->x) / field->spacing), v = (float)((y - field->y) / field->spacing);
    u = u > 0.0f ? u < last_x ? u : last_x : 0.0f;
    v = v > 0.0f ? v < last_y ? v : last_y : 0.0f;
    const int column = (int)u, row = (int)v;
    const float across = u - (float)column, down = v - (float)row;
    const float *upper = field->doubled + 2 * ((ptrdiff_t)row * field->columns + column);
    const float *lower = upper + (row + 1 < field->rows ? 2 * (ptrdiff_t)field->columns : 0);
    const int right = column + 1 < field->columns ? 2 : 0;
    for (int c = 0; c < 2; c++) {
        const float high = upper[c] + across * (upper[right + c] - upper[c]);
        const float low = lower[c] + across * (lower[right + c] - lower[c]);
        doubled[c] = high + down * (low - high);
    }
}

/* Of the edges above `strong`, of an image `width` pixels wide, about `enough` evenly, and of these the ones whose tangents
   differ from the field's directions by an angle of which the doubled has a cosine below `most`: `points` (count, 2),
   `angles` of the tangents and `strengths`, with room for `enough` and eight more. Returns their count. */
AVX2 ptrdiff_t cross_lines(
    const struct edges *edges, int width, float strong, ptrdiff_t enough, const struct field *field, float most,
    float *points, float *angles, float *strengths) {
    ptrdiff_t count = 0, left = 0, passed = 0;
    for (ptrdiff_t i = 0; i < edges->count; i++)
        passed += edges->x[i] * edges->x[i] + edges->y[i] * edges->y[i] > strong * strong;
    const ptrdiff_t step = passed / enough + 1;
    for (ptrdiff_t i = 0; i < edges->count; i++) {
        const float gx = edges->x[i], gy = edges->y[i], square = gx * gx + gy * gy;
        if (!(square > strong * strong)) continue;
        if (left--) continue;
        left = step - 1;
        const int y = edges->at[i] / width, x = edges->at[i] - y * width;
        float doubled[2];
        direction_at(field, (float)x, (float)y, doubled);
        /* The tangent (-gy, gx), doubled, times the field's direction. */
        const float cosine = (gy * gy - gx * gx) * doubled[0] - 2 * gx * gy * doubled[1];
        const float length = sqrtf(doubled[0] * doubled[0] + doubled[1] * doubled[1]);
        if (!(cosine < most * square * length)) continue;
        points[2 * count] = (float)x;
        points[2 * count + 1] = (float)y;
        /* The gradient, until all are known. */
        angles[count] = gx;
        strengths[count] = gy;
        count++;
    }
    for (ptrdiff_t i = 0; i < count; i += LANES) {
        const __m256 gx = _mm256_loadu_ps(angles + i), gy = _mm256_loadu_ps(strengths + i);
        _mm256_storeu_ps(angles + i, angle_of(gx, _mm256_xor_ps(gy, _mm256_set1_ps(-0.0f))));
        _mm256_storeu_ps(
            strengths + i, _mm256_sqrt_ps(_mm256_add_ps(_mm256_mul_ps(gx, gx), _mm256_mul_ps(gy, gy))));
    }
    return count;
}

/* The blocks of edges, in rows of `columns`, each `side` pixels wide and high; to the `sums` (blocks, 4) of each are added
   its number of edges, their strengths, and the strengths times x and y. */
AVX2 void gather_blocks(
    const float *points, const float *strengths, ptrdiff_t count, double side, int columns, int32_t *blocks,
    double *sums) {
    for (ptrdiff_t i = 0; i < count; i++) {
        const double x = points[2 * i], y = points[2 * i + 1], strength = strengths[i];
        blocks[i] = (int32_t)(y / side) * columns + (int32_t)(x / side);
        double *own = sums + (ptrdiff_t)4 * blocks[i];
        own[0] += 1;
        own[1] += strength;
        own[2] += strength * x;
        own[3] += strength * y;
    }
}
