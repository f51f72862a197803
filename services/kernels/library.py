"""The compiled kernels, if this machine has them."""

import ctypes
import functools
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the set-up compiles before there is an environment
    from numpy.typing import NDArray

FOLDER = Path(__file__).parent
PATTERN = "compiled-*.library"
"""Not `.so`: Python would take it for a module."""


_HEAD_BYTES = object.__basicsize__
"""Of an object. In NumPy's `PyArrayObject` the pointer to the numbers follows."""


class Image(ctypes.Structure):
    """`struct image` and `struct view` of `kernels.h`."""

    _fields_ = (
        ("pixels", ctypes.c_void_p),
        ("width", ctypes.c_int32),
        ("height", ctypes.c_int32),
        ("stride", ctypes.c_ssize_t),
    )


class Map(ctypes.Structure):
    """`struct map` of `bicubic.c`."""

    _fields_ = (
        ("x", ctypes.c_void_p),
        ("y", ctypes.c_void_p),
        ("stride", ctypes.c_ssize_t),
        ("step", ctypes.c_ssize_t),
        ("H", ctypes.c_void_p),
    )


class KernelPatch(ctypes.Structure):
    """`struct patch` of `patches.c`."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("nodes", "cells", "total")),
        ("total_stride", ctypes.c_ssize_t),
        *((name, ctypes.c_int32) for name in ("columns", "values", "cell_columns", "side")),
    )


class RidgeLinks(ctypes.Structure):
    """`struct ridges` of `ridges.c`."""

    _fields_ = (
        ("window", ctypes.c_void_p),
        ("y", ctypes.c_void_p),
        ("count", ctypes.c_ssize_t),
        ("gap", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("bend", "drift", "wait")),
    )


class CellMaps(ctypes.Structure):
    """`struct cells` of `patches.c`."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("gray", "covered", "energy")),
        ("stride", ctypes.c_ssize_t),
        *((name, ctypes.c_int32) for name in ("rows", "columns", "side")),
    )


class CellLevels(ctypes.Structure):
    """`struct cell_levels` of `sharpness.c`."""

    _fields_ = (
        ("count", ctypes.c_ssize_t),
        *((name, ctypes.c_void_p) for name in ("gray", "shown", "light", "weight", "energy")),
    )


class RelatedMaps(ctypes.Structure):
    """`struct related` of `sharpness.c`."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in ("darkness", "slope", "energy", "bare"))


class PrintShares(ctypes.Structure):
    """`struct print_shares` of `levels.c`."""

    _fields_ = (
        ("scale", ctypes.c_float),
        *((name, ctypes.c_int32) for name in ("ink_end", "paper_first", "paper_last", "chroma_end")),
    )


class TileCounts(ctypes.Structure):
    """`struct tile_counts` of `levels.c`."""

    _fields_ = (
        ("counts", ctypes.c_void_p),
        *((name, ctypes.c_int32) for name in ("rows", "columns", "bins")),
    )


class CanvasBox(ctypes.Structure):
    """`struct canvas_box` of `canvas.c`."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("page", "weight", "bright")),
        *((name, ctypes.c_ssize_t) for name in ("page_stride", "weight_stride", "bright_stride")),
        *((name, ctypes.c_int32) for name in ("width", "height")),
    )


class LitView(ctypes.Structure):
    """`struct lit_view` of `canvas.c`."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in ("image", "gain", "feather", "shown"))


class WordBox(ctypes.Structure):
    """`struct word_box` of `words.c`."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("words", "choices")),
        *((name, ctypes.c_ssize_t) for name in ("words_stride", "choices_stride", "rows", "columns")),
    )


class SheetTables(ctypes.Structure):
    """`struct sheet` of `surface.h`."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("nodes", "P", "A", "R")),
        *((name, ctypes.c_int32) for name in ("count", "first", "last")),
        ("step", ctypes.c_double),
        ("focal", ctypes.c_double),
        ("slopes", ctypes.c_double * 2),
        ("cosine", ctypes.c_double),
        ("sine", ctypes.c_double),
        ("anchor", ctypes.c_double * 2),
    )


class SheetPoints(ctypes.Structure):
    """`struct points` of `surface.h`."""

    _fields_ = (
        ("count", ctypes.c_ssize_t),
        *((name, ctypes.c_void_p) for name in ("photo", "sheet", "page", "jacobians", "X", "A", "R")),
    )


class Rows(ctypes.Structure):
    """`struct rows` of `products.c`."""

    _fields_ = (
        ("count", ctypes.c_ssize_t),
        ("width", ctypes.c_ssize_t),
        ("columns", ctypes.c_void_p),
        ("entries", ctypes.c_void_p),
    )


class Equations(ctypes.Structure):
    """`struct equations` of `products.c`."""

    _fields_ = (
        *((name, ctypes.c_ssize_t) for name in ("banded", "border", "below")),
        *((name, ctypes.c_void_p) for name in ("band", "side", "corner", "gradient")),
    )


class MeshNodes(ctypes.Structure):
    """`struct mesh` of `mesh.c`."""

    _fields_ = (
        ("nodes", ctypes.c_void_p),
        ("rows", ctypes.c_ssize_t),
        ("columns", ctypes.c_ssize_t),
        ("focal", ctypes.c_double),
    )


class Search(ctypes.Structure):
    """`struct search` of `mesh.c`."""

    _fields_ = (
        ("steps", ctypes.c_int32),
        *((name, ctypes.c_double) for name in ("longest", "found", "most", "reach", "located")),
    )


class TextWindows(ctypes.Structure):
    """`struct windows` of `slopes.c`."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("centres", "along", "across", "shifts", "weights")),
        *((name, ctypes.c_int32) for name in ("count", "rows", "columns", "margin", "strips", "slopes")),
    )


