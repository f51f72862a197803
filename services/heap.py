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


_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
"""Numbers of glibc's parameters: free bytes at a heap's end, bytes of a block, and heaps."""
_USUAL = (16 << 20, 32 << 20)
"""Bytes of the largest block that is taken from a heap, and of what stays free at its end. A view of 12 megapixels has
22 MB: in a heap, with what lies behind it, it made peaks of 309 to 331 MB of 290."""
_KEPT = (32 << 20, 1 << 30)
"""The same for many large arrays. glibc takes no larger block from a heap."""
LARGE_BYTES = 18 << 20
"""Of an image: a colour photo of 6 megapixels. Smaller ones never take the memory that those of 12 take."""

_is_kept: ContextVar[bool] = ContextVar("_is_kept", default=False)


def keep_few_heaps(most: int) -> None:
    """Have the threads of this process share `most` heaps; takes effect for threads that start later.

    By itself glibc gives each thread its own, up to eight a processor, and what one has freed is of no use to others.
    """
    with suppress(OSError, AttributeError):  # another C library than glibc
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, most)


def keep_freed_memory() -> None:
    """Have this process keep up to 32 MB of what it has freed at the heap's end, and no block above 16 MB.

    glibc comes to twice these bounds by itself, as larger and larger blocks are freed. Before, it gives memory back at
    once.
    """
    _set_bounds(*_USUAL)


@contextmanager
def keeping_freed_memory() -> Iterator[None]:
    """Within the block memory that was freed is kept for later arrays, and given back at its end.

    For work with many arrays of a few sizes: the system clears each page that it gives anew, which took 3 to 10 % of
    the CPU time of mosaics of four and eight photos.
    """
    kept = _is_kept.set(True)
    _set_bounds(*_KEPT)
    try:
        yield
    finally:
        _is_kept.reset(kept)
        if not _is_kept.get():
            _set_bounds(*_USUAL)
        release_freed_memory()


def _set_bounds(largest: int, free_at_end: int) -> None:
    with suppress(OSError, AttributeError):  # another C library than glibc
        set_parameter = ctypes.CDLL(None).mallopt
        set_parameter(_M_MMAP_THRESHOLD, largest)
        set_parameter(_M_TRIM_THRESHOLD, free_at_end)


def release_freed_memory() -> None:
    """Give freed memory back to the system, but where it is kept.

    That takes about 2 ms, and the system's time to clear it when it is taken again. glibc keeps freed arrays below
    32 MB for later ones, which rarely fit. Between the steps of a photo of 12 megapixels that is 20 to 30 MB.
    """
    if not _is_kept.get():
        _trim(0)


def release_if_large(size_bytes: int) -> None:
    """`release_freed_memory` after a step with a large image or upload; what a small one leaves is for later steps."""
    if size_bytes >= LARGE_BYTES:
        release_freed_memory()
