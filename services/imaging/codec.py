"""Decoding of images to RGB pixels, and encoding: the only module that does either.

Decoding starts with checks of the header, before any pixel is decoded: the type (by Pillow's header checks, for the
accepted formats only), bytes, structure and EXIF size (`containers`), pixels. Each format then has one decoder:
libjpeg-turbo by `simplejpeg` for JPEG (12 MP in a third of Pillow's time, and it reports damage that Pillow and OpenCV
hide), libheif for HEIC, Pillow for the rest and for JPEGs in CMYK.

Damaged files are refused: truncated files of every format, JPEGs whose decoder lost synchronization, PNGs with wrong
checksums. JPEG and WebP have no checksum, so damage that leaves a valid stream gives the same picture as in any viewer.

Colour: an RGB ICC profile (iPhone photos have Display P3) is not applied but returned, and embedded again by the
encoder: this is exact and costs no time. CMYK is converted by the plain formula, without its profile. Other profiles
are dropped.

Encoded files contain pixels, resolution and colour profile: no EXIF, no XMP, no GPS position.
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
import simplejpeg  # type: ignore[import-untyped]
from PIL import (
    Image,
    JpegImagePlugin,
    PngImagePlugin,
    TiffImagePlugin,
    UnidentifiedImageError,
    WebPImagePlugin,
)

from services.arrays import PageImage, RgbImage
from services.contract.images import ImageLimits
from services.errors import DocumentError, InvalidOption, TooLarge, UndecodableImage, UnsupportedMediaType
from services.imaging import containers
from services.imaging.exif import read_camera_facts
from services.imaging.pixel_conversion import convert_to_rgb
from services.imaging.reduction import halve

try:
    import pillow_heif
except ImportError:  # `make venv HEIC=without`: its wheel holds an encoder under the GPL
    HAS_HEIC = False
else:
    HAS_HEIC = True
    # One thread, because every core has its own worker. Only the primary image is used.
    pillow_heif.register_heif_opener(thumbnails=False, depth_images=False, aux_images=False, decode_threads=1)

UploadFormat = Literal["jpeg", "png", "webp", "tiff", "heic"]
OutputFormat = Literal["jpeg", "png", "webp", "tiff", "pdf"]

DEFAULT_DPI = 300.0
"""Resolution of encoded files if that of the upload is unknown: A4 from a 9 MP view of the page."""
DEFAULT_QUALITY = 90
"""Quality of JPEG, WebP and PDF: a photographed page of 12 MP takes 3 MB, a quarter of PNG's size."""

_PLUGINS: tuple[tuple[UploadFormat, str], ...] = (
    ("jpeg", JpegImagePlugin.JpegImageFile.format),
    ("png", PngImagePlugin.PngImageFile.format),
    ("webp", WebPImagePlugin.WebPImageFile.format),
    ("tiff", TiffImagePlugin.TiffImageFile.format),
    *((("heic", "HEIF"),) if HAS_HEIC else ()),
)
_HEIC_BRANDS = (b"heic", b"heix", b"mif1", b"msf1", b"heim", b"heis")
"""Brands of the first box of files in HEIC."""
_DAMAGE = ("premature end", "bad huffman", "bad arithmetic", "found marker")
"""Messages of libjpeg-turbo for missing or invalid data; its other warnings are harmless."""
_MOST_PROFILE_BYTES = 1_048_576
_FULL_CHROMA_QUALITY = 90
"""Quality from which JPEG keeps chroma at full resolution: coloured print stays sharp for 10 % more bytes."""
_LOSSLESS_QUALITY = 100
_LONGEST_SIDE_PX = {"jpeg": 65_500, "webp": 16_383, "png": 2**31 - 1, "tiff": 2**31 - 1, "pdf": 65_500}

# The limits come with every call; Pillow's own limit is one number for the whole process.
Image.MAX_IMAGE_PIXELS = None


@dataclass(frozen=True, slots=True, eq=False)
class DecodedImage:
    """A decoded upload.

    `pixels` is (H, W, 3) RGB uint8 with EXIF orientation applied, and owned by the caller. `focal_length_px` is the
    focal length by EXIF in these pixels; `dpi` the resolution of a scan; `icc_profile` the profile of the pixels. Each
    is None if unknown.
    """

    pixels: RgbImage
    format: UploadFormat
    focal_length_px: float | None
    dpi: float | None
    icc_profile: bytes | None
    reduction: int = 1
    """Pixels of the photo per pixel of `pixels`, along each side; `focal_length_px` is in pixels of `pixels`."""
    size: tuple[int, int] = (0, 0)
    """Width and height of the photo, with EXIF orientation applied."""
    camera: str | None = None
    pixel_aspect: float = 1.0
    """Width of a pixel over its height; `dpi` is the higher resolution of both axes."""


