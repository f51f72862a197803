"""Bytes -> RGB pixels and back: the only place in the project that decodes or encodes an image.

Decoding goes through gates, each judged from the header before a pixel is decoded: the type (Pillow's own
header checks are the authority, for the accepted formats alone), bytes, structure and EXIF size
(`containers`), pixels. Then one decoder per format: libjpeg-turbo by `simplejpeg` for JPEG (12 MP in a third
of Pillow's time; and it tells of damage, which Pillow and OpenCV paint over), libheif for HEIC, Pillow for
the rest and for JPEGs in CMYK.

Damage is refused, not shown: truncated files of every format, JPEGs in which the decoder lost its place,
PNGs whose checksums do not match. JPEG and WebP carry no checksum: damage that leaves a valid stream gives
the picture that every viewer shows, always the same.

Colour: an RGB ICC profile (every iPhone's photos carry Display P3) is not applied but handed on, to be
embedded in what is encoded: exact, and free. CMYK is converted by the plain formula, without its profile,
and other profiles are dropped.

Output carries pixels, resolution and colour profile: no EXIF, no XMP, no GPS position.
"""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

import cv2
import img2pdf
import numpy as np
import pillow_heif
import simplejpeg  # type: ignore[import-untyped]
from numpy.typing import NDArray
from PIL import (
    Image,
    JpegImagePlugin,
    PngImagePlugin,
    TiffImagePlugin,
    UnidentifiedImageError,
    WebPImagePlugin,
)

from services.arrays import RgbImage
from services.contract.images import ImageLimits
from services.errors import DocumentError, InvalidOption, TooLarge, UndecodableImage, UnsupportedMediaType
from services.imaging import containers
from services.imaging.exif import read_camera_facts

UploadFormat = Literal["jpeg", "png", "webp", "tiff", "heic"]
OutputFormat = Literal["jpeg", "png", "webp", "tiff", "pdf"]

DEFAULT_DPI = 300.0
"""Resolution of what is encoded where the upload's is unknown: A4 from a 9 MP view of the page."""
DEFAULT_QUALITY = 90
"""Of JPEG, WebP and PDF: a photographed page of 12 MP takes 3 MB, a quarter of PNG's."""

_PLUGINS: tuple[tuple[UploadFormat, str], ...] = (
    ("jpeg", JpegImagePlugin.JpegImageFile.format),
    ("png", PngImagePlugin.PngImageFile.format),
    ("webp", WebPImagePlugin.WebPImageFile.format),
    ("tiff", TiffImagePlugin.TiffImageFile.format),
    ("heic", "HEIF"),
)
_DAMAGE = ("premature end", "bad huffman", "bad arithmetic", "found marker")
"""What libjpeg-turbo says when data is missing or made no sense; its other warnings are harmless."""
_BAND_PIXELS = 262_144
"""Pixels converted at a time: 1 MiB of Pillow's RGBX stays in the cache (3 times faster than at once)."""
_MOST_PROFILE_BYTES = 1_048_576
_FULL_CHROMA_QUALITY = 90
"""From here on JPEG keeps chroma at full resolution: coloured print stays sharp for 10 % more bytes."""
_LOSSLESS_QUALITY = 100
_LONGEST_SIDE_PX = {"jpeg": 65_500, "webp": 16_383, "png": 2**31 - 1, "tiff": 2**31 - 1, "pdf": 65_500}

# The limits are ours and come with every call; Pillow's own is one number for the whole process.
Image.MAX_IMAGE_PIXELS = None
# One thread: the engine gives every core a worker of its own. Only the primary image is of interest.
pillow_heif.register_heif_opener(thumbnails=False, depth_images=False, aux_images=False, decode_threads=1)


@dataclass(frozen=True, slots=True, eq=False)
class DecodedImage:
    """A decoded upload.

    `pixels` is (H, W, 3) RGB uint8 with EXIF orientation applied, and owned by the caller;
    `focal_length_px` is EXIF's in these pixels; `dpi` the resolution of a scan; `icc_profile` the
    profile of the pixels. Each None where unknown.
    """

    pixels: RgbImage
    format: UploadFormat
    focal_length_px: float | None
    dpi: float | None
    icc_profile: bytes | None


