/* What the kernels share: images of bytes, channels together, `stride` bytes from row to row. */

#ifndef KERNELS_H
#define KERNELS_H

#include <stddef.h>
#include <stdint.h>

/* The processor is asked once, in `usable`. */
#define AVX2 __attribute__((target("avx2")))
/* The same, with sums of products that are rounded once; only where they are written so. */
#define FUSED __attribute__((target("avx2,fma")))

/* Places farther away than any image ends, and whose steps fit into 32 bits. */
#define FARTHEST_PX 1000000.0f

struct image {
    const uint8_t *pixels;
    int32_t width, height;
    ptrdiff_t stride;
};

struct view {
    uint8_t *pixels;
    int32_t width, height;
    ptrdiff_t stride;
};

#endif