class TurnedImage(ctypes.Structure):
    """`struct turned` of `slopes.c`."""

    _fields_ = (
        ("pixels", ctypes.c_void_p),
        ("stride", ctypes.c_ssize_t),
        *((name, ctypes.c_int32) for name in ("width", "height", "reach", "half")),
    )


class Placing(ctypes.Structure):
    """`struct placing` of `light.c`."""

    _fields_ = tuple((name, ctypes.c_float) for name in ("x_factor", "x_shift", "y_factor", "y_shift"))


class Threshold(ctypes.Structure):
    """`struct threshold` of `masks.c`."""

    _fields_ = (("k", ctypes.c_float), ("contrast", ctypes.c_float), ("half", ctypes.c_int32))


_ADDRESS, _SIZE, _INT = ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_int
_IMAGE, _SHEET, _POINTS = map(ctypes.POINTER, (Image, SheetTables, SheetPoints))
_ROWS, _EQUATIONS, _MESH, _SEARCH = map(ctypes.POINTER, (Rows, Equations, MeshNodes, Search))
_DOUBLE, _FLOAT = ctypes.c_double, ctypes.c_float
_DRAW = (_IMAGE, _IMAGE, _ADDRESS, _INT, ctypes.POINTER(Map))
_ARGUMENTS: dict[str, tuple[Any, ...]] = {
    "blend_patch": (_IMAGE, _IMAGE, _ADDRESS, ctypes.POINTER(KernelPatch)),
    "draw_by_map": _DRAW,
    "draw_between_nodes": _DRAW,
    "draw_by_homography": _DRAW,
    "add_lit": (ctypes.POINTER(CanvasBox), ctypes.POINTER(LitView)),
    "add_products": (_ROWS, _ADDRESS, _ADDRESS, _EQUATIONS),
    "derive_points": (_MESH, _ADDRESS, _ADDRESS, _ADDRESS, _SIZE, _SIZE, _ADDRESS, _ADDRESS),
    "accumulate_scores": (_ADDRESS, _ADDRESS, _SIZE, _SIZE, _SIZE, _INT, _ADDRESS),
    "color_codes": (_ADDRESS, _SIZE, _ADDRESS),
    "compare_cells": (ctypes.POINTER(CanvasBox), ctypes.POINTER(LitView), _ADDRESS, _ADDRESS),
    "count_colors": (_ADDRESS, _ADDRESS, _SIZE, _ADDRESS),
    "count_ink": (_IMAGE, _ADDRESS, _ADDRESS, ctypes.POINTER(PrintShares), ctypes.POINTER(TileCounts)),
    "count_shown": (ctypes.POINTER(WordBox), _ADDRESS, _SIZE, _ADDRESS),
    "count_votes": (ctypes.POINTER(WordBox), _SIZE, _ADDRESS),
    "end_mean": (_ADDRESS, _ADDRESS, _SIZE, _FLOAT, _ADDRESS),
    "flatten_part": (_IMAGE, _IMAGE, ctypes.POINTER(Placing), _IMAGE),
    "keep_labels": (_IMAGE, _ADDRESS, _ADDRESS, ctypes.c_int32, _ADDRESS),
    "label_mask": (_IMAGE, _ADDRESS),
    "link_ridges": (ctypes.POINTER(RidgeLinks), _ADDRESS, _ADDRESS, _ADDRESS),
    "locate_points": (_MESH, _SEARCH, _ADDRESS, _SIZE, _ADDRESS),
    "mark_print": (_ADDRESS, _ADDRESS, _SIZE, ctypes.POINTER(PrintShares), _ADDRESS, _ADDRESS),
    "masked_medians": (_ADDRESS, _ADDRESS, _SIZE, _ADDRESS),
    "masked_sums": (_ADDRESS, _ADDRESS, _SIZE, _ADDRESS),
    "measure_cells": (_IMAGE, ctypes.POINTER(KernelPatch), ctypes.POINTER(CellMaps)),
    "measure_band": (_ROWS, _ADDRESS, _SIZE, _SIZE),
    "piece_costs": (*(_ADDRESS,) * 2, _SIZE, *(_ADDRESS,) * 2, _SIZE, _ADDRESS, _SIZE, _DOUBLE, _ADDRESS),
    "measure_labels": (_IMAGE, _ADDRESS, ctypes.c_int32, _ADDRESS, _ADDRESS),
    "measure_turned": (ctypes.POINTER(TurnedImage), _ADDRESS, _SIZE, _ADDRESS, _SIZE, _SIZE),
    "measure_windows": (_IMAGE, ctypes.POINTER(TextWindows), *(_ADDRESS,) * 4),
    "outstanding_bin": (_ADDRESS, _ADDRESS, _SIZE, _SIZE, _ADDRESS),
    "polygon_distances": (_ADDRESS, _SIZE, _ADDRESS, _SIZE, _ADDRESS),
    "raise_strength": (_ADDRESS, _ADDRESS, _SIZE, _FLOAT, _FLOAT, _ADDRESS),
    "reduce_area": (_IMAGE, _IMAGE, _INT),
    "relate_cells": (ctypes.POINTER(CellLevels), _FLOAT, _FLOAT, _FLOAT, ctypes.POINTER(RelatedMaps)),
    "remove_noise": (_ADDRESS, _SIZE, _ADDRESS),
    "roll_frames": (_ADDRESS, _SIZE, _ADDRESS),
    "measure_steps": (_ADDRESS, *(_SIZE,) * 6, _ADDRESS, _ADDRESS),
    "sample_profiles": (_IMAGE, _ADDRESS, _ADDRESS, _SIZE, _ADDRESS, _SIZE, _ADDRESS, _SIZE, _ADDRESS),
    "score_rays": (_ADDRESS, _ADDRESS, _SIZE, _ADDRESS, _ADDRESS, _SIZE, _SIZE, *(_DOUBLE,) * 2, _ADDRESS),
    "see_points": (_SHEET, _ADDRESS, _SIZE, _DOUBLE, _ADDRESS),
    "smooth_colors": (_ADDRESS, _ADDRESS),
    "spread_mask": (_IMAGE, _IMAGE, _INT, _INT),
    "sum_distances": (_IMAGE, _ADDRESS, _ADDRESS, ctypes.c_int32),
    "take_words": (_ADDRESS, _SIZE, *(_ADDRESS,) * 4),
    "threshold_windows": (_IMAGE, _IMAGE, _IMAGE, ctypes.POINTER(Threshold)),
    "trace_back": (_ADDRESS, _SIZE, _SIZE, _INT, _ADDRESS, _ADDRESS, _ADDRESS, _SIZE, _ADDRESS),
    "unroll_points": (_SHEET, _POINTS),
    "usable": (),
    "vary_points": (_SHEET, _POINTS, _ADDRESS, _ADDRESS, _ADDRESS, _INT, _INT, _ADDRESS, _SIZE),
}


