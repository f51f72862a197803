"""One photo, or several, in; a flat page out."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from services.mosaic.parameters import MosaicParameters
from services.rectify.parameters import RectifyParameters

if TYPE_CHECKING:
    from services.imaging.codec import ImageLimits
    from services.operations import EncodingOptions

Format = Literal["jpeg", "png", "webp", "tiff", "pdf", "json"]
PagesFormat = Literal["jpeg", "png", "webp", "tiff", "pdf", "json", "zip"]
SeveralFormat = Literal["pdf", "tiff", "zip", "json"]
"""Of these, the ones that hold several pages."""


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
    """How the answer is wanted; `format` None is the upload's own.

    `pages_format` is that of an answer of several pages; None: the client takes none that holds them.
    """

    format: PagesFormat | None
    quality: int | None
    embed: bool
    pages_format: SeveralFormat | None = None


@dataclass(frozen=True, slots=True)
class Reply:
    """An image file (empty when JSON was asked for), its type, and the contract's result, ready for JSON."""

    body: bytes
    media_type: str
    document: dict[str, object]


def rectify(upload: bytes, parameters: RectifyParameters, encoding: Encoding, limits: UploadLimits) -> Reply:
    """Flat view of an uploaded photo, or of both its pages; raises the `DocumentError`s of `services.operations`."""
    from services.operations import rectify_upload

    reply = rectify_upload(upload, parameters, _encoding_options(encoding), image_limits(limits))
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
        MosaicImageLimits(image_limits(limits.photo), limits.max_megapixels),
    )
    return Reply(reply.body, reply.media_type, reply.document)


def image_limits(limits: UploadLimits) -> "ImageLimits":
    """`limits` as `services.imaging` takes them."""
    from services.imaging.codec import ImageLimits

    return ImageLimits(
        max_bytes=limits.max_bytes,
        max_megapixels=limits.max_megapixels,
        max_exif_bytes=limits.max_exif_bytes,
    )


def _encoding_options(encoding: Encoding) -> "EncodingOptions":
    from services.operations import EncodingOptions

    return EncodingOptions(
        format=encoding.format,
        quality=encoding.quality,
        embed=encoding.embed,
        pages_format=encoding.pages_format,
    )
