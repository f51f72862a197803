/* Photos on a page: drawn where cells of the page give them weight, and measured in those cells.

   Values of a photo are known at nodes and bilinear between them: where a pixel is seen (x, y), its distances from four
   borders, negative beyond them, and the factors of its tones. A row of pixels is taken in blocks between two columns of
   nodes. */

#include "bicubic.h"

#include <immintrin.h>
#include <stdlib.h>
#include <string.h>

enum {
    BORDERS = 4,
    FACTORS = 5,             /* of tones: three gains, slope, offset */
    PLACE = 2,               /* values of a node before its distances, */
    TONES = PLACE + BORDERS, /* and before its tones */
};

/* `nodes` (rows, columns, values): 6 values, or 11 with tones. `cells` (.., cell_columns) are the weights of the page's
   cells, of `side` pixels, from the one before the view's first on. `total` is the weight of what is drawn already,
   `total_stride` numbers from row to row. */
struct patch {
    const float *nodes, *cells;
    float *total;
    ptrdiff_t total_stride;
    int32_t columns, values, cell_columns, side;
};

/* Of cells of `side` pixels, (rows, columns) with `stride` cells from row to row: mean level, share that the photo
   covers (255: all), mean squared slopes (.., .., 2) across and down. */
struct cells {
    uint8_t *gray, *covered;
    float *energy;
    ptrdiff_t stride;
    int32_t rows, columns, side;
};

/* One row of nodes, or of cells: `count` numbers between two rows. */
AVX2 static void blend_rows(float *restrict here, const float *restrict upper, const float *restrict lower, float part,
                            ptrdiff_t count) {
    for (ptrdiff_t i = 0; i < count; i++) here[i] = upper[i] + part * (lower[i] - upper[i]);
}

/* Pixels of a row from `first` to `end`, not more than NODE_PX, between two nodes; `part` is the first one's place. */
struct block {
    int first, end;
    float part;
    const float *left, *right;
};

/* Block k begins half a step before its pixels' own column of nodes. */
static inline struct block block_at(int k, int width, const float *here, int values) {
    const int begin = k * NODE_PX - NODE_PX / 2, first = between(begin, 0, width);
    const struct block block = {
        first, between(begin + NODE_PX, 0, width), (first - begin + 0.5f) / NODE_PX,
        here + (ptrdiff_t)k * values, here + (ptrdiff_t)(k + 1) * values};
    return block;
}

/* A value (count,) of the block's pixels. */
AVX2 static inline void value_in(float *restrict along, const struct block *block, int value) {
    const float start = block->left[value], rise = block->right[value] - start;
    for (int i = 0; i < NODE_PX; i++) along[i] = start + (block->part + i * (1.0f / NODE_PX)) * rise;
}

/* `kept` (NODE_PX,) is made 0 where a pixel lies beyond a border. */
AVX2 static inline void drop_beyond(float *restrict kept, const struct block *block) {
    for (int k = PLACE; k < PLACE + BORDERS; k++) {
        if (block->left[k] >= 0.0f && block->right[k] >= 0.0f) continue;
        float distance[NODE_PX];
        value_in(distance, block, k);
        for (int i = 0; i < NODE_PX; i++) kept[i] = distance[i] < 0.0f ? 0.0f : kept[i];
    }
}

/* Each pixel times the gains, plus the slope times the strongest channel of that, plus the offset. `pixels` has room for
   two more. */