def library_path() -> Path:
    """Where the library of these sources and flags is, or will be: one of others is not taken for it."""
    digest = hashlib.sha256()
    for source in sorted([*FOLDER.glob("*.c"), *FOLDER.glob("*.h"), FOLDER / "build.py"]):
        digest.update(source.read_bytes())
    return FOLDER / PATTERN.replace("*", digest.hexdigest()[:16])


@functools.cache
def find_kernels() -> ctypes.CDLL | None:
    """The kernels; None where they are not compiled, or this processor or Python lacks what they use."""
    from numpy import zeros  # the set-up compiles before it is there

    try:
        library = ctypes.CDLL(str(library_path()))
    except OSError:
        return None
    for name, arguments in _ARGUMENTS.items():
        getattr(library, name).argtypes = arguments
    for name in ("link_ridges", "masked_sums", "measure_band"):
        getattr(library, name).restype = _SIZE
    known = zeros(1)
    return library if library.usable() and address(known) == known.ctypes.data else None


def address(array: "NDArray[Any]") -> int:
    """Of the first number of `array`, which must outlive the call that it is passed to.

    `array.ctypes.data` takes seven times as long, and a bent page asks 3,500 times.
    """
    return ctypes.c_void_p.from_address(id(array) + _HEAD_BYTES).value or 0


def is_packed(pixels: "NDArray[Any]") -> bool:
    """Whether the bytes of a row of the image (H, W) or (H, W, C) are together in memory; rows may be apart."""
    together = (pixels.shape[2], 1) if pixels.ndim == 3 else (1,)
    # The step along an axis of one may be any.
    axes = zip(pixels.shape[1:], pixels.strides[1:], together, strict=True)
    return pixels.dtype == "uint8" and all(size == 1 or step == wanted for size, step, wanted in axes)


def image_of(pixels: "NDArray[Any]") -> Image:
    """The packed image `pixels` as kernels take it."""
    if not is_packed(pixels):
        raise ValueError("kernels take images of bytes whose rows are together in memory")
    return Image(address(pixels), pixels.shape[1], pixels.shape[0], pixels.strides[0])
