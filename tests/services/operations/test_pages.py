"""Both pages of an opened book, as they leave the worker."""

import base64
import io
import zipfile

import numpy as np
import pypdfium2
import pytest
from PIL import Image

from services.contract.images import Encoding, ImageLimits, PageReply
from services.contract.rectify import RectifyParameters
from services.errors import NotAcceptable
from tests.services.imaging.files import make_file
from tests.services.operations.documents import document_of
from tests.services.operations.pipelines import RectifyPipeline
from tests.services.operations.single_uploads import rectify_upload

PHOTO = np.random.default_rng(1).integers(0, 256, (40, 60, 3), dtype=np.uint8)
BOTH = RectifyParameters(pages="both")
SIZES = [(40, 60), (40, 30)]


def answer(encoding: Encoding, plugin: str = "PNG") -> PageReply:
    """To an upload of this format."""
    return rectify_upload(make_file(PHOTO, plugin), BOTH, encoding, ImageLimits())


def size_of(file: bytes) -> tuple[int, int]:
    """Of the image in it."""
    return Image.open(io.BytesIO(file)).size


@pytest.mark.usefixtures("pipeline")
def test_the_document_lists_the_pages() -> None:
    reply = answer(Encoding("json", embed=True, pages_format="json"))
    pages = document_of(reply)["pages"]
    assert isinstance(pages, list)
    assert [(page["width"], page["height"]) for page in pages] == SIZES
    assert [size_of(base64.b64decode(page["image"])) for page in pages] == SIZES
    stages = pages[0]["timings_ms"]
    assert (stages["text"], stages["remap"]) == (12.3, 3.0)
    assert document_of(reply)["warnings"] == [{"code": "of-all", "detail": "Of all pages."}]
    whole = document_of(reply)["timings_ms"]
    assert isinstance(whole, dict)
    assert list(whole) == ["decode", "text", "remap", "quality", "encode"]
    assert whole["text"] == pytest.approx(1.0 + 2 * 12.345, abs=0.1)
    assert (reply.body, reply.media_type) == (b"", "application/json")


@pytest.mark.usefixtures("pipeline")
def test_a_tiff_and_a_pdf_hold_both() -> None:
    reply = answer(Encoding("tiff", pages_format="tiff"))
    assert reply.media_type == "image/tiff"
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert picture.n_frames == 2  # type: ignore[attr-defined]
    reply = answer(Encoding())
    assert reply.media_type == "application/pdf"
    assert len(pypdfium2.PdfDocument(reply.body)) == 2


@pytest.mark.parametrize(("plugin", "name"), [("PNG", "png"), ("JPEG", "jpg"), ("HEIF", "jpg")])
@pytest.mark.usefixtures("pipeline")
def test_an_archive_has_images_in_the_uploads_format(plugin: str, name: str) -> None:
    reply = answer(Encoding("zip", pages_format="zip"), plugin)
    assert reply.media_type == "application/zip"
    with zipfile.ZipFile(io.BytesIO(reply.body)) as archive:
        assert archive.namelist() == [f"page-01.{name}", f"page-02.{name}"]
        assert [size_of(archive.read(file)) for file in archive.namelist()] == SIZES


@pytest.mark.usefixtures("pipeline")
def test_two_pages_do_not_go_into_one_image() -> None:
    with pytest.raises(NotAcceptable, match="pdf, tiff, zip or json"):
        answer(Encoding("jpeg", pages_format=None))


def test_a_single_page_does(pipeline: RectifyPipeline) -> None:
    pipeline.pages = 1
    reply = answer(Encoding("jpeg", pages_format=None))
    assert (reply.media_type, size_of(reply.body)) == ("image/jpeg", SIZES[0])
    pages = document_of(reply)["pages"]
    assert isinstance(pages, list)
    assert len(pages) == 1
    assert answer(Encoding(None, pages_format=None)).media_type == "image/png"
