"""Pages of uploads: TIFF files and PDFs of several pages, their limits, and files that are damaged or made to cost."""

import io
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pikepdf
import pytest
from numpy.typing import NDArray
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile

from services.contract.images import DocumentLimits, ImageLimits
from services.contract.rectify import Origin, TypesetPage
from services.errors import DocumentError, InvalidOption, TooLarge, UndecodableImage, UnsupportedMediaType
from services.imaging.codec import decode_image, encode_image
from services.imaging.page_images import RENDER_DPI, open_pages
from tests.services.imaging.files import make_file, pack_directory

LIMITS = DocumentLimits()
GRAYS = (10, 120, 230)
LONGEST_S = 5.0
"""Generous, for a loaded machine: each refusal takes milliseconds."""


def frames(grays: Sequence[int] = GRAYS, size: tuple[int, int] = (200, 100)) -> list[Image.Image]:
    return [Image.new("RGB", size, (gray, gray, gray)) for gray in grays]


def several(plugin: str, pictures: Sequence[Image.Image], **options: object) -> bytes:
    buffer = io.BytesIO()
    pictures[0].save(buffer, plugin, save_all=True, append_images=list(pictures[1:]), **options)
    return buffer.getvalue()


def pdf(*sizes: tuple[float, float], count: int = 1, **options: object) -> bytes:
    buffer, document = io.BytesIO(), pikepdf.new()
    for size in sizes * count:
        document.add_blank_page(page_size=size)
    document.save(buffer, **options)
    return buffer.getvalue()


A4 = (595.0, 842.0)


def pixels_of(uploads: Sequence[bytes], limits: DocumentLimits = LIMITS) -> list[NDArray[np.uint8]]:
    with open_pages(uploads, limits) as pages:
        found = [page.decode().pixels for page in pages]
        assert [page.pixels for page in pages] == [image.shape[0] * image.shape[1] for image in found]
    return found


def refusal(error: type[DocumentError], *uploads: bytes, limits: DocumentLimits = LIMITS) -> DocumentError:
    started = time.process_time()
    with pytest.raises(error) as caught:
        pixels_of(uploads, limits)
    assert time.process_time() - started < LONGEST_S
    return caught.value


@pytest.mark.parametrize(
    "options", [{}, {"compression": "tiff_lzw"}, {"compression": "group4"}, {"big_tiff": True}]
)
def test_every_page_of_a_tiff(options: dict[str, object]) -> None:
    pictures = frames((0, 255, 0))
    if options.get("compression") == "group4":
        pictures = [picture.convert("1") for picture in pictures]
    file = several("TIFF", pictures, **options)
    assert [int(image.mean()) for image in pixels_of([file])] == [0, 255, 0]
    # Where one page is wanted it is the first, as before.
    assert decode_image(file, ImageLimits()).pixels.max() == 0


def test_pages_may_differ_in_size_and_kind() -> None:
    pictures = [Image.new("L", (30, 20), 7), Image.new("RGB", (50, 10), "white"), Image.new("1", (16, 16))]
    assert [image.shape for image in pixels_of([several("TIFF", pictures)])] == [
        (20, 30, 3),
        (10, 50, 3),
        (16, 16, 3),
    ]


@pytest.mark.parametrize("plugin", ["PNG", "WEBP", "JPEG", "HEIF"])
def test_an_image_is_one_page(plugin: str) -> None:
    noise = np.random.default_rng(3).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    file = make_file(noise, plugin)
    with open_pages([file], LIMITS) as pages:
        (page,) = pages
        assert (page.label, page.field, page.pixels) == ("", None, 2400)
        np.testing.assert_array_equal(page.decode().pixels, decode_image(file, ImageLimits()).pixels)


def test_of_an_animation_the_first_frame() -> None:
    assert len(pixels_of([several("WEBP", frames(), lossless=True)])) == 1


def test_reduced_views_and_masks_are_no_pages() -> None:
    """Some scanners write a small view of each page behind it."""
    views = frames((10, 20, 30, 40))
    for view, kind in zip(views[1:], (1, 4, 2), strict=True):
        view.encoderinfo = {"tiffinfo": {254: kind}}
    assert [int(image[0, 0, 0]) for image in pixels_of([several("TIFF", views)])] == [10, 40]


