"""The entry points that a worker runs: decode -> pipeline -> encode, bytes in, bytes and JSON out.

Radians become degrees here, and nothing leaves that JSON cannot hold.
"""

import base64
import functools
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from services.arrays import RgbImage, Vector
from services.errors import DocumentError
from services.imaging.codec import DecodedImage, ImageLimits, OutputFormat, decode_image, encode_image
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine
from services.rectify.parameters import RectifyParameters
from services.rectify.pipeline import rectify
from services.rectify.results import PlaneSurface, RectifyResult, StripsSurface

MEDIA_TYPES = {
    "jpeg": "image/jpeg",
    "png": "image/png",
    "webp": "image/webp",
    "tiff": "image/tiff",
    "pdf": "application/pdf",
    "json": "application/json",
}


@dataclass(frozen=True, slots=True)
class EncodingOptions:
    """How the answer is wanted.

    `format` None means the upload's own (JPEG for HEIC); `quality` 1-100 is for lossy formats; `embed`
    puts the image into the JSON, in base64.
    """

    format: Literal["jpeg", "png", "webp", "tiff", "pdf", "json"] | None = None
    quality: int | None = None
    embed: bool = False


@dataclass(frozen=True, slots=True)
class RectifyReply:
    """What leaves the worker.

    `body` is the image file (empty when JSON was asked for), of type `media_type`; `document` is the
    contract's `RectifyResult`.
    """

    body: bytes
    media_type: str
    document: dict[str, object]


def rectify_upload(
    upload: bytes, parameters: RectifyParameters, encoding: EncodingOptions, limits: ImageLimits
) -> RectifyReply:
    """Frontal flat view of the page in an uploaded photo.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When the upload is no picture that is accepted.
    NoText
        When the photo shows too little printed text to see the page's shape.
    InvalidOption
        When `parameters` or `encoding` cannot be met.
    """
    timings_ms: dict[str, float] = {}
    with _timed("decode", timings_ms):
        photo = decode_image(upload, limits)
    result = rectify(photo.pixels, parameters, photo.focal_length_px, ocr_engine())
    timings_ms |= result.timings_ms
    image_format: OutputFormat = "jpeg" if photo.format == "heic" else photo.format
    if encoding.format is not None and encoding.format != "json":
        image_format = encoding.format
    body, embedded = b"", None
    if encoding.format != "json" or encoding.embed:
        with _timed("encode", timings_ms):
            body = _encode(result, photo, image_format, encoding.quality)
    if encoding.format == "json":
        embedded = base64.b64encode(body).decode("ascii") if encoding.embed else None
        body = b""
    document = describe_rectification(result, timings_ms, embedded)
    return RectifyReply(body, MEDIA_TYPES[encoding.format or image_format], document)


def _encode(
    result: RectifyResult, photo: DecodedImage, image_format: OutputFormat, quality: int | None
) -> bytes:
    return encode_image(result.image, image_format, quality, photo.dpi, photo.icc_profile)


def describe_rectification(
    result: RectifyResult, timings_ms: dict[str, float], image: str | None
) -> dict[str, object]:
    """The contract's `RectifyResult` (JSON-ready): degrees, pixels of the EXIF-upright photo, no NaN."""
    height, width = result.image.shape[:2]
    field_of_view_rad = result.camera.field_of_view_rad
    document = {
        "kind": result.kind,
        "evidence": {
            "major_convergence": result.evidence.major_convergence,
            "minor_convergence": result.evidence.minor_convergence,
            "text_area_fraction": result.evidence.text_area_fraction,
        },
        "camera": {
            "focal_length_px": result.camera.focal_length_px,
            "field_of_view_deg": None if field_of_view_rad is None else math.degrees(field_of_view_rad),
            "source": result.camera.source,
        },
        "surface": _describe_surface(result.surface),
        "orientation": {
            "rotation_deg": result.orientation.rotation_deg,
            "mirrored": result.orientation.mirrored,
            "confidence": result.orientation.confidence,
        },
        "width": width,
        "height": height,
        "mesh": {
            "rows": result.mesh.shape[0],
            "columns": result.mesh.shape[1],
            "source": np.round(result.mesh, 3),  # a thousandth of a pixel; 17 digits would triple the JSON
        },
        "warnings": [{"code": notice.code, "detail": notice.detail} for notice in result.warnings],
        "timings_ms": {stage: round(value, 1) for stage, value in timings_ms.items()},
        "image": image,
    }
    ready = to_json_ready(document)
    assert isinstance(ready, dict)
    return ready


def _describe_surface(surface: PlaneSurface | StripsSurface) -> dict[str, object]:
    if isinstance(surface, PlaneSurface):
        return {"type": "plane", "normal": surface.normal}
    rulings = zip(surface.points, surface.angles_rad, surface.vanishing_points, strict=True)
    return {
        "type": "strips",
        "normals": np.round(surface.normals, 6).tolist(),
        "rulings": [
            {
                "point": np.round(point, 3).tolist(),
                "angle_deg": round(float(np.degrees(angle)), 4),
                "vanishing_point": _finite_point(vanishing_point),
            }
            for point, angle, vanishing_point in rulings
        ],
    }


def _finite_point(homogeneous: Vector, limit_px: float = 1e7) -> list[float] | None:
    """(x, y) of a homogeneous point (3,); None for one at infinity, or so far away that it may as well be."""
    point, third = homogeneous[:2], float(homogeneous[2])
    if float(np.abs(point).max()) >= limit_px * abs(third):
        return None
    x, y = point / third
    return [round(float(x), 3), round(float(y), 3)]


def to_json_ready(value: Any) -> Any:
    """`value` in the types of JSON; numbers that are not finite become None."""
    if isinstance(value, dict):
        return {str(key): to_json_ready(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_json_ready(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return to_json_ready(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


@contextmanager
def _timed(stage: str, timings_ms: dict[str, float]) -> Iterator[None]:
    started = time.perf_counter()
    yield
    timings_ms[stage] = (time.perf_counter() - started) * 1000


@functools.cache
def ocr_engine() -> OcrEngine | None:
    """This process's OCR engine, opened at first use; None where none is installed."""
    return open_engine()


def warm_up() -> dict[str, object]:
    """Do once what every first request would pay for: imports, the OCR engine, one tiny picture.

    Returns what is at hand: `ocr`, the engine's name or None.
    """
    engine = ocr_engine()
    with suppress(DocumentError):  # if this is no text to the pipeline, the road to that answer is warm now
        rectify_upload(
            encode_image(_draw_sheet(), "jpeg"), RectifyParameters(), EncodingOptions("jpeg"), ImageLimits()
        )
    return {"ocr": None if engine is None else engine.name}


def _draw_sheet() -> RgbImage:
    """(480, 360, 3): dark strokes in words and lines on white, a page in miniature."""
    sheet = np.full((480, 360, 3), 255, np.uint8)
    for line, top in enumerate(range(40, 440, 20)):
        for stroke, left in enumerate(range(40, 320, 5)):
            if (stroke + 3 * line) % 7:  # every seventh is a gap between words
                sheet[top + stroke % 3 : top + 9, left : left + 3] = 30
    return sheet