def decode_image(data: bytes, limits: ImageLimits, directory: int = 0) -> DecodedImage:
    """Picture in an upload: JPEG, PNG, WebP, TIFF (first page) or HEIC; of animations the first frame.

    `directory` is that of another page of a TIFF file, as `containers.tiff_pages` has found and judged it.

    16 bits a sample are scaled to 8, transparency is laid over white, gray and palettes become RGB.

    Raises
    ------
    UnsupportedMediaType
        When the bytes are none of these formats, or hold samples that are no picture's (floating point,
        32 bits, Lab).
    TooLarge
        When a limit is crossed; judged from the header.
    UndecodableImage
        When the data is truncated or damaged.
    """
    with _open_image(data, limits, directory) as (picture, upload_format):
        facts = read_camera_facts(picture)
        pixels = _decode_jpeg(data, picture) if upload_format == "jpeg" else None
        if pixels is None:
            pixels = _decode_with_pillow(picture)
            if upload_format == "png" and not pixels[-1].any():
                containers.check_png_rows(data)  # Pillow leaves missing rows black
        profile = _rgb_profile(picture)
    # TIFF's plugin turns the picture itself, and so does libheif, by the container's own boxes: these alone
    # count in HEIC (ISO/IEC 23008-12), whose EXIF repeats them.
    orientation = 1 if upload_format in ("tiff", "heic") else facts.orientation
    return DecodedImage(
        _apply_orientation(pixels, orientation),
        upload_format,
        facts.focal_length_px,
        facts.dpi,
        profile,
    )


def count_pixels(data: bytes, limits: ImageLimits) -> int:
    """Pixels that `decode_image` would make of `data`, told by its header; raises what that raises of it."""
    with _open_image(data, limits) as (picture, _):
        width, height = picture.size
        return int(width * height)


@contextmanager
def _open_image(
    data: bytes, limits: ImageLimits, directory: int = 0
) -> Iterator[tuple[Image.Image, UploadFormat]]:
    """The picture behind its gates, opened and not yet decoded; damage found inside is `UndecodableImage`."""
    upload_format, plugin = detect_format(data)
    if len(data) > limits.max_bytes:
        raise TooLarge(f"The image has {len(data)} bytes; the limit is {limits.max_bytes}.")
    _check_container(data, upload_format, limits)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of damaged metadata, which does not matter here
            with Image.open(io.BytesIO(data), formats=[plugin]) as picture:
                if directory:
                    picture.seek(directory)
                _check_header(picture, limits)
                yield picture, upload_format
    except (DocumentError, MemoryError):
        raise
    except UnidentifiedImageError as error:
        raise UndecodableImage(
            f"The header of the {upload_format.upper()} image is damaged, or tells of a kind of pixels "
            "that is not supported."
        ) from error
    except Exception as error:  # a plugin raises whatever the damaged bytes made it stumble over
        raise UndecodableImage(
            f"The {upload_format.upper()} image is truncated or damaged ({error})."
        ) from error


def detect_format(data: bytes) -> tuple[UploadFormat, str]:
    """Format by the header check of Pillow's plugin for it, and the plugin's name.

    Raises
    ------
    UnsupportedMediaType
        When it is none that is accepted.
    """
    for upload_format, plugin in _PLUGINS:
        accept = Image.OPEN[plugin][1]
        if accept is not None and accept(data[:16]) is True:
            return upload_format, plugin
    what = "is not a JPEG, PNG, WebP, TIFF or HEIC image" if data else "is empty"
    raise UnsupportedMediaType(f"The uploaded file {what}.")


def _check_container(data: bytes, upload_format: UploadFormat, limits: ImageLimits) -> None:
    match upload_format:
        case "jpeg":
            containers.check_jpeg(data, limits.max_exif_bytes)
        case "png":
            containers.check_png(data, limits.max_exif_bytes)
        case "webp":
            containers.check_webp(data, limits.max_pixels)
        case "tiff":
            containers.check_tiff(data, limits.max_pixels)
        case "heic":
            pass  # libheif bounds what it reads by limits of its own


