"""Memory that is free, but not yet given back to the system."""

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar


def _find_trim() -> Callable[[int], int]:
    try:
        trim: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (OSError, AttributeError):  # another C library than glibc
        return lambda pad: 0
    return trim


_trim = _find_trim()


_M_ARENA_MAX, _M_MMAP_THRESHOLD, _M_TRIM_THRESHOLD = -8, -3, -1
"""Numbers of glibc's parameters: the most heaps, the least size of an array with memory of its own, the most that is
free at a heap's end."""
_LARGEST_SHARED = 32 << 20
"""Largest that glibc takes for the second one; its own grows to that with the arrays that are freed."""
_FREE_AT_END = 64 << 20
"""Twice that, as glibc has it by itself."""
_KEPT_AT_END = 1 << 30

_is_kept: ContextVar[bool] = ContextVar("_is_kept", default=False)


def keep_few_heaps(most: int) -> None:
    """Have the threads of this process share `most` heaps; takes effect for threads that start later.

    By itself glibc gives each thread its own, up to eight a processor, and what one has freed is of no use to others.
    """
    with suppress(OSError, AttributeError):  # another C library than glibc
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, most)


@contextmanager
def keeping_freed_memory() -> Iterator[None]:
    """Within the block memory that was freed is kept for later arrays, and given back at its end.

    For work with many arrays of a few sizes: the system clears each page that it gives anew, which took 3 to 10 % of
    the CPU time of mosaics of four and eight photos.
    """
    kept = _is_kept.set(True)
    _set_thresholds(_KEPT_AT_END)
    try:
        yield
    finally:
        _is_kept.reset(kept)
        _set_thresholds(_FREE_AT_END)
        release_freed_memory()


def _set_thresholds(free_at_end: int) -> None:
    with suppress(OSError, AttributeError):  # another C library than glibc
        library = ctypes.CDLL(None)
        library.mallopt(_M_MMAP_THRESHOLD, _LARGEST_SHARED)
        library.mallopt(_M_TRIM_THRESHOLD, free_at_end)


def release_freed_memory() -> None:
    """Give freed memory back to the system, but where it is kept; takes about 2 ms.

    glibc keeps freed arrays below 32 MB for later ones, which rarely fit. Between the steps of a photo of 12 megapixels
    that is 20 to 30 MB.
    """
    if not _is_kept.get():
        _trim(0)
