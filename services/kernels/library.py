"""The compiled kernels, if this machine has them."""

import ctypes
import functools
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the set-up compiles before there is an environment
    from numpy.typing import NDArray

FOLDER = Path(__file__).parent
PATTERN = "compiled-*.so"


class Image(ctypes.Structure):
    """`struct image` and `struct view` of `kernels.h`."""

    _fields_ = (
        ("pixels", ctypes.c_void_p),
        ("width", ctypes.c_int32),
        ("height", ctypes.c_int32),
        ("stride", ctypes.c_ssize_t),
    )


_ADDRESS, _SIZE, _INT = ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_int
_IMAGE = ctypes.POINTER(Image)
_ARGUMENTS: dict[str, tuple[Any, ...]] = {
    "draw_bicubic": (_IMAGE, _ADDRESS, _ADDRESS, _SIZE, _SIZE, _ADDRESS, _ADDRESS, _INT, _IMAGE),
    "accumulate_scores": (_ADDRESS, _ADDRESS, _SIZE, _SIZE, _SIZE, _INT, _ADDRESS),
    "trace_back": (_ADDRESS, _SIZE, _SIZE, _INT, _ADDRESS, _ADDRESS, _ADDRESS, _SIZE, _ADDRESS),
    "usable": (),
}


def library_path() -> Path:
    """Where the library of these sources is, or will be: one of other sources is not taken for it."""
    digest = hashlib.sha256()
    for source in sorted([*FOLDER.glob("*.c"), *FOLDER.glob("*.h")]):
        digest.update(source.read_bytes())
    return FOLDER / PATTERN.replace("*", digest.hexdigest()[:16])


@functools.cache
def find_kernels() -> ctypes.CDLL | None:
    """The kernels; None where they are not compiled, or this processor lacks what they use."""
    try:
        library = ctypes.CDLL(str(library_path()))
    except OSError:
        return None
    for name, arguments in _ARGUMENTS.items():
        getattr(library, name).argtypes = arguments
    return library if library.usable() else None


def address(array: "NDArray[Any]") -> int:
    """Of the first number of `array`, which must outlive the call that it is passed to."""
    return int(array.ctypes.data)


def image_of(pixels: "NDArray[Any]") -> Image:
    """`pixels` (H, W, 3) of bytes; the pixels of a row are together in memory, rows may be apart."""
    height, width, channels = pixels.shape
    if pixels.dtype != "uint8" or pixels.strides[1:] != (channels, 1) or channels != 3:
        raise ValueError("kernels take images of three bytes a pixel, rows of pixels together")
    return Image(address(pixels), width, height, pixels.strides[0])