AVX2 static void apply_tones(uint8_t *pixels, const struct block *block, int first, int end) {
    const __m256 left = _mm256_broadcast_ps((const __m128 *)(block->left + TONES));
    const __m256 right = _mm256_broadcast_ps((const __m128 *)(block->right + TONES));
    const __m256 rise = _mm256_sub_ps(right, left);
    const __m256 start = _mm256_set1_ps(block->left[TONES + 4]);
    const __m256 offset_rise = _mm256_sub_ps(_mm256_set1_ps(block->right[TONES + 4]), start);
    const __m128i order = _mm_setr_epi8(0, 1, 2, 4, 5, 6, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1);
    const float place = block->part + (first - block->first) * (1.0f / NODE_PX), step = 1.0f / NODE_PX;
    __m256 part = _mm256_set_m128(_mm_set1_ps(place + step), _mm_set1_ps(place));
    for (int i = first; i < end; i += 2, part = _mm256_add_ps(part, _mm256_set1_ps(2 * step))) {
        uint8_t *at = pixels + (i - block->first) * CHANNELS;
        uint32_t two[2];
        memcpy(two, at, 4);
        memcpy(two + 1, at + CHANNELS, 4);
        const __m128i bytes = _mm_set_epi32(0, 0, (int)two[1], (int)two[0]);
        const __m256 seen = _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes));
        /* Red, green and blue, and in the fourth place the slope. */
        const __m256 factors = _mm256_add_ps(left, _mm256_mul_ps(part, rise));
        const __m256 balanced = _mm256_mul_ps(seen, factors);
        const __m256 turned = _mm256_shuffle_ps(balanced, balanced, _MM_SHUFFLE(3, 0, 2, 1));
        const __m256 again = _mm256_shuffle_ps(balanced, balanced, _MM_SHUFFLE(3, 1, 0, 2));
        const __m256 strongest = _mm256_max_ps(balanced, _mm256_max_ps(turned, again));
        const __m256 slope = _mm256_shuffle_ps(factors, factors, _MM_SHUFFLE(3, 3, 3, 3));
        const __m256 offset = _mm256_add_ps(start, _mm256_mul_ps(part, offset_rise));
        const __m256 added = _mm256_add_ps(_mm256_mul_ps(strongest, slope), offset);
        const __m256i whole = _mm256_cvtps_epi32(_mm256_add_ps(balanced, added));
        const __m128i words = _mm_packs_epi32(_mm256_castsi256_si128(whole), _mm256_extracti128_si256(whole, 1));
        const __m128i toned = _mm_shuffle_epi8(_mm_packus_epi16(words, words), order);
        const int64_t six = _mm_cvtsi128_si64(toned);
        memcpy(at, &six, 2 * CHANNELS);
    }
}

/* The weighted mean of what is drawn, which weighs `total`, and of `pixels`. */
AVX2 static void mix(uint8_t *drawn, float *total, const uint8_t *pixels, const float *share, int count) {
    int others = 0, all = 1;
    for (int i = 0; i < count; i++) others |= total[i] > 0.0f, all &= share[i] > 0.0f;
    if (all && !others) {
        memcpy(drawn, pixels, (size_t)count * CHANNELS);
        memcpy(total, share, (size_t)count * sizeof *share);
        return;
    }
    for (int i = 0; i < count; i++) {
        if (!(share[i] > 0.0f)) continue;
        const float own = share[i] / (total[i] + share[i]);
        for (int c = 0; c < CHANNELS; c++) {
            const float there = drawn[i * CHANNELS + c], here = pixels[i * CHANNELS + c];
            drawn[i * CHANNELS + c] = (uint8_t)(there + own * (here - there) + 0.5f);
        }
        total[i] += share[i];
    }
}

/* Weights between cells' centres: of each pixel (count,) the cell before it, and the place from there on. */
static void between_cells(int32_t *cell, float *part, int side, int count) {
    for (int i = 0; i < count; i++) {
        const int twice = 2 * i + 1 + side; /* from the centre of the cell before the first, in halves of a pixel */
        cell[i] = twice / (2 * side);
        part[i] = (float)(twice % (2 * side)) / (2 * side);
    }
}

/* `image` is drawn into `view` where `patch` gives it weight: the mean of all that is drawn, by their weights. `weights`
   are those of `draw_line`. Returns 0 where memory is missing. */
AVX2 int blend_patch(
    const struct image *image, const struct view *view, const int16_t *weights, const struct patch *patch) {
    const int longest = view->width > view->height ? view->width : view->height;
    const ptrdiff_t numbers = (ptrdiff_t)patch->columns * patch->values;
    int32_t *cell = malloc(longest * sizeof *cell);
    float *part = malloc(longest * sizeof *part);
    float *here = malloc((numbers + patch->cell_columns) * sizeof *here), *row_cells = here + numbers;
    const int good = cell && part && here;
    if (good) between_cells(cell, part, patch->side, longest);
    for (int row = 0; good && row < view->height; row++) {
        const float *upper = patch->cells + (ptrdiff_t)cell[row] * patch->cell_columns;
        blend_rows(row_cells, upper, upper + patch->cell_columns, part[row], patch->cell_columns);
        const struct between_rows rows = between_rows(row);
        const float *above = patch->nodes + rows.upper * numbers;
        blend_rows(here, above, above + numbers, rows.part, numbers);
        for (int k = 0; k < patch->columns - 1; k++) {
            const struct block block = block_at(k, view->width, here, patch->values);
            const int count = block.end - block.first;
            float share[NODE_PX] = {0};
            for (int i = 0; i < count; i++) {
                const float *near = row_cells + cell[block.first + i];
                share[i] = near[0] + part[block.first + i] * (near[1] - near[0]);
            }
            drop_beyond(share, &block);
            int first = 0, end = count;
            while (first < end && !(share[first] > 0.0f)) first++;
            while (first < end && !(share[end - 1] > 0.0f)) end--;
            if (first == end) continue;
            float x[NODE_PX + 8] = {0}, y[NODE_PX + 8] = {0};
            value_in(x, &block, 0);
            value_in(y, &block, 1);
            struct places places;
            uint8_t pixels[(NODE_PX + 2) * CHANNELS];
            places_at(&places, x + first, y + first, end - first);
            draw_line(image, &places, end - first, weights, -1, pixels + first * CHANNELS);
            if (patch->values > TONES) apply_tones(pixels, &block, block.first + first, block.first + end);
            const ptrdiff_t at = block.first + first;
            mix(view->pixels + row * view->stride + at * CHANNELS, patch->total + row * patch->total_stride + at,
                pixels + first * CHANNELS, share + first, end - first);
        }
    }
    free(cell);
    free(part);
    free(here);
    return good;
}