def decode_image(
    data: bytes, limits: ImageLimits, directory: int = 0, enough_px: int | None = None
) -> DecodedImage:
    """Image of an upload: JPEG, PNG, WebP, TIFF (first page) or HEIC; the first frame of an animation.

    Samples of 16 bits are scaled to 8, transparency is blended with white, gray and palettes become RGB.

    Parameters
    ----------
    data
        The file.
    limits
        Largest size of the file and of the image.
    directory
        Number of another page of a TIFF file, as checked by `containers.tiff_pages`.
    enough_px
        Long side from which on the image may be reduced, by 2, 4 or 8, as it is decoded: a JPEG of 12 MP then takes
        0.06 CPU s instead of 0.1.

    Raises
    ------
    UnsupportedMediaType
        When the file has none of these formats, or samples of another kind (floating point, 32 bits, Lab).
    TooLarge
        When a limit is exceeded; checked in the header.
    UndecodableImage
        When the data is truncated or damaged.
    """
    with _open_image(data, limits, directory) as (picture, upload_format):
        facts = read_camera_facts(picture)
        reduction = _reduction(picture.size, enough_px)
        size = picture.size
        pixels = _decode_jpeg(data, picture, reduction) if upload_format == "jpeg" else None
        if pixels is None:
            pixels = convert_to_rgb(picture)
            if upload_format == "png" and not pixels[-1].any():
                containers.check_png_rows(data)  # Pillow fills missing rows with black
            size = pixels.shape[1], pixels.shape[0]
            for _ in range(reduction.bit_length() - 1):
                pixels = halve(pixels)
        profile = _rgb_profile(picture)
    # Pillow's TIFF plugin applies the orientation. So does libheif, from the container's boxes: in HEIC only these
    # count (ISO/IEC 23008-12), and EXIF repeats them.
    orientation = 1 if upload_format in ("tiff", "heic") else facts.orientation
    focal_length_px = facts.focal_length_px
    if focal_length_px is not None and reduction > 1:
        focal_length_px = type(focal_length_px)(focal_length_px / reduction)
    return DecodedImage(
        _apply_orientation(pixels, orientation),
        upload_format,
        focal_length_px,
        facts.dpi,
        profile,
        reduction,
        (size[1], size[0]) if orientation > 4 else size,
        facts.camera,
        1 / facts.pixel_aspect if facts.orientation > 4 else facts.pixel_aspect,
    )


def _reduction(size: tuple[int, int], enough_px: int | None) -> int:
    """1, 2, 4 or 8: the most by which an image of `size` can be reduced and keeps a long side of `enough_px`."""
    reduction = 1
    while enough_px is not None and reduction < 8 and max(size) >= 2 * reduction * enough_px:
        reduction *= 2
    return reduction


def count_pixels(data: bytes, limits: ImageLimits) -> int:
    """Number of pixels that `decode_image` would return, from the header; raises the same errors."""
    with _open_image(data, limits) as (picture, _):
        width, height = picture.size
        return int(width * height)


@contextmanager
def _open_image(
    data: bytes, limits: ImageLimits, directory: int = 0
) -> Iterator[tuple[Image.Image, UploadFormat]]:
    """The checked, opened, not yet decoded image. Damage found inside the block raises `UndecodableImage`."""
    upload_format, plugin = detect_format(data)
    if len(data) > limits.max_bytes:
        raise TooLarge(f"The image has {len(data)} bytes; the limit is {limits.max_bytes}.")
    _check_container(data, upload_format, limits)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about damaged metadata, which is not used here
            with Image.open(io.BytesIO(data), formats=[plugin]) as picture:
                if directory:
                    picture.seek(directory)
                _check_header(picture, limits)
                yield picture, upload_format
    except (DocumentError, MemoryError):
        raise
    except UnidentifiedImageError as error:
        raise UndecodableImage(
            f"The header of the {upload_format.upper()} image is damaged, or describes a kind of pixels "
            "that is not supported."
        ) from error
    except Exception as error:  # plugins raise various exceptions on damaged bytes
        raise UndecodableImage(
            f"The {upload_format.upper()} image is truncated or damaged ({error})."
        ) from error