def _check_header(picture: Image.Image, limits: ImageLimits) -> None:
    """Judge an opened, not yet decoded picture: pixels, sides, metadata, kind of samples."""
    width, height = picture.size
    if width < 1 or height < 1:
        raise UndecodableImage("The image has no pixels.")
    containers.check_pixels(width, height, limits.max_pixels)
    if max(width, height) > limits.max_side_px:
        raise TooLarge(f"The image is {width} x {height} pixels; the limit is {limits.max_side_px} a side.")
    for name in ("exif", "Raw profile type exif"):  # the latter is ImageMagick's way in PNG, in hexadecimal
        containers.check_exif_size(len(picture.info.get(name) or b""), limits.max_exif_bytes)
    if picture.mode in ("F", "I", "LAB", "HSV"):
        raise UnsupportedMediaType(
            "Floating-point, 32-bit and Lab samples are not accepted: "
            "send gray or RGB of 8 or 16 bits a sample."
        )


def _decode_jpeg(data: bytes, picture: Image.Image) -> RgbImage | None:
    """Pixels (H, W, 3) by libjpeg-turbo, strictly; None for what Pillow shall decode (CMYK, oddities)."""
    if picture.mode not in ("L", "RGB"):
        return None
    try:
        height, width, *_ = simplejpeg.decode_jpeg_header(data)
        if (width, height) != picture.size:
            raise UndecodableImage("The JPEG image is damaged: it has two sizes.")
        pixels: RgbImage = simplejpeg.decode_jpeg(data, "RGB", strict=True)
    except ValueError as error:
        if any(sign in str(error).lower() for sign in _DAMAGE):
            raise UndecodableImage(f"The JPEG image is truncated or damaged ({error}).") from error
        return None
    return pixels


