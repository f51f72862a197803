#include "kernels.h"

/* Whether this processor has the instructions that the kernels use. */
int usable(void) { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