def detect_format(data: bytes) -> tuple[UploadFormat, str]:
    """Format of the data by the header checks of Pillow's plugins, and the plugin's name.

    Raises
    ------
    UnsupportedMediaType
        When it is not an accepted format.
    """
    for upload_format, plugin in _PLUGINS:
        accept = Image.OPEN[plugin][1]
        if accept is not None and accept(data[:16]) is True:
            return upload_format, plugin
    if not HAS_HEIC and data[4:8] == b"ftyp" and data[8:12] in _HEIC_BRANDS:
        raise UnsupportedMediaType("This service was installed without HEIC; send the photo as a JPEG.")
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
            pass  # libheif has its own limits


def _check_header(picture: Image.Image, limits: ImageLimits) -> None:
    """Check an opened, not yet decoded image: pixels, sides, metadata, kind of samples."""
    width, height = picture.size
    if width < 1 or height < 1:
        raise UndecodableImage("The image has no pixels.")
    containers.check_pixels(width, height, limits.max_pixels)
    if max(width, height) > limits.max_side_px:
        raise TooLarge(f"The image is {width} x {height} pixels; the limit is {limits.max_side_px} a side.")
    for name in ("exif", "Raw profile type exif"):  # ImageMagick writes the latter in PNG, in hexadecimal
        containers.check_exif_size(len(picture.info.get(name) or b""), limits.max_exif_bytes)
    if picture.mode in ("F", "I", "LAB", "HSV"):
        raise UnsupportedMediaType(
            "Floating-point, 32-bit and Lab samples are not accepted: "
            "send gray or RGB of 8 or 16 bits a sample."
        )


