"""Several pages in one file: all there, in order, with pixels and resolution."""

import io
import json
import zipfile

import numpy as np
import pypdfium2
import pytest
from PIL import Image

from services.errors import InvalidOption
from services.imaging.codec import OutputFormat
from services.imaging.page_files import PagesFileFormat, archive_pages, bind_parts, encode_part

RNG = np.random.default_rng(4)
PAGES = [RNG.integers(0, 256, (height, width, 3), dtype=np.uint8) for height, width in ((40, 30), (25, 50))]


def bind(
    file_format: PagesFileFormat,
    image_format: OutputFormat = "jpeg",
    quality: int | None = None,
    dpi: float | None = None,
) -> bytes:
    """One file of both pages."""
    parts = [encode_part(page, file_format, image_format, quality, dpi) for page in PAGES]
    if file_format == "zip":
        return archive_pages([part.data for part in parts], image_format, [1, 2], [], "images")
    return bind_parts(parts, file_format)


def test_a_tiff_holds_every_page_losslessly() -> None:
    with Image.open(io.BytesIO(bind("tiff", dpi=200.0))) as picture:
        assert picture.n_frames == 2  # type: ignore[attr-defined]
        for number, page in enumerate(PAGES):
            picture.seek(number)
            assert np.array_equal(np.asarray(picture), page)
            assert picture.info["dpi"] == (200.0, 200.0)


def test_a_pdf_of_quality_100_holds_every_page_losslessly_at_its_size() -> None:
    file = bind("pdf", quality=100, dpi=100.0)
    document = pypdfium2.PdfDocument(file)
    assert len(document) == len(PAGES)
    for sheet, page in zip(document, PAGES, strict=True):
        assert sheet.get_size() == pytest.approx((page.shape[1] * 0.72, page.shape[0] * 0.72))
        (image,) = sheet.get_objects()
        assert np.array_equal(image.get_bitmap(render=False).to_numpy()[..., ::-1], page)


@pytest.mark.parametrize(("image_format", "suffix"), [("jpeg", "jpg"), ("png", "png"), ("tiff", "tif")])
def test_an_archive_has_an_image_a_page(image_format: OutputFormat, suffix: str) -> None:
    file = bind("zip", image_format)
    with zipfile.ZipFile(io.BytesIO(file)) as archive:
        assert archive.namelist() == [f"page-01.{suffix}", f"page-02.{suffix}"]
        sizes = [Image.open(io.BytesIO(archive.read(name))).size for name in archive.namelist()]
    assert sizes == [(30, 40), (50, 25)]
    assert file == bind("zip", image_format)


def test_an_archive_has_json_files_of_all_pages_also_of_failed_ones() -> None:
    documents = [{"width": 3, "mesh": [[0.5, None]]}, {"problem": {"code": "no-text"}}]
    for content, names in (
        ("json", ["page-01.json", "page-02.json"]),
        ("both", ["page-01.png", "page-01.json", "page-02.json"]),
    ):
        with zipfile.ZipFile(
            io.BytesIO(archive_pages([b"image"], "png", [1], documents, content))
        ) as archive:
            assert archive.namelist() == names
            assert [json.loads(archive.read(f"page-0{n}.json")) for n in (1, 2)] == documents
        assert archive_pages([b"image"], "png", [1], documents, content) == archive_pages(
            [b"image"], "png", [1], documents, content
        )


def test_a_quality_out_of_range_is_refused() -> None:
    with pytest.raises(InvalidOption, match="quality"):
        bind("zip", "jpeg", quality=101)
