"""The pages of an upload (images, TIFF files, PDFs), counted and checked before any is decoded."""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from services.arrays import RgbImage
from services.contract.images import DocumentLimits, ImageLimits
from services.contract.rectify import Origin
from services.errors import DocumentError, InvalidOption, TooLarge, UnsupportedMediaType
from services.imaging import containers
from services.imaging.codec import DecodedImage, UploadFormat, count_pixels, decode_image, detect_format
from services.imaging.pdf_drawing import PDF_LIMITS, PdfLimits, PdfPages, open_pdf

RENDER_DPI = 200.0
"""Resolution for rendering PDF pages: print of 8 pt is 22 px high, and a page of A4 has 3.9 megapixels."""
POINTS_PER_INCH = 72.0
_PDF_MARK, _PDF_MARK_WITHIN = b"%PDF-", 1024
"""The header may follow other bytes (PDF 1.7, implementation note 13)."""


class PagePicture(NamedTuple):
    """A decoded page: (H, W, 3) RGB uint8, and its focal length in pixels if its metadata has one.

    `format` is that of the file, or JPEG for a page of a PDF; resolution and colour profile are None if unknown.
    """

    pixels: RgbImage
    focal_length_px: float | None
    format: UploadFormat = "jpeg"
    dpi: float | None = None
    icc_profile: bytes | None = None
    reduction: int = 1
    """Pixels of the page per pixel of `pixels`; `focal_length_px` is in pixels of `pixels`."""
    full_size: tuple[int, int] | None = None
    """Width and height of the page; None: those of `pixels`."""
    camera: str | None = None
    """Name of the camera by EXIF."""
    origin: Origin = "photo"
    pixel_aspect: float = 1.0
    """Width of a pixel over its height; `dpi` is the higher resolution of both axes."""
    stretch: tuple[float, float] = (1.0, 1.0)
    """Pixels of the page, at full size, per pixel of the file, along x and y, after they were made square."""
    original: bytes | None = None
    """The image file, if it has this page only."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the page in pixels of the file, not reduced."""
        return self.full_size or (self.pixels.shape[1], self.pixels.shape[0])


@dataclass(frozen=True, slots=True, eq=False)
class PageSource:
    """A page that is checked and not yet decoded.

    `upload` and `page` count from 0, `page` within its file; `label` names it among several (`image[1], page 3`),
    and `field` its part of the request; both are empty for a page that is alone.
    """

    upload: int
    page: int
    pixels: int
    label: str
    field: str | None
    file: "_File"

    def decode(self, enough_px: int | None = None) -> PagePicture:
        """The page's picture; raises what `decode_image` raises, naming the page.

        An image may be reduced to a long side of `enough_px`.
        """
        with naming_page(self.label, self.field):
            return self.file.decode(self.page, enough_px)


@contextmanager
def open_pages(
    uploads: Sequence[bytes],
    limits: DocumentLimits,
    only: int | None = None,
    *,
    lenient: bool = False,
    pdf: PdfLimits = PDF_LIMITS,
) -> Iterator[list[PageSource]]:
    """All pages of `uploads` in their order, or `only` one of them, counted from 1; they are there inside of the block.

    An image is one page, and so is an animation (its first frame); TIFF files and PDFs have as many as they have. With
    `lenient`, one of several uploads that cannot be opened is a page whose `decode` raises the error.

    Raises
    ------
    UnsupportedMediaType, UndecodableImage
        When an upload is neither an image nor a PDF, is damaged, has no page, or needs a password.
    TooLarge
        When a limit is crossed: by one page, or by all of them together.
    InvalidOption
        When there is no page `only`.
    """
    most = limits.max_pages if only is None else only
    with ExitStack() as stack:
        pages: list[PageSource] = []
        for index, upload in enumerate(uploads):
            file: _File
            try:
                with naming_page(*_label(index, 0, len(uploads), several=False)):
                    file = stack.enter_context(_open_file(upload, limits.image, pdf, most + 1 - len(pages)))
                    sizes = file.sizes()
            except DocumentError as error:
                if not lenient or len(uploads) == 1:
                    raise
                file, sizes = _Unreadable(error), [0]
            for page, size in enumerate(sizes):
                name = _label(index, page, len(uploads), several=len(sizes) > 1)
                pages.append(PageSource(index, page, size, *name, file))
            if len(pages) > most:
                break
        if only is not None:
            if len(pages) < only:
                raise InvalidOption(f"page: there is no page {only}; the upload has {len(pages)}.", "page")
            pages = pages[only - 1 : only]
        _check_together(pages, limits)
        yield pages


def _check_together(pages: Sequence[PageSource], limits: DocumentLimits) -> None:
    if len(pages) > limits.max_pages:
        setting = "MAX_PAGES" if limits.of == "document" else "MAX_STACK_PAGES"
        way_out = (
            "send fewer, or say as `page` which one you want" if limits.of == "document" else "send fewer"
        )
        raise TooLarge(
            f"image: a {limits.of} may have {limits.max_pages} pages ({setting}), and this one has more; {way_out}.",
            "image",
        )
    pixels = sum(page.pixels for page in pages)
    if len(pages) > 1 and pixels > limits.max_megapixels * 1e6:
        raise TooLarge(
            f"image: the pages have {pixels / 1e6:.1f} megapixels together; the limit of a {limits.of} is "
            f"{limits.max_megapixels:g} (MAX_DOCUMENT_MEGAPIXELS).",
            "image",
        )


