/* Bytes of masks, 64 at once. */

#ifndef BYTES_H
#define BYTES_H

#include "kernels.h"

#include <immintrin.h>

enum { WORD = 64 };

/* Which of 64 bytes are not zero. */
AVX2 static inline uint64_t set_bytes(const uint8_t *bytes) {
    const __m256i zero = _mm256_setzero_si256();
    const __m256i low = _mm256_loadu_si256((const __m256i *)bytes);
    const __m256i high = _mm256_loadu_si256((const __m256i *)(bytes + 32));
    const uint64_t first = (uint32_t)_mm256_movemask_epi8(_mm256_cmpeq_epi8(low, zero));
    const uint64_t second = (uint32_t)_mm256_movemask_epi8(_mm256_cmpeq_epi8(high, zero));
    return ~(first | second << 32);
}

#endif