def _decode_with_pillow(picture: Image.Image) -> RgbImage:
    """Pixels (H, W, 3) of a picture in any mode, converted band by band so that no second copy is held."""
    picture.load()
    width, height = picture.size
    pixels = np.empty((height, width, 3), np.uint8)
    rows = max(1, _BAND_PIXELS // width)
    full_scale = _full_scale_of_16_bit(picture) if picture.mode.startswith("I;16") else None
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        band = picture.crop((0, top, width, bottom))
        pixels[top:bottom] = _band_to_rgb(band) if full_scale is None else _gray16_to_rgb(band, *full_scale)
    return pixels


def _band_to_rgb(band: Image.Image) -> RgbImage:
    """(H, W, 3) of 8 bits; what is transparent shows white paper."""
    if not band.has_transparency_data:
        return np.asarray(band if band.mode == "RGB" else band.convert("RGB"))
    rgba = np.asarray(band.convert("RGBA"))
    alpha = rgba[..., 3:].astype(np.uint16)
    # 255 * 255 + 127 fits 16 bits.
    blended = (rgba[..., :3] * alpha + 255 * (255 - alpha) + 127) // 255
    return blended.astype(np.uint8)


def _full_scale_of_16_bit(picture: Image.Image) -> tuple[int, bool]:
    """Value of white (or of black, when the second is true) in a gray picture of more than 8 bits."""
    tags = getattr(picture, "tag_v2", {})
    bits = tags.get(258, (16,))[0]  # BitsPerSample: Pillow leaves 12 bits as they are
    return (1 << bits) - 1, tags.get(262) == 0  # PhotometricInterpretation WhiteIsZero, left as it is too


def _gray16_to_rgb(band: Image.Image, full_scale: int, is_inverted: bool) -> RgbImage:
    samples = np.asarray(band).astype(np.uint32)
    gray = ((samples * 255 + full_scale // 2) // full_scale).clip(0, 255).astype(np.uint8)
    if is_inverted:
        gray = 255 - gray
    return np.repeat(gray[..., None], 3, axis=2)


def _rgb_profile(picture: Image.Image) -> bytes | None:
    """ICC profile that describes the RGB pixels as they come out, else None."""
    profile = picture.info.get("icc_profile")
    if not isinstance(profile, bytes) or not 128 <= len(profile) <= _MOST_PROFILE_BYTES:
        return None
    is_rgb = profile[16:20] == b"RGB " and picture.mode in ("RGB", "RGBA", "RGBa", "RGBX", "P", "PA")
    return profile if is_rgb else None


def _apply_orientation(pixels: RgbImage, orientation: int) -> RgbImage:
    """Upright picture from EXIF's orientation 1-8 (Exif 2.32, 4.6.4)."""
    match orientation:
        case 2:
            pixels = np.asarray(cv2.flip(pixels, 1), np.uint8)
        case 3:
            pixels = np.asarray(cv2.rotate(pixels, cv2.ROTATE_180), np.uint8)
        case 4:
            pixels = np.asarray(cv2.flip(pixels, 0), np.uint8)
        case 5:
            pixels = np.asarray(cv2.transpose(pixels), np.uint8)
        case 6:
            pixels = np.asarray(cv2.rotate(pixels, cv2.ROTATE_90_CLOCKWISE), np.uint8)
        case 7:
            pixels = np.asarray(cv2.flip(cv2.transpose(pixels), -1), np.uint8)
        case 8:
            pixels = np.asarray(cv2.rotate(pixels, cv2.ROTATE_90_COUNTERCLOCKWISE), np.uint8)
    return pixels


def encode_image(
    pixels: NDArray[np.uint8],
    output_format: OutputFormat,
    quality: int | None = None,
    dpi: float | None = None,
    icc_profile: bytes | None = None,
) -> bytes:
    """File in `output_format` of (H, W, 3) RGB or (H, W) gray pixels.

    `quality` 1-100 (default 90) applies to JPEG, WebP and PDF; a PDF of quality 100 is lossless. PNG and
    TIFF (LZW) are lossless at their fastest. `dpi` (default 300) is written where the format has a place
    for it; a PDF's page measures pixels / dpi inches.

    Raises
    ------
    InvalidOption
        When `quality` is out of its range, or the picture is too large for the format.
    """
    if quality is not None and not 1 <= quality <= 100:
        raise InvalidOption(f"quality must be from 1 to 100, not {quality}.")
    height, width = pixels.shape[:2]
    longest = _LONGEST_SIDE_PX[output_format]
    if max(width, height) > longest:
        raise InvalidOption(
            f"format: {output_format} holds at most {longest} pixels a side, and the result has "
            f"{width} x {height}; choose png or tiff."
        )
    picture = Image.fromarray(pixels)
    quality, dpi = quality or DEFAULT_QUALITY, dpi or DEFAULT_DPI
    match output_format:
        case "jpeg":
            return _encode_jpeg(picture, quality, dpi, icc_profile)
        case "png":
            return _encode_png(picture, dpi, icc_profile)
        case "webp":
            # Method 2 of 0-6: 12 MP in 0.3 CPU s (4, the default: 0.8), 3 % larger. WebP has no resolution.
            return _save(picture, "WEBP", quality=quality, method=2, icc_profile=icc_profile)
        case "tiff":
            # Predictor 2 (differences of neighbours) halves what LZW alone makes of a photo.
            return _save(
                picture,
                "TIFF",
                compression="tiff_lzw",
                tiffinfo={317: 2},
                dpi=(dpi, dpi),
                icc_profile=icc_profile,
            )
        case "pdf":
            is_lossless = quality >= _LOSSLESS_QUALITY
            embedded = (
                _encode_png(picture, dpi, icc_profile)
                if is_lossless
                else _encode_jpeg(picture, quality, dpi, icc_profile)
            )
            layout = img2pdf.get_fixed_dpi_layout_fun((dpi, dpi))
            page: bytes = img2pdf.convert(
                embedded, layout_fun=layout, engine=img2pdf.Engine.internal, nodate=True
            )
            return page


def _encode_jpeg(picture: Image.Image, quality: int, dpi: float, icc_profile: bytes | None) -> bytes:
    # Not optimized: a second pass over 12 MP costs 45 ms for 2-3 % fewer bytes.
    return _save(
        picture,
        "JPEG",
        quality=quality,
        subsampling="4:4:4" if quality >= _FULL_CHROMA_QUALITY else "4:2:0",
        dpi=(round(dpi), round(dpi)),
        icc_profile=icc_profile,
    )


def _encode_png(picture: Image.Image, dpi: float, icc_profile: bytes | None) -> bytes:
    return _save(picture, "PNG", compress_level=1, dpi=(dpi, dpi), icc_profile=icc_profile)


def _save(picture: Image.Image, plugin: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, plugin, **options)
    return buffer.getvalue()
