"""A read page: its text in JSON, in text files and under the picture of a PDF."""

import json

import numpy as np
import pypdfium2
import pytest

from services.contract.images import Encoding, ImageLimits, PageReply, TextFormat
from services.contract.rectify import RectifyParameters
from services.deadline import answered_within, time_left_s
from services.errors import InvalidOption
from services.layout.page import Page, Zone, ZoneWord
from services.ocr.engine import Word
from services.ocr.word_trust import probability_right
from services.operations import page_reading
from tests.services.imaging.files import make_file
from tests.services.operations.documents import document_of
from tests.services.operations.pipelines import RectifyPipeline, reject_constant
from tests.services.operations.single_uploads import rectify_upload

PHOTO = np.full((600, 800, 3), 255, np.uint8)
READ = RectifyParameters(text=True)
WORDS = [Word("Dear", (100, 100, 180, 130), 0.9), Word("Smith", (200, 100, 300, 130), 0.8)]


class Reader:
    """Reads the same words on every page."""

    def read_page(self, image: np.ndarray) -> list[Word]:
        """The words, and one without extent, which is left out."""
        return [*WORDS, Word("none", (5, 5, 5, 9), 0.9)]


@pytest.fixture(autouse=True)
def reader(pipeline: RectifyPipeline, monkeypatch: pytest.MonkeyPatch) -> None:
    """The engine of this module."""
    monkeypatch.setattr(page_reading, "ocr_engine", lambda language: Reader())


def read(encoding: Encoding, parameters: RectifyParameters = READ) -> PageReply:
    """The reply to a white photo."""
    return rectify_upload(make_file(PHOTO, "PNG"), parameters, encoding, ImageLimits())


def test_json_has_the_words_in_both_frames() -> None:
    document = json.loads(json.dumps(document_of(read(Encoding("json")))), parse_constant=reject_constant)
    text = document["text"]
    believed = (4 * probability_right(0.9) + 5 * probability_right(0.8)) / 9
    assert (text["language"], text["confidence"]) == ("eng", pytest.approx(believed, abs=1e-4))
    assert [word["text"] for word in text["words"]] == ["Dear", "Smith"]
    assert text["words"][1]["box"] == [200, 100, 300, 130]
    assert text["words"][1]["line"] == 0
    assert text["words"][1]["photo"] == [[0.33, 0.32], [0.5, 0.27], [0.5, 0.3], [0.33, 0.35]]
    assert "reading" in document["timings_ms"]


def test_zones_that_miss_most_words_do_not_order_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three words in two lines, the zones hold the last one only; it would come first."""
    below = Word("Bell", (100, 200, 180, 230), 0.9)
    held = Zone("z0", (90, 190, 190, 240), words=(ZoneWord(below.text, below.box, 0.9, 0),), text="Bell")
    page = Page(800, 600, (held,))
    monkeypatch.setattr(page_reading, "segment_read_page", lambda *given: (page, [*WORDS, below], False))
    document = document_of(read(Encoding("json")))
    assert [word["text"] for word in document["text"]["words"]] == ["Dear", "Smith", "Bell"]  # type: ignore[index]


@pytest.mark.parametrize("cut", [True, False])
def test_a_page_that_was_not_read_to_its_end_has_a_warning(
    monkeypatch: pytest.MonkeyPatch, cut: bool
) -> None:
    monkeypatch.setattr(
        page_reading, "segment_read_page", lambda *given: (Page(800, 600, ()), list(WORDS), cut)
    )
    document = document_of(read(Encoding("json")))
    assert [word["text"] for word in document["text"]["words"]] == ["Dear", "Smith"]  # type: ignore[index]
    codes = [warning["code"] for warning in document["warnings"]]  # type: ignore[attr-defined]
    assert ("reading-cut" in codes) == cut


def test_reading_leaves_time_for_what_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    left_s: list[float] = []

    def segment(*given: object) -> tuple[Page, list[Word], bool]:
        left_s.append(time_left_s())
        return Page(800, 600, ()), list(WORDS), False

    monkeypatch.setattr(page_reading, "segment_read_page", segment)
    with answered_within(100.0):
        read(Encoding("json"))
    assert 0.0 < left_s[0] <= 100.0 * page_reading.SHARE_OF_TIME


def test_without_the_option_nothing_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_reading, "ocr_engine", None)
    assert document_of(read(Encoding("json"), RectifyParameters()))["text"] is None


def test_a_pdf_can_be_searched() -> None:
    reply = read(Encoding("pdf", title="Letter"))
    document = pypdfium2.PdfDocument(reply.body)
    assert document[0].get_textpage().get_text_range().split() == ["Dear", "Smith"]
    assert document.get_metadata_value("Title") == "Letter"


@pytest.mark.parametrize(
    ("text_format", "media_type", "start"),
    [
        ("txt", "text/plain", b"Dear Smith\n"),
        ("markdown", "text/markdown", b"Dear Smith\n"),
        ("hocr", "text/vnd.hocr+html", b"<?xml"),
        ("alto", "application/alto+xml", b"<?xml"),
    ],
)
def test_text_files(text_format: TextFormat, media_type: str, start: bytes) -> None:
    reply = read(Encoding(text_format, pages_format=text_format))
    assert reply.media_type == media_type
    assert reply.body.startswith(start)
    both = RectifyParameters(text=True, pages="both")
    several = read(Encoding(text_format, pages_format=text_format), both)
    assert several.body.count(b"Smith") == 2


def test_without_an_engine_the_request_is_refused(
    pipeline: RectifyPipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_reading, "ocr_engine", lambda language: None)
    with pytest.raises(InvalidOption, match="no OCR engine"):
        read(Encoding("json"))
    assert pipeline.calls == []  # before any work


def test_a_language_that_is_not_installed_is_refused_with_those_that_are(
    pipeline: RectifyPipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_reading, "installed_languages", lambda: ("deu", "eng"))
    for parameters in (RectifyParameters(language="eng+xyz"), RectifyParameters(text=True, language="xyz")):
        with pytest.raises(
            InvalidOption, match="xyz is not installed on this server; installed are deu, eng"
        ) as told:
            read(Encoding("json"), parameters)
        assert told.value.field == "language"
    with pytest.raises(InvalidOption, match=r"Did you mean 'deu'\?"):
        read(Encoding("json"), RectifyParameters(language="DEU"))
    assert pipeline.calls == []
    text = document_of(read(Encoding("json"), RectifyParameters(text=True, language="deu+eng")))["text"]
    assert text["language"] == "deu+eng"  # type: ignore[index]
