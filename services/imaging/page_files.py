"""Several pages -> one file: a PDF or a TIFF of several pages, or an archive with an image a page."""

import io
import zipfile
from collections.abc import Sequence
from typing import Literal

import img2pdf
from PIL import Image

from services.arrays import RgbImage
from services.imaging.codec import DEFAULT_DPI, DEFAULT_QUALITY, OutputFormat, encode_image

PagesFileFormat = Literal["pdf", "tiff", "zip"]

SUFFIXES: dict[OutputFormat, str] = {
    "jpeg": "jpg",
    "png": "png",
    "webp": "webp",
    "tiff": "tif",
    "pdf": "pdf",
}
"""Of files in an archive."""


def encode_pages(
    pages: Sequence[RgbImage],
    file_format: PagesFileFormat,
    image_format: OutputFormat = "jpeg",
    quality: int | None = None,
    dpi: float | None = None,
    icc_profile: bytes | None = None,
) -> bytes:
    """One file of all `pages`, each (H, W, 3) RGB, in their order.

    `image_format` is that of the images in an archive, which are named `page-01.jpg` and so on. The other options are
    those of `encode_image` for every page.

    Raises
    ------
    InvalidOption
        When `quality` is out of its range, or a page is too large for the format.
    """
    if file_format == "zip":
        return archive_files(
            [encode_image(page, image_format, quality, dpi, icc_profile) for page in pages],
            SUFFIXES[image_format],
        )
    if file_format == "tiff":
        if len(pages) == 1:
            return encode_image(pages[0], "tiff", quality, dpi, icc_profile)
        return _encode_tiff(pages, dpi or DEFAULT_DPI, icc_profile)
    embedded: OutputFormat = "png" if (quality or DEFAULT_QUALITY) >= 100 else "jpeg"
    layout = img2pdf.get_fixed_dpi_layout_fun((dpi or DEFAULT_DPI, dpi or DEFAULT_DPI))
    file: bytes = img2pdf.convert(
        [encode_image(page, embedded, quality, dpi, icc_profile) for page in pages],
        layout_fun=layout,
        engine=img2pdf.Engine.internal,
        nodate=True,
    )
    return file


def archive_files(files: Sequence[bytes], suffix: str) -> bytes:
    """ZIP archive of `files`, a page each; images are compressed already, so they are only stored."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for number, file in enumerate(files, 1):
            # A fixed date: the same pages make the same archive.
            archive.writestr(zipfile.ZipInfo(f"page-{number:02d}.{suffix}"), file)
    return buffer.getvalue()


def _encode_tiff(pages: Sequence[RgbImage], dpi: float, icc_profile: bytes | None) -> bytes:
    first, *others = (Image.fromarray(page) for page in pages)
    buffer = io.BytesIO()
    first.save(
        buffer,
        "TIFF",
        save_all=True,
        append_images=others,
        compression="tiff_lzw",
        tiffinfo={317: 2},  # predictor, as of one page
        dpi=(dpi, dpi),
        icc_profile=icc_profile,
    )
    return buffer.getvalue()