/* Levels of the block's pixels in the gray `image`, bilinear between its pixels; beyond its border that is repeated. */
AVX2 static void gray_in(uint8_t *restrict drawn, const struct image *image, const struct block *block) {
    float x[NODE_PX], y[NODE_PX], across[NODE_PX], down[NODE_PX];
    int32_t places[NODE_PX];
    uint16_t upper[NODE_PX], lower[NODE_PX]; /* two pixels each */
    uint8_t levels[NODE_PX];
    const __m256 zero = _mm256_setzero_ps();
    const __m256 right = _mm256_set1_ps(image->width - 1), bottom = _mm256_set1_ps(image->height - 1);
    const __m256i last_column = _mm256_set1_epi32(image->width - 2), last_row = _mm256_set1_epi32(image->height - 2);
    const __m256i stride = _mm256_set1_epi32((int)image->stride);
    value_in(x, block, 0);
    value_in(y, block, 1);
    for (int i = 0; i < NODE_PX; i += 8) {
        const __m256 at = _mm256_min_ps(_mm256_max_ps(_mm256_loadu_ps(x + i), zero), right);
        const __m256 below = _mm256_min_ps(_mm256_max_ps(_mm256_loadu_ps(y + i), zero), bottom);
        const __m256i column = _mm256_min_epi32(_mm256_cvttps_epi32(at), last_column);
        const __m256i row = _mm256_min_epi32(_mm256_cvttps_epi32(below), last_row);
        _mm256_storeu_ps(across + i, _mm256_sub_ps(at, _mm256_cvtepi32_ps(column)));
        _mm256_storeu_ps(down + i, _mm256_sub_ps(below, _mm256_cvtepi32_ps(row)));
        const __m256i place = _mm256_add_epi32(_mm256_mullo_epi32(row, stride), column);
        _mm256_storeu_si256((__m256i *)(places + i), place);
    }
    for (int i = 0; i < NODE_PX; i++) {
        const uint8_t *at = image->pixels + places[i];
        memcpy(upper + i, at, sizeof *upper);
        memcpy(lower + i, at + image->stride, sizeof *lower);
    }
    for (int i = 0; i < NODE_PX; i++) {
        const int first = upper[i] & 255, below = lower[i] & 255;
        const float above = first + across[i] * ((upper[i] >> 8) - first);
        const float under = below + across[i] * ((lower[i] >> 8) - below);
        levels[i] = (uint8_t)(int)(above + down[i] * (under - above) + 0.5f);
    }
    memcpy(drawn, levels, block->end - block->first);
}

/* Sums of the columns of a row of cells. Arrays have room for 16 more. */
struct sums {
    uint16_t *gray, *covered;
    int32_t *across, *down;
};

/* sums += values^2, of 16 */
AVX2 static inline void add_squares(int32_t *sums, __m256i values) {
    const __m256i low = _mm256_mullo_epi16(values, values), high = _mm256_mulhi_epi16(values, values);
    const __m256i even = _mm256_unpacklo_epi16(low, high), odd = _mm256_unpackhi_epi16(low, high);
    __m256i *first = (__m256i *)sums, *second = first + 1;
    const __m256i before = _mm256_permute2x128_si256(even, odd, 0x20), after = _mm256_permute2x128_si256(even, odd, 0x31);
    _mm256_storeu_si256(first, _mm256_add_epi32(_mm256_loadu_si256(first), before));
    _mm256_storeu_si256(second, _mm256_add_epi32(_mm256_loadu_si256(second), after));
}

AVX2 static inline __m256i sixteen(const uint8_t *bytes) {
    return _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)bytes));
}

/* The row of pixels `middle` is added, of which the first and the last only show how it rises (Sobel). All have room for
   16 more. */