def test_a_page_of_a_pdf_as_it_is_printed() -> None:
    page = np.full((400, 300, 3), 255, np.uint8)
    page[10:60, 20:80] = (200, 30, 40)
    (found,) = pixels_of([encode_image(page, "pdf", 100, RENDER_DPI)])
    assert found.shape == (400, 300, 3)
    assert np.abs(found.astype(int) - page).mean() < 1


@pytest.mark.parametrize(
    ("unit", "factor"), [(2, 2.0), (0.5, 0.5), (None, 1.0), (0, 1.0), (-3, 1.0), (1e9, 1.0)]
)
@pytest.mark.parametrize("turn", [0, 90])
def test_a_page_has_its_size_by_user_unit_and_rotation(unit: float | None, factor: float, turn: int) -> None:
    buffer, document = io.BytesIO(), pikepdf.new()
    document.add_blank_page(page_size=(150, 200))
    page = document.pages[0].obj
    page["/Rotate"] = turn
    if unit is not None:
        page["/UserUnit"] = unit
    document.save(buffer)
    with open_pages([buffer.getvalue()], LIMITS) as pages:
        picture = pages[0].decode()
    assert picture.dpi is not None
    height, width = np.array(picture.pixels.shape[:2]) * 72 / picture.dpi
    expected = factor * np.array([150, 200] if turn == 0 else [200, 150])
    assert (width, height) == pytest.approx(expected, abs=0.3)


def set_in_type(
    text: str, *, lies_deg: float = 0.0, turn: int = 0, image: bool = False, mode: int = 0
) -> bytes:
    """A page of a PDF with lines of `text`, over an image of the whole page where there is one."""
    buffer, document = io.BytesIO(), pikepdf.new()
    document.add_blank_page(page_size=A4)
    page = document.pages[0]
    page.obj["/Rotate"] = turn
    font = {"/Type": "/Font", "/Subtype": "/Type1", "/BaseFont": "/Helvetica"}
    names = {key: pikepdf.Name(value) for key, value in font.items()}
    resources = pikepdf.Dictionary(Font=pikepdf.Dictionary(F1=pikepdf.Dictionary(names)))
    drawing = ""
    if image:
        picture = pikepdf.Stream(document, bytes(4))
        picture.update(
            {
                "/Type": pikepdf.Name("/XObject"),
                "/Subtype": pikepdf.Name("/Image"),
                "/Width": 2,
                "/Height": 2,
                "/ColorSpace": pikepdf.Name("/DeviceGray"),
                "/BitsPerComponent": 8,
            }
        )
        resources["/XObject"] = pikepdf.Dictionary(Im1=document.make_indirect(picture))
        drawing = "q 595 0 0 842 0 0 cm /Im1 Do Q "
    c, s = np.cos(np.radians(lies_deg)), np.sin(np.radians(lies_deg))
    lines = [text[k : k + 40] for k in range(0, len(text), 40)]
    for k, line in enumerate(lines):
        x, y = 300 + 14 * k * s, 421 - 14 * k * c
        drawing += (
            f"BT {mode} Tr /F1 10 Tf {c:.4f} {s:.4f} {-s:.4f} {c:.4f} {x:.1f} {y:.1f} Tm ({line}) Tj ET "
        )
    page.obj["/Resources"] = resources
    page.obj["/Contents"] = pikepdf.Stream(document, drawing.encode())
    document.save(buffer)
    return buffer.getvalue()


def origin_of(upload: bytes) -> Origin:
    with open_pages([upload], LIMITS) as pages:
        return pages[0].decode().origin


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
@pytest.mark.parametrize("lies_deg", [0, 90, 180, 270])
def test_a_page_that_is_set_in_type_says_which_way_it_lies(lies_deg: int, turn: int) -> None:
    """Text turns against the clock, a page with it."""
    expected = (lies_deg - turn) % 360
    found = origin_of(set_in_type("A line of words. " * 6, lies_deg=lies_deg, turn=turn))
    assert isinstance(found, TypesetPage)
    assert found.turn == expected


