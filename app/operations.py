"""What the app asks of `services`, as functions that workers run.

The imports are inside of the functions on purpose: they happen in the worker, so that the server process
loads no numpy and no OpenCV, and what crosses the border between them is plain data.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from services.mosaic.parameters import MosaicParameters
from services.rectify.parameters import RectifyParameters

if TYPE_CHECKING:
    from services.imaging.codec import ImageLimits
    from services.operations import EncodingOptions

Format = Literal["jpeg", "png", "webp", "tiff", "pdf", "json"]

PRELOADED = ("services.operations",)
"""Loaded once, before the first worker exists; every worker starts with it."""


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """What an upload may cost, judged from its header in the worker, before decoding."""

    max_bytes: int
    max_megapixels: float
    max_exif_bytes: int


@dataclass(frozen=True, slots=True)
class MosaicLimits:
    """What each photo of a mosaic may cost, and all of them together."""

    photo: UploadLimits
    max_megapixels: float


@dataclass(frozen=True, slots=True)
class Encoding:
    """How the answer is wanted; `format` None is the upload's own."""

    format: Format | None
    quality: int | None
    embed: bool


@dataclass(frozen=True, slots=True)
class Reply:
    """An image file (empty when JSON was asked for), its type, and the contract's result, ready for JSON."""

    body: bytes
    media_type: str
    document: dict[str, object]


RectifyOperation = Callable[[bytes, RectifyParameters, Encoding, UploadLimits], Reply]
MosaicOperation = Callable[[list[bytes], MosaicParameters, Encoding, MosaicLimits], Reply]
WarmUp = Callable[[], dict[str, object]]


def rectify(upload: bytes, parameters: RectifyParameters, encoding: Encoding, limits: UploadLimits) -> Reply:
    """Frontal flat view of an uploaded photo; raises the `DocumentError`s of `services.operations`."""
    from services.operations import rectify_upload

    reply = rectify_upload(upload, parameters, _encoding_options(encoding), _image_limits(limits))
    return Reply(reply.body, reply.media_type, reply.document)


def mosaic(
    uploads: list[bytes], parameters: MosaicParameters, encoding: Encoding, limits: MosaicLimits
) -> Reply:
    """The one page of several uploaded photos; raises the `DocumentError`s of `services.operations`."""
    from services.operations import MosaicImageLimits, mosaic_uploads

    reply = mosaic_uploads(
        uploads,
        parameters,
        _encoding_options(encoding),
        MosaicImageLimits(_image_limits(limits.photo), limits.max_megapixels),
    )
    return Reply(reply.body, reply.media_type, reply.document)


def _encoding_options(encoding: Encoding) -> "EncodingOptions":
    from services.operations import EncodingOptions

    return EncodingOptions(format=encoding.format, quality=encoding.quality, embed=encoding.embed)


def _image_limits(limits: UploadLimits) -> "ImageLimits":
    from services.imaging.codec import ImageLimits

    return ImageLimits(
        max_bytes=limits.max_bytes,
        max_megapixels=limits.max_megapixels,
        max_exif_bytes=limits.max_exif_bytes,
    )


def warm_up() -> dict[str, object]:
    """Load in this worker what a first request would wait for; what is at hand (`ocr`: its name, or None)."""
    from services.operations import warm_up as warm_up_services

    return warm_up_services()


@dataclass(frozen=True, slots=True)
class Operations:
    """The operations of one app; a test puts others in their place."""

    rectify: RectifyOperation = rectify
    mosaic: MosaicOperation = mosaic
    warm_up: WarmUp = warm_up
    preloaded: tuple[str, ...] = PRELOADED