AVX2 static void add_pixels(
    const struct sums *sums, const uint8_t *upper, const uint8_t *middle, const uint8_t *lower, const uint8_t *inside,
    int width) {
    for (int i = 1; i < width - 1; i += 16) {
        __m256i smooth[3], steep[3];
        for (int k = 0; k < 3; k += 1) {
            const __m256i above = sixteen(upper + i - 1 + k), below = sixteen(lower + i - 1 + k);
            steep[k] = _mm256_sub_epi16(below, above);
            if (k != 1) {
                const __m256i here = sixteen(middle + i - 1 + k);
                smooth[k] = _mm256_add_epi16(_mm256_add_epi16(above, below), _mm256_add_epi16(here, here));
            }
        }
        __m256i *gray = (__m256i *)(sums->gray + i), *covered = (__m256i *)(sums->covered + i);
        _mm256_storeu_si256(gray, _mm256_add_epi16(_mm256_loadu_si256(gray), sixteen(middle + i)));
        _mm256_storeu_si256(covered, _mm256_add_epi16(_mm256_loadu_si256(covered), sixteen(inside + i)));
        add_squares(sums->across + i, _mm256_sub_epi16(smooth[2], smooth[0]));
        const __m256i twice = _mm256_add_epi16(steep[1], steep[1]);
        add_squares(sums->down + i, _mm256_add_epi16(_mm256_add_epi16(steep[0], steep[2]), twice));
    }
}

/* A row of cells from the sums of its columns, which begin anew. */
AVX2 static void end_cells(const struct cells *cells, int row, const struct sums *sums) {
    const int side = cells->side, area = side * side;
    const float share = 1.0f / area;
    for (int k = 0; k < cells->columns; k++) {
        int64_t gray = 0, covered = 0;
        double across = 0.0, down = 0.0;
        for (int i = 1 + k * side; i < 1 + (k + 1) * side; i++) {
            gray += sums->gray[i], covered += sums->covered[i];
            across += sums->across[i], down += sums->down[i];
            sums->gray[i] = sums->covered[i] = 0;
            sums->across[i] = sums->down[i] = 0;
        }
        const ptrdiff_t at = row * cells->stride + k;
        /* OpenCV rounds halves up in means of four, else to even numbers. */
        cells->gray[at] = (uint8_t)(side == 2 ? (gray + 2) / 4 : _mm_cvtss_si32(_mm_set_ss(gray * share)));
        cells->covered[at] = (uint8_t)_mm_cvtss_si32(_mm_set_ss(255 * covered * share));
        cells->energy[2 * at] = (float)(across / 64 / area);
        cells->energy[2 * at + 1] = (float)(down / 64 / area);
    }
}

/* What `patch` shows in `cells`, whose pixels and one more on each side its nodes map. `image` is gray, of two rows and
   columns at least, and cells of at most 255 pixels. Returns 0 where memory is missing. */
AVX2 int measure_cells(const struct image *image, const struct patch *patch, const struct cells *cells) {
    enum { ROOM = 16 };
    const int height = cells->rows * cells->side + 2, width = cells->columns * cells->side + 2;
    const ptrdiff_t numbers = (ptrdiff_t)patch->columns * patch->values, pitch = width + ROOM;
    float *here = malloc(numbers * sizeof *here);
    uint8_t *lines = calloc(5 * pitch, sizeof *lines), *inside = lines + 3 * pitch; /* the last three, the last two */
    uint16_t *levels = calloc(2 * pitch, sizeof *levels);
    int32_t *squares = calloc(2 * pitch, sizeof *squares);
    const struct sums sums = {levels, levels + pitch, squares, squares + pitch};
    const int good = here && lines && levels && squares;
    for (int row = 0; good && row < height; row++) {
        const struct between_rows rows = between_rows(row);
        const float *above = patch->nodes + rows.upper * numbers;
        blend_rows(here, above, above + numbers, rows.part, numbers);
        uint8_t *line = lines + row % 3 * pitch, *kept = inside + row % 2 * pitch;
        for (int k = 0; k < patch->columns - 1; k++) {
            const struct block block = block_at(k, width, here, patch->values);
            float share[NODE_PX];
            for (int i = 0; i < NODE_PX; i++) share[i] = 1.0f;
            drop_beyond(share, &block);
            for (int i = 0; i < block.end - block.first; i++) kept[block.first + i] = share[i] > 0.0f;
            gray_in(line + block.first, image, &block);
        }
        if (row < 2) continue;
        const uint8_t *upper = lines + (row + 1) % 3 * pitch, *middle = lines + (row + 2) % 3 * pitch;
        add_pixels(&sums, upper, middle, line, inside + (row + 1) % 2 * pitch, width);
        if ((row - 1) % cells->side == 0) end_cells(cells, (row - 1) / cells->side - 1, &sums);
    }
    free(here);
    free(lines);
    free(levels);
    free(squares);
    return good;
}
