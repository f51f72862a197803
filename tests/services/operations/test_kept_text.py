"""The text of kept pages: read once, on the part that the page shows, in the language that is asked for."""

import io
import zipfile
from dataclasses import replace
from typing import Any

import numpy as np
import pikepdf
import pytest

from services.contract.images import Encoding, ImageLimits
from services.contract.kept_pages import KeptPage, PageReading, PageWish
from services.contract.mosaic import MosaicLimits, MosaicParameters
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.imaging.codec import encode_image
from services.imaging.page_images import PagePicture
from services.ocr.engine import Word
from services.operations import kept_pages, kept_text
from services.operations.kept_pages import bind_kept_pages, render_kept_page
from services.operations.mosaic import mosaic_uploads
from services.operations.rectify import describe_page
from services.rectify.kept_photo import keep_photo
from services.text.page_text import PageText, ReadLine, TextBlock
from tests.services.imaging.files import make_file

WORD = Word("Dear", (10.0, 20.0, 30.0, 26.0), 0.9)
ENGLISH = PageReading("eng")


@pytest.fixture
def readings(monkeypatch: pytest.MonkeyPatch) -> list[tuple[tuple[int, ...], str]]:
    """Shape and language of each page that is read; one word is read on each."""
    done: list[tuple[tuple[int, ...], str]] = []

    def read(view: Any, engine: object, language: str, mesh: Any, printed: object) -> PageText:
        done.append((view.shape[:2], language))
        blocks = (TextBlock((ReadLine((WORD,)),)),)
        return PageText(view.shape[1], view.shape[0], language, blocks, ((((0, 0),) * 4),))  # type: ignore[arg-type]

    monkeypatch.setattr(kept_text, "read_flat_page", read)
    monkeypatch.setattr(kept_text, "reading_engine", lambda language: (None, language or "eng"))
    return done


def kept_page() -> KeptPage:
    """A photo of 80 x 60 pixels that is the page itself."""
    pixels = np.full((60, 80, 3), 200, np.uint8)
    photo = PagePicture(pixels, None, "png", original=encode_image(pixels, "png"))
    asked = RectifyParameters(keep_photo=True)
    kept = describe_page(keep_photo(pixels, NoText("nothing is seen.")), asked, Encoding("json"), photo).kept
    assert kept is not None
    return kept


def render(kept: KeptPage, encoding: str = "json", **wish: Any) -> tuple[Any, KeptPage]:
    """The answer with text, and the page as it is kept then."""
    reply, changed = render_kept_page(kept, PageWish(**wish), Encoding(encoding), ENGLISH)  # type: ignore[arg-type]
    return reply, KeptPage(changed.bundle or kept.bundle, changed.document)


def test_a_page_is_read_once_for_each_part_and_language(readings: list[Any]) -> None:
    reply, kept = render(kept_page())
    assert [word.text for word in reply.answer.text.words] == ["Dear"]
    again, kept = render(kept, illumination="bw")
    assert again.answer.text.words[0].box == WORD.box
    photo = again.answer.text.words[0].photo
    np.testing.assert_allclose(photo[0], (10, 20), atol=0.6)
    bind_kept_pages([kept, kept], Encoding("pdf"), ENGLISH)
    assert readings == [((60, 80), "eng")], "the look does not count"
    _, kept = render(kept, rotate=90)
    assert readings[1:] == [((80, 60), "eng")]
    bind_kept_pages([kept], Encoding("txt", pages_format="txt"), PageReading("deu"))
    assert readings[2:] == [((80, 60), "deu")]


def test_a_smaller_picture_has_its_words_where_they_are(readings: list[Any]) -> None:
    _, kept = render(kept_page())
    reply, _ = render_kept_page(kept, PageWish(), Encoding("json", max_width=40), ENGLISH)
    assert reply.answer.text is not None
    assert reply.answer.text.words[0].box == (5.0, 10.0, 15.0, 13.0)
    assert len(readings) == 1


def test_files_have_the_text_only_where_it_is_asked_for(readings: list[Any]) -> None:
    _, kept = render(kept_page())
    text = bind_kept_pages([kept, kept], Encoding("txt", pages_format="txt"), ENGLISH)
    assert text.body.decode().split() == ["Dear", "Dear"]
    searchable, plain = (bind_kept_pages([kept], Encoding("pdf"), asked).body for asked in (ENGLISH, None))
    fonts = []
    for body in (searchable, plain):
        with pikepdf.open(io.BytesIO(body)) as document:
            fonts.append("/Font" in document.pages[0].get("/Resources", {}))
    assert fonts == [True, False]
    assert len(readings) == 1


def test_a_file_takes_the_picture_as_it_is_kept(readings: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """That of an answer of usual quality, as long as a page is shown as it was found."""
    _, kept = render(kept_page())
    with zipfile.ZipFile(io.BytesIO(kept.bundle)) as bundle:
        picture = bundle.read("picture.jpg")
    drawn: list[object] = []
    draw = kept_pages.draw_kept
    monkeypatch.setattr(kept_pages, "draw_kept", lambda *given: drawn.append(given) or draw(*given))
    file = bind_kept_pages([kept, kept], Encoding("pdf", pages_format="pdf"), ENGLISH)
    with pikepdf.open(io.BytesIO(file.body)) as document:
        pictures = [next(iter(page.Resources.XObject.values())) for page in document.pages]
        assert [each.read_raw_bytes() for each in pictures] == [picture] * 2
        assert all("/Font" in page.get("/Resources", {}) for page in document.pages)
    assert not drawn
    assert file.answer.pages[0].width == 80  # type: ignore[union-attr]
    others = (Encoding("pdf", quality=50), Encoding("pdf", max_width=40), Encoding("tiff"))
    for encoding in others:
        bind_kept_pages([kept], encoding, ENGLISH)
    _, turned = render(kept, rotate=180)
    _, gray = render(kept, illumination="gray")
    _, even = render(kept, illumination="normalize")
    before = len(drawn)
    for page in (turned, gray, even):
        bind_kept_pages([page], Encoding("pdf"), ENGLISH)
    assert len(drawn) == before + len((turned, gray, even))
    assert before == len(others) + len((turned, gray, even)), "what differs is drawn"


@pytest.mark.usefixtures("mosaic_pipeline")
def test_a_mosaic_is_kept_as_a_page_of_its_own() -> None:
    photos = [np.full((40, 60, 3), 40 * place, np.uint8) for place in (3, 4)]
    uploads = [make_file(photo, "PNG") for photo in photos]
    asked = MosaicParameters(upright=False, keep_photo=True)
    reply = mosaic_uploads(uploads, asked, Encoding("json", max_width=30), MosaicLimits(ImageLimits(), 200))
    (kept,) = reply.kept
    assert kept is not None
    turned, _ = render_kept_page(kept, PageWish(rotate=90, illumination="gray"), Encoding("json"))
    assert (turned.answer.width, turned.answer.height) == (40, 60), "it is as large as the mosaic"
    assert turned.answer.warnings == []
    not_kept = mosaic_uploads(
        uploads, replace(asked, keep_photo=False), Encoding(), MosaicLimits(ImageLimits(), 200)
    )
    assert not_kept.kept == (None,)