@pytest.mark.parametrize(("characters", "mode", "printed"), [(60, 0, False), (400, 0, True), (400, 3, False)])
def test_an_image_of_a_page_is_no_print_unless_text_is_shown_over_it(
    characters: int, mode: int, printed: bool
) -> None:
    upload = set_in_type("words and " * (characters // 10), image=True, mode=mode)
    assert isinstance(origin_of(upload), TypesetPage) == printed


def test_a_page_without_text_and_a_picture_are_not_print() -> None:
    assert origin_of(pdf(A4)) == "page"
    assert origin_of(make_file(np.zeros((8, 8), np.uint8), "PNG")) == "photo"


def test_pdfs_and_images_together() -> None:
    uploads = [
        pdf(A4, (842.0, 595.0)),
        make_file(np.zeros((9, 9, 3), np.uint8), "PNG"),
        several("TIFF", frames()),
    ]
    with open_pages(uploads, LIMITS) as pages:
        assert [(page.upload, page.page, page.label) for page in pages] == [
            (0, 0, "image[0], page 1"),
            (0, 1, "image[0], page 2"),
            (1, 0, "image[1]"),
            (2, 0, "image[2], page 1"),
            (2, 1, "image[2], page 2"),
            (2, 2, "image[2], page 3"),
        ]
        assert [page.decode().pixels.shape[:2] for page in pages[:2]] == [(2339, 1653), (1653, 2339)]


def test_large_pages_of_a_pdf_are_drawn_coarser() -> None:
    narrow = replace(LIMITS, image=ImageLimits(max_megapixels=0.25, max_side_px=1000))
    shapes = [image.shape[:2] for image in pixels_of([pdf(A4, (14400.0, 3.0), (3.0, 3.0))], narrow)]
    assert all(max(shape) <= 1000 and shape[0] * shape[1] < 0.26e6 for shape in shapes)
    assert shapes[0][0] / shapes[0][1] == pytest.approx(842 / 595, rel=0.01)


@pytest.mark.pipeline
@pytest.mark.parametrize(
    "make",
    [lambda: pdf(A4, count=10_000), lambda: several("TIFF", frames(range(30), (4, 4)))],
    ids=["PDF", "TIFF"],
)
def test_more_pages_than_a_document_may_have(make: Callable[[], bytes]) -> None:
    upload = make()
    error = refusal(TooLarge, upload)
    assert "20 pages (MAX_PAGES)" in error.detail
    assert error.field == "image"
    with open_pages([upload], LIMITS, only=25) as pages:
        assert [page.label for page in pages] == ["page 25"]
        assert pages[0].decode().pixels.shape[2] == 3


def test_pages_of_all_uploads_count() -> None:
    one = make_file(np.zeros((9, 9, 3), np.uint8), "PNG")
    assert len(pixels_of([one] * 3, replace(LIMITS, max_pages=3))) == 3
    assert "MAX_PAGES" in refusal(TooLarge, *[one] * 4, limits=replace(LIMITS, max_pages=3)).detail
    together = replace(LIMITS, max_megapixels=200e-6)
    assert "MAX_DOCUMENT_MEGAPIXELS" in refusal(TooLarge, *[one] * 3, limits=together).detail
    assert len(pixels_of([one], together)) == 1


def test_there_is_no_such_page() -> None:
    uploads = [pdf(A4), pdf(A4)]
    with (
        pytest.raises(InvalidOption, match="no page 3; the upload has 2") as caught,
        open_pages(uploads, LIMITS, 3),
    ):
        pass
    assert caught.value.field == "page"


def large_page(data: bytes) -> bytes:
    """The TIFF file with another directory behind it, whose page claims 30,000 x 30,000 pixels."""
    entries = [(256, 4, 1, 30_000), (257, 4, 1, 30_000), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1)]
    (first,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<H", data, first)
    following = first + 2 + 12 * count
    data += bytes(len(data) % 2)
    return (
        data[:following] + struct.pack("<I", len(data)) + data[following + 4 :] + pack_directory(entries)[8:]
    )


@pytest.mark.parametrize(
    ("upload", "error", "told"),
    [
        pytest.param(b"", UnsupportedMediaType, "empty", id="nothing"),
        pytest.param(b"hello", UnsupportedMediaType, "nor a PDF", id="text"),
        pytest.param(b"%PDF-1.7\n", UndecodableImage, "damaged", id="a header alone"),
        pytest.param(pdf(), UndecodableImage, "no page", id="pdf without a page"),
        pytest.param(pdf(A4, count=50)[:2000], UndecodableImage, "damaged", id="half a pdf"),
        pytest.param(
            pdf(A4, encryption=pikepdf.Encryption(owner="a", user="b")),
            UndecodableImage,
            "encrypted",
            id="encrypted pdf",
        ),
        pytest.param(
            large_page(make_file(np.zeros((9, 9), np.uint8), "TIFF")),
            TooLarge,
            "900.0 megapixels",
            id="tiff bomb",
        ),
        pytest.param(several("TIFF", frames())[:-200], UndecodableImage, "truncated", id="half a tiff"),
    ],
)
def test_what_cannot_be_read_is_refused(upload: bytes, error: type[DocumentError], told: str) -> None:
    assert told in refusal(error, upload).detail
    second = refusal(error, make_file(np.zeros((9, 9, 3), np.uint8), "PNG"), upload)
    assert second.field == "image[1]"
    assert second.detail.startswith("image[1]")


def test_a_page_that_is_damaged_is_named() -> None:
    file = bytearray(several("TIFF", frames(), compression="tiff_adobe_deflate"))
    with open_pages([bytes(file)], LIMITS) as pages:
        assert len(pages) == 3
    # The last strip lies before the last directory.
    with Image.open(io.BytesIO(file)) as picture:
        assert isinstance(picture, TiffImageFile)
        picture.seek(2)
        (strip,) = picture.tag_v2[273]
    file[strip : strip + 20] = bytes(20)
    error = refusal(UndecodableImage, bytes(file))
    assert error.detail.startswith("page 3: ")


def tiff_chain(directories: int, entries: int) -> bytes:
    """Directories that share their entries' bytes are not possible in a chain; these have `entries` each."""
    tags = [(256, 4, 1, 4), (257, 4, 1, 4), *((40_000 + tag, 4, 1, 0) for tag in range(entries - 2))]
    body = pack_directory(tags)[8:-4]
    following = [8 + number * (len(body) + 4) for number in range(1, directories)]
    chain = b"".join(body + struct.pack("<I", offset) for offset in [*following, 0])
    return b"II*\0" + struct.pack("<I", 8) + chain


def values_chain() -> bytes:
    """Two directories whose 300 tags each point at the same megabyte."""
    tags = [(256, 4, 1, 4), (257, 4, 1, 4), *((40_000 + tag, 1, 2**20, 8) for tag in range(300))]
    body = pack_directory(tags)[8:-4]
    second = 8 + len(body) + 4
    return b"II*\0" + struct.pack("<I", 8) + body + struct.pack("<I", second) + body + bytes(4 + 2**20)


@pytest.mark.pipeline
@pytest.mark.parametrize(
    "make", [lambda: tiff_chain(2000, 1000), values_chain], ids=["many entries", "many values"]
)
def test_directories_that_cost_are_refused(make: Callable[[], bytes]) -> None:
    many = replace(LIMITS, max_pages=100_000, image=ImageLimits(max_bytes=2**30))
    assert "larger than any writer" in refusal(UndecodableImage, make(), limits=many).detail


def test_a_chain_of_directories_that_bites_its_tail_ends() -> None:
    chain = bytearray(tiff_chain(3, 4))
    chain[-4:] = struct.pack("<I", 8)
    with open_pages([bytes(chain)], LIMITS) as pages:
        assert len(pages) == 3


def test_files_have_a_limit() -> None:
    narrow = replace(LIMITS, image=ImageLimits(max_bytes=500))
    for upload in (pdf(A4), several("TIFF", frames())):
        assert "limit is 500" in refusal(TooLarge, upload, limits=narrow).detail
