"""What arrays cannot say fast: loops in C, each with a plain version in the module that calls it.

The set-up compiles them (`python -m services.kernels.build`). Where there is no compiler, no AVX2 or another processor
than x86-64, the plain versions do the same, slower. Pixels may differ by a gray level, sums in their last bits: where a
photo lies between two shapes of its sheet, that can decide.
"""
