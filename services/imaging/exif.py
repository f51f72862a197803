"""Camera data from EXIF: orientation, focal length, resolution. Invalid data is ignored, never an error."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from PIL import ExifTags, Image

_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
"""43.2666 mm: the diagonal of the 35 mm film frame that FocalLengthIn35mmFilm refers to."""
_PLANE_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
"""FocalPlaneResolutionUnit: inch, cm, mm, um."""
_SHORTEST_DIAGONALS, _LONGEST_DIAGONALS = 0.2, 20.0
"""Range of accepted focal lengths in image diagonals: fields of view of 136 to 2.9 degrees."""
_SAME = 0.01
"""Relative difference up to which two aspect ratios are those of one image, reduced or not, and two resolutions one."""
_LOWEST_DPI, _HIGHEST_DPI = 100.0, 2400.0
"""Range of accepted resolutions. Cameras and editors write placeholders below it (1, 72, 96)."""
_MOST_PIXEL_ASPECT = 4.0
"""Of a pixel's longer over its shorter side; those of faxes are up to 2.1 (204 x 98 dpi)."""


class DiagonalFocalLength(float):
    """Focal length in pixels, known only as a multiple of the image's present diagonal.

    If the image was cropped, the true focal length is larger by the ratio of the original to the present diagonal.
    """


@dataclass(frozen=True, slots=True)
class CameraFacts:
    """Data about the camera from an image's metadata.

    `orientation` is EXIF's 1-8. `focal_length_px` is in pixels of the image, None if unknown, and a
    `DiagonalFocalLength` if cropping would change it. `dpi` is pixels per inch of paper, along the axis with more of
    them, None if unknown (always so for a camera's photo). `pixel_aspect` is the width of a pixel over its height, as
    the file has them, before it is turned by `orientation`.
    """

    orientation: int
    focal_length_px: float | None
    dpi: float | None
    camera: str | None = None
    """Make, model and size of the photos, as a name of the camera; None if EXIF does not say."""
    pixel_aspect: float = 1.0


def read_camera_facts(picture: Image.Image) -> CameraFacts:
    """Camera data of an opened, not yet decoded image; unreadable values are unknown."""
    try:
        exif = picture.getexif()
        orientation = exif.get(ExifTags.Base.Orientation, 1)
        camera = exif.get_ifd(ExifTags.IFD.Exif)
        make, model = str(exif.get(ExifTags.Base.Make, "")), str(exif.get(ExifTags.Base.Model, ""))
    except Exception:  # Pillow raises various exceptions on a damaged block, which is not needed
        orientation, camera, make, model = 1, {}, "", ""
    is_photo = any(tag in camera for tag in (ExifTags.Base.FocalLength, ExifTags.Base.ExposureTime))
    dpi, pixel_aspect = (None, 1.0) if is_photo else _believable_dpi(picture.info.get("dpi"))
    return CameraFacts(
        orientation if isinstance(orientation, int) and orientation in range(1, 9) else 1,
        focal_length_px(camera, *picture.size),
        dpi,
        _camera_name(make, model, picture.size),
        pixel_aspect,
    )


def _camera_name(make: str, model: str, size: tuple[int, int]) -> str | None:
    """Name of a camera and its mode: make and model without what a name may not contain, and the photo's size."""
    words = re.sub(r"[^A-Za-z0-9 ._-]", " ", f"{make} {model}").split()
    if not model.strip() or not words or not words[0][0].isalnum():
        return None
    return f"{' '.join(words)[:80]} {max(size)}x{min(size)}"


def focal_length_px(camera: Mapping[int, Any], width: int, height: int) -> float | None:
    """Focal length in pixels of a (height, width) picture, from the tags of its Exif directory.

    FocalLengthIn35mmFilm f35 is used first: f = f35 / 43.2666 mm times the image's diagonal. Else it is FocalLength
    times FocalPlaneXResolution (pixels per unit in the original image, whose size is in PixelXDimension and
    PixelYDimension). If that size has another aspect ratio, the image was cropped from it. None if both are missing, or
    if the field of view is implausible.
    """
    diagonal = math.hypot(width, height)
    found = _positive(camera.get(ExifTags.Base.FocalLengthIn35mmFilm))
    full_diagonal = _diagonal_before_cropping(camera, width, height)
    if found is not None:
        focal = found / _FILM_DIAGONAL_MM * (full_diagonal or diagonal)
        focal = focal if full_diagonal else DiagonalFocalLength(focal)
    else:
        focal_mm = _positive(camera.get(ExifTags.Base.FocalLength))
        resolution = _positive(camera.get(ExifTags.Base.FocalPlaneXResolution))
        unit_mm = _PLANE_UNIT_MM.get(camera.get(ExifTags.Base.FocalPlaneResolutionUnit, 2))
        if focal_mm is None or resolution is None or unit_mm is None:
            return None
        sizes = [camera.get(tag) for tag in (ExifTags.Base.ExifImageWidth, ExifTags.Base.ExifImageHeight)]
        # Long sides are compared, because an editor may rotate an image without changing the stored sizes.
        full_long_side = max(_positive(size) or 0.0 for size in sizes) or max(width, height)
        reduction = 1.0 if full_diagonal else max(width, height) / full_long_side
        focal = focal_mm * resolution / unit_mm * reduction
    return focal if _SHORTEST_DIAGONALS <= focal / diagonal <= _LONGEST_DIAGONALS else None


def _diagonal_before_cropping(camera: Mapping[int, Any], width: int, height: int) -> float | None:
    """Diagonal of the original image in pixels, if its stored size shows that the image was cropped; else None."""
    sizes = [
        _positive(camera.get(tag)) for tag in (ExifTags.Base.ExifImageWidth, ExifTags.Base.ExifImageHeight)
    ]
    if sizes[0] is None or sizes[1] is None:
        return None
    # Long sides are compared, because an editor may rotate an image without changing the stored sizes.
    long, short = max(sizes[0], sizes[1]), min(sizes[0], sizes[1])
    now_long, now_short = max(width, height), min(width, height)
    same_aspect = abs(long / short * now_short / now_long - 1) < _SAME
    # After a crop with enlargement or reduction the original size is unknown.
    is_crop = (now_long, now_short) != (long, short) and now_long <= long and now_short <= short
    return math.hypot(long, short) if is_crop and not same_aspect else None


def _positive(value: Any) -> float | None:
    """`value` as a positive finite number, else None (EXIF rationals may be 0/0)."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def _believable_dpi(value: Any) -> tuple[float | None, float]:
    """The higher resolution of a (horizontal, vertical) pair, if it is plausible for a scanner; the pixels' aspect."""
    unknown = None, 1.0
    if not isinstance(value, tuple) or len(value) != 2:
        return unknown
    horizontal, vertical = _positive(value[0]), _positive(value[1])
    if horizontal is None or vertical is None:
        return unknown
    aspect = vertical / horizontal
    higher = max(horizontal, vertical)
    if not _LOWEST_DPI <= round(higher) <= _HIGHEST_DPI or max(aspect, 1 / aspect) > _MOST_PIXEL_ASPECT:
        return unknown
    return (horizontal, 1.0) if abs(1 / aspect - 1) <= _SAME else (higher, aspect)
