"""What leaves: the same pixels, at the right size on paper, and nothing about where the photo was taken."""

import io

import numpy as np
import pikepdf
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageCms

from services.contract.images import ImageLimits
from services.errors import InvalidOption
from services.imaging.codec import DEFAULT_DPI, OutputFormat, decode_image, encode_image
from tests.services.imaging.files import make_file

FORMATS: tuple[OutputFormat, ...] = ("jpeg", "png", "webp", "tiff", "pdf")
RGB_PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


@pytest.fixture(scope="module")
def page() -> NDArray[np.uint8]:
    """(90, 60, 3): warm paper, a red and a black stroke."""
    pixels = np.full((90, 60, 3), [250, 245, 230], np.uint8)
    pixels[20:28, 10:50] = [200, 20, 30]
    pixels[50:58, 10:50] = 10
    return pixels


def open_page(data: bytes) -> Image.Image:
    """The encoded picture, as Pillow or (out of a PDF) pikepdf reads it."""
    if data.startswith(b"%PDF"):
        with pikepdf.open(io.BytesIO(data)) as document:
            assert len(document.pages) == 1
            (image,) = document.pages[0].get_images().values()
            picture = pikepdf.PdfImage(image).as_pil_image()
            picture.load()
            return picture
    return Image.open(io.BytesIO(data))


@pytest.mark.parametrize("output_format", FORMATS)
def test_pixels_survive(page: NDArray[np.uint8], output_format: OutputFormat) -> None:
    difference = np.abs(np.asarray(open_page(encode_image(page, output_format))).astype(int) - page)
    assert difference.max() == 0 if output_format in ("png", "tiff") else difference.mean() < 3


@pytest.mark.parametrize("output_format", FORMATS)
def test_gray_pixels_survive(page: NDArray[np.uint8], output_format: OutputFormat) -> None:
    gray = np.ascontiguousarray(page[..., 0])
    encoded = np.asarray(open_page(encode_image(gray, output_format)).convert("L")).astype(int)
    assert np.abs(encoded - gray).mean() < 3


def test_a_pdf_of_full_quality_is_lossless(page: NDArray[np.uint8]) -> None:
    assert (np.asarray(open_page(encode_image(page, "pdf", quality=100))) == page).all()


@pytest.mark.parametrize("output_format", ["jpeg", "webp", "pdf"])
def test_quality_trades_bytes(output_format: OutputFormat) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (200, 200, 3), dtype=np.uint8)
    sizes = [len(encode_image(noise, output_format, quality)) for quality in (1, 50, 90)]
    assert sizes == sorted(sizes)
    assert sizes[2] > 2 * sizes[0]


def test_coloured_print_keeps_its_colour(page: NDArray[np.uint8]) -> None:
    thin = page.copy()
    thin[:, ::4] = [255, 0, 0]
    decoded = np.asarray(open_page(encode_image(thin, "jpeg"))).astype(int)
    assert np.abs(decoded[:, ::4] - [255, 0, 0]).mean() < 12  # 4:2:0 makes it 60


@pytest.mark.parametrize(("dpi", "expected"), [(None, DEFAULT_DPI), (200.0, 200.0)])
@pytest.mark.parametrize("output_format", ["jpeg", "png", "tiff"])
def test_resolution_is_written(
    page: NDArray[np.uint8], output_format: OutputFormat, dpi: float | None, expected: float
) -> None:
    picture = open_page(encode_image(page, output_format, dpi=dpi))
    assert picture.info["dpi"] == pytest.approx((expected, expected), rel=1e-3)


@pytest.mark.parametrize("quality", [90, 100])
def test_a_pdf_page_has_its_true_size(page: NDArray[np.uint8], quality: int) -> None:
    with pikepdf.open(io.BytesIO(encode_image(page, "pdf", quality, dpi=150.0))) as document:
        box = [float(value) for value in document.pages[0].mediabox]
    assert box == pytest.approx([0, 0, 60 / 150 * 72, 90 / 150 * 72], abs=0.01)


@pytest.mark.parametrize("output_format", ["jpeg", "png", "webp", "tiff"])
def test_a_colour_profile_is_embedded(page: NDArray[np.uint8], output_format: OutputFormat) -> None:
    picture = open_page(encode_image(page, output_format, icc_profile=RGB_PROFILE))
    assert picture.info["icc_profile"] == RGB_PROFILE


@pytest.mark.parametrize("output_format", FORMATS)
def test_nothing_of_the_camera_leaves(page: NDArray[np.uint8], output_format: OutputFormat) -> None:
    exif = Image.Exif()
    exif[0x010F] = "Camera-Maker"
    exif.get_ifd(0x8825).update({1: "N", 2: (48.0, 51.0, 29.5)})
    upload = make_file(page, "JPEG", exif=exif, xmp=b"<x>Camera-Maker</x>", comment=b"Camera-Maker")
    assert b"Camera-Maker" in upload
    photo = decode_image(upload, ImageLimits())
    encoded = encode_image(photo.pixels, output_format, None, photo.dpi, photo.icc_profile)
    assert b"Camera-Maker" not in encoded
    assert b"Exif" not in encoded
    tags = open_page(encoded).getexif()
    assert 0x8825 not in tags
    assert 0x010F not in tags


def test_encoding_is_repeatable(page: NDArray[np.uint8]) -> None:
    for output_format in FORMATS:
        assert encode_image(page, output_format) == encode_image(page, output_format)


@pytest.mark.parametrize("quality", [0, 101, -5])
def test_quality_out_of_range(page: NDArray[np.uint8], quality: int) -> None:
    with pytest.raises(InvalidOption, match="quality"):
        encode_image(page, "jpeg", quality)


def test_a_result_that_the_format_cannot_hold() -> None:
    strip = np.zeros((1, 16_384, 3), np.uint8)
    with pytest.raises(InvalidOption, match="format"):
        encode_image(strip, "webp")
    assert open_page(encode_image(strip, "png")).size == (16_384, 1)