def is_pdf(upload: bytes) -> bool:
    """Whether the bytes begin as a PDF."""
    return _PDF_MARK in upload[:_PDF_MARK_WITHIN]


def page_picture(image: DecodedImage) -> PagePicture:
    """The picture of a page that is an image."""
    return PagePicture(
        image.pixels,
        image.focal_length_px,
        image.format,
        image.dpi,
        image.icc_profile,
        image.reduction,
        image.size,
        image.camera,
        pixel_aspect=image.pixel_aspect,
    )


class _File(Protocol):
    """An upload with its pages, up to the number that was requested."""

    def sizes(self) -> list[int]:
        """Pixels of every page."""
        ...

    def decode(self, page: int, enough_px: int | None) -> PagePicture:
        """The picture of a page, counted from 0."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class _Image:
    """An image, of one page."""

    data: bytes
    limits: ImageLimits

    def sizes(self) -> list[int]:
        return [count_pixels(self.data, self.limits)]

    def decode(self, page: int, enough_px: int | None) -> PagePicture:
        return page_picture(decode_image(self.data, self.limits, page, enough_px))._replace(
            original=self.data
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Tiff:
    """A TIFF file, each page with a directory of its own."""

    data: bytes
    limits: ImageLimits
    pages: list[containers.TiffPage]

    def sizes(self) -> list[int]:
        return [page.width * page.height for page in self.pages]

    def decode(self, page: int, enough_px: int | None) -> PagePicture:
        return page_picture(decode_image(self.data, self.limits, self.pages[page].directory, enough_px))


@dataclass(frozen=True, slots=True, eq=False)
class _Pdf:
    """A PDF; its pages are drawn at `RENDER_DPI`, very large ones coarser, so that they keep to the limits."""

    pages: PdfPages
    limits: ImageLimits
    sizes_pt: list[tuple[float, float]]

    def sizes(self) -> list[int]:
        return [width * height for width, height, _ in map(self._plan, range(len(self.sizes_pt)))]

    def decode(self, page: int, enough_px: int | None) -> PagePicture:
        width, height, scale = self._plan(page)
        picture = np.ascontiguousarray(self.pages.draw(page, scale)[:height, :width])
        origin: Origin = self.pages.look_for_type(page) or "page"
        return PagePicture(picture, None, dpi=scale * POINTS_PER_INCH, origin=origin)

    def _plan(self, page: int) -> tuple[int, int, float]:
        """Width and height in pixels, and pixels a point."""
        width, height = self.sizes_pt[page]
        scale = RENDER_DPI / POINTS_PER_INCH
        scale = min(scale, math.sqrt(self.limits.max_pixels / (width * height)))
        scale = min(scale, self.limits.max_side_px / max(width, height))
        # The renderer rounds up, so that a hundredth of a pixel would be a white column.
        columns, rows = (max(1, round(side * scale)) for side in (width, height))
        return columns, rows, scale


@dataclass(frozen=True, slots=True, eq=False)
class _Unreadable:
    """An upload that cannot be opened, as one page."""

    error: DocumentError

    def sizes(self) -> list[int]:
        return [0]

    def decode(self, page: int, enough_px: int | None) -> PagePicture:
        raise self.error


@contextmanager
def _open_file(data: bytes, limits: ImageLimits, pdf: PdfLimits, most: int) -> Iterator[_File]:
    if is_pdf(data) and not _is_image(data):
        if len(data) > limits.max_bytes:
            raise TooLarge(f"The PDF has {len(data)} bytes; the limit is {limits.max_bytes}.")
        with open_pdf(len(data), limits.max_pixels, pdf) as pages:
            yield _Pdf(pages, limits, pages.open(data, most))
        return
    try:
        upload_format, _ = detect_format(data)
    except UnsupportedMediaType as error:
        raise UnsupportedMediaType(error.detail.replace(" image.", " image, nor a PDF.")) from error
    if upload_format != "tiff":
        yield _Image(data, limits)
        return
    if len(data) > limits.max_bytes:
        raise TooLarge(f"The image has {len(data)} bytes; the limit is {limits.max_bytes}.")
    yield _Tiff(data, limits, containers.tiff_pages(data, limits.max_pixels, most))


def _is_image(data: bytes) -> bool:
    try:
        detect_format(data)
    except UnsupportedMediaType:
        return False
    return True


def _label(upload: int, page: int, uploads: int, several: bool) -> tuple[str, str | None]:
    """What a page is called, and its part of the request."""
    place = f"image[{upload}]" if uploads > 1 else ""
    label = ", ".join(part for part in (place, f"page {page + 1}" if several else "") if part)
    return label, place or None


@contextmanager
def naming_page(label: str, field: str | None) -> Iterator[None]:
    """Add the name of the page, and its field, to an error that the block raises."""
    try:
        yield
    except DocumentError as error:
        if not label or error.detail.startswith(label):
            raise
        raise type(error)(f"{label}: {error.detail}", field or error.field) from error
