/* Votes of cells of the page on the photos that their words are taken from. */

#include "kernels.h"

/* A box of the page's cells: the words (0: none) of which they are parts, and the photo that each chose (-1: none).
   Strides are those of their numbers. */
struct word_box {
    const int32_t *words;
    const int16_t *choices;
    ptrdiff_t words_stride, choices_stride, rows, columns;
};

/* `votes` (words, photos) of the cells. */
void count_votes(const struct word_box *box, ptrdiff_t photos, int64_t *votes) {
    for (ptrdiff_t y = 0; y < box->rows; y++) {
        const int32_t *words = box->words + y * box->words_stride;
        const int16_t *choices = box->choices + y * box->choices_stride;
        for (ptrdiff_t x = 0; x < box->columns; x++)
            if (words[x] > 0 && choices[x] >= 0) votes[words[x] * photos + choices[x]]++;
    }
}

/* How many cells of each word a photo shows whole, whose `covered` is 255; `shown` is every `photos`th number. */
void count_shown(const struct word_box *box, const uint8_t *covered, ptrdiff_t photos, int64_t *shown) {
    for (ptrdiff_t y = 0; y < box->rows; y++) {
        const int32_t *words = box->words + y * box->words_stride;
        const uint8_t *row = covered + y * box->columns;
        for (ptrdiff_t x = 0; x < box->columns; x++)
            if (words[x] > 0 && row[x] == 255) shown[words[x] * photos]++;
    }
}

/* Cells of words with a photo (-1: none) get it as their label, are `whole`, and `todo` no more; all are packed. */
void take_words(
    const int32_t *words, ptrdiff_t count, const int16_t *photos, int16_t *labels, uint8_t *whole, uint8_t *todo) {
    for (ptrdiff_t i = 0; i < count; i++) {
        const int16_t photo = photos[words[i]];
        if (photo < 0) continue;
        labels[i] = photo;
        whole[i] = 1;
        todo[i] = 0;
    }
}