def _decode_jpeg(data: bytes, picture: Image.Image, reduction: int) -> RgbImage | None:
    """Pixels (H, W, 3) by libjpeg-turbo in strict mode; None if Pillow must decode the image (for example CMYK).

    A `reduction` rounds up: a last row or column may cover less than the others.
    """
    if picture.mode not in ("L", "RGB"):
        return None
    try:
        height, width, *_ = simplejpeg.decode_jpeg_header(data)
        if (width, height) != picture.size:
            raise UndecodableImage("The JPEG image is damaged: it has two sizes.")
        least = {"min_height": -(-height // reduction), "min_width": -(-width // reduction)}
        pixels: RgbImage = simplejpeg.decode_jpeg(
            data, "RGB", strict=True, **(least if reduction > 1 else {}), min_factor=1
        )
    except ValueError as error:
        if any(sign in str(error).lower() for sign in _DAMAGE):
            raise UndecodableImage(f"The JPEG image is truncated or damaged ({error}).") from error
        return None
    return pixels


def _rgb_profile(picture: Image.Image) -> bytes | None:
    """ICC profile of the returned RGB pixels, else None."""
    profile = picture.info.get("icc_profile")
    if not isinstance(profile, bytes) or not 128 <= len(profile) <= _MOST_PROFILE_BYTES:
        return None
    is_rgb = profile[16:20] == b"RGB " and picture.mode in ("RGB", "RGBA", "RGBa", "RGBX", "P", "PA")
    return profile if is_rgb else None


def _apply_orientation(pixels: RgbImage, orientation: int) -> RgbImage:
    """Upright image, from EXIF's orientation 1-8 (Exif 2.32, 4.6.4)."""
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
    pixels: PageImage,
    output_format: OutputFormat,
    quality: int | None = None,
    dpi: float | None = None,
    icc_profile: bytes | None = None,
) -> bytes:
    """File in `output_format` with (H, W, 3) RGB, (H, W) gray, or (H, W) black and white pixels.

    Parameters
    ----------
    pixels
        uint8, or bool: True is white.
    output_format
        PNG and TIFF (LZW) are lossless, with the fastest settings. Black and white is Group 4 in TIFF and PDF.
    quality
        1-100 (default 90), for JPEG, WebP and PDF. A PDF of quality 100 is lossless.
    dpi
        Resolution (default 300), if the format can store it. A PDF page measures pixels / dpi inches.
    icc_profile
        Colour profile to embed; it is one of colours, so other pixels go without.

    Raises
    ------
    InvalidOption
        When `quality` is out of range, or the image is too large for the format.
    """
    if quality is not None and not 1 <= quality <= 100:
        raise InvalidOption(f"quality must be from 1 to 100, not {quality}.", "quality")
    height, width = pixels.shape[:2]
    longest = _LONGEST_SIDE_PX[output_format]
    if max(width, height) > longest:
        raise InvalidOption(
            f"format: {output_format} holds at most {longest} pixels a side, and the result has "
            f"{width} x {height}; choose png or tiff.",
            "format",
        )
    if pixels.ndim == 2:
        icc_profile = None
    quality, dpi = quality or DEFAULT_QUALITY, dpi or DEFAULT_DPI
    if output_format == "jpeg":
        return _encode_jpeg(pixels, quality, dpi, icc_profile)
    if output_format == "pdf":
        return pdf_of(_encode_for_pdf(pixels, quality, dpi, icc_profile), dpi)
    picture = Image.fromarray(pixels)
    match output_format:
        case "png":
            return _encode_png(picture, dpi, icc_profile)
        case "webp":
            picture = picture.convert("L") if picture.mode == "1" else picture
            # Method 2 of 0-6: 12 MP in 0.3 CPU s (the default, 4: 0.8 s), 3 % larger. WebP stores no resolution.
            return _save(picture, "WEBP", quality=quality, method=2, icc_profile=icc_profile)
        case "tiff" if picture.mode == "1":
            return _encode_group4(picture, dpi)
        case "tiff":
            # Predictor 2 (differences of neighbours) halves the size of photos under LZW.
            return _save(
                picture,
                "TIFF",
                compression="tiff_lzw",
                tiffinfo={317: 2},
                dpi=(dpi, dpi),
                icc_profile=icc_profile,
            )


def pdf_of(image: bytes, dpi: float | None = None) -> bytes:
    """A PDF of one page with an image file of this module as it is; resolution as of `encode_image`."""
    layout = img2pdf.get_fixed_dpi_layout_fun((dpi or DEFAULT_DPI, dpi or DEFAULT_DPI))
    page: bytes = img2pdf.convert(image, layout_fun=layout, engine=img2pdf.Engine.internal, nodate=True)
    return page


def jpeg_size(data: bytes) -> tuple[int, int]:
    """Width and height of a JPEG file of this module."""
    height, width, *_ = simplejpeg.decode_jpeg_header(data)
    return width, height


def _encode_for_pdf(pixels: PageImage, quality: int, dpi: float, icc_profile: bytes | None) -> bytes:
    if pixels.dtype == bool:
        return _encode_group4(Image.fromarray(pixels), dpi)
    if quality >= _LOSSLESS_QUALITY:
        return _encode_png(Image.fromarray(pixels), dpi, icc_profile)
    return _encode_jpeg(pixels, quality, dpi, icc_profile)


def _encode_jpeg(pixels: PageImage, quality: int, dpi: float, icc_profile: bytes | None) -> bytes:
    # Not optimized: a second pass over 12 MP takes 45 ms and saves only 2-3 %.
    return _save(
        _for_jpeg(pixels),
        "JPEG",
        quality=quality,
        subsampling="4:4:4" if quality >= _FULL_CHROMA_QUALITY else "4:2:0",
        dpi=(round(dpi), round(dpi)),
        icc_profile=icc_profile,
    )


def _for_jpeg(pixels: PageImage) -> Image.Image:
    """The pixels as Pillow holds them: colours in four bytes. So given they are not copied again (12 MP: 23 ms)."""
    if pixels.dtype == bool:
        return Image.fromarray(pixels).convert("L")
    if pixels.ndim == 2:
        return Image.fromarray(pixels)
    height, width = pixels.shape[:2]
    four = cv2.cvtColor(np.asarray(pixels, np.uint8), cv2.COLOR_RGB2RGBA)
    return Image.frombuffer("RGB", (width, height), four, "raw", "RGBX", 0, 1)


def _encode_png(picture: Image.Image, dpi: float, icc_profile: bytes | None) -> bytes:
    return _save(picture, "PNG", compress_level=1, dpi=(dpi, dpi), icc_profile=icc_profile)


def _encode_group4(picture: Image.Image, dpi: float) -> bytes:
    return _save(picture, "TIFF", compression="group4", dpi=(dpi, dpi))


def _save(picture: Image.Image, plugin: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, plugin, **options)
    return buffer.getvalue()
