"""The language that OCR reads in pages and samples: that of the request, else that of the service."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from services.arrays import GrayImage
from services.contract.layout import LayoutOptions, LayoutSettings
from services.errors import InvalidOption
from services.ocr.engine import Word
from services.operations import layout, layout_models, page_reading
from services.operations.layout import recognize_upload
from services.operations.layout_documents import recognize_uploads
from services.operations.layout_models import measure_sample
from simulation.labelled_pages import letter_page
from tests.services.imaging.files import make_file
from tests.services.operations.documents import document_of as as_json_of

SETTINGS = LayoutSettings()
LETTER = {
    "deu": (
        "Sehr geehrte Frau Bell,",
        "vielen Dank für Ihr Schreiben, das wir mit der Post und nicht als Fax",
    ),
    None: (
        "Schr gcchrtc Frou Bcll,",
        "viclcn Dunk fiir lhr Schrcibcn, dus wir mlt dor Past uncl nlcht ols Fux",
    ),
}
"""Lines of a letter as they are read in German, and in the default language."""


class Linguist:
    """An engine that reads one letter, whatever it sees: its words right only in its own language."""

    name = "linguist"

    def __init__(self, language: str | None) -> None:
        self.lines = LETTER[language]

    def read_page(self, image: GrayImage) -> list[Word]:
        rows = ((40.0, self.lines[0]), (120.0, self.lines[1]))
        return [
            Word(word, (20.0 + 60 * place, top, 70.0 + 60 * place, top + 20), 0.9)
            for top, line in rows
            for place, word in enumerate(line.split())
        ]

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        return "", 0.0


@pytest.fixture
def linguist(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers whose engine reads German if it is named."""
    monkeypatch.setattr(page_reading, "installed_languages", lambda: ("deu", "eng"))
    for module in (layout, layout_models):
        monkeypatch.setattr(module, "ocr_engine", Linguist)


def lines_of_print() -> bytes:
    """A page (600 x 1000 px) with print where the linguist's words are."""
    pixels = np.full((600, 1000, 3), 255, np.uint8)
    for word in Linguist("deu").read_page(np.zeros((1, 1), np.uint8)):
        x0, _, _, y1 = map(int, word.box)
        cv2.putText(pixels, "nmen", (x0, y1), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 0), 2)
    return make_file(pixels, "PNG")


@pytest.mark.usefixtures("linguist")
def test_words_of_the_named_language_make_content_features() -> None:
    pages = {}
    for language in (None, "deu"):
        reply = recognize_upload(lines_of_print(), None, None, [], LayoutOptions(language=language), SETTINGS)
        pages[language] = reply.answer
    assert pages["deu"].language == "deu"
    greeting = next(zone for zone in pages["deu"].zones if zone.text.startswith("Sehr geehrte"))
    assert greeting.content["greeting"] > 0.5
    assert not any(zone.content.get("greeting", 0) > 0.2 for zone in pages[None].zones)


@pytest.mark.usefixtures("linguist")
def test_a_sample_is_read_in_the_language_of_the_service() -> None:
    zones = {
        "width": 1000,
        "height": 600,
        "zones": [{"id": "a", "box": [10, 30, 300, 70], "label": "salutation"}],
    }
    for language, text in (("deu", "Sehr geehrte Frau Bell,"), (None, "Schr gcchrtc Frou Bcll,")):
        sample = measure_sample(
            lines_of_print(), json.dumps(zones).encode(), replace(SETTINGS, language=language)
        )
        assert sample["zones"][0]["text"] == text  # type: ignore[index]
    with pytest.raises(InvalidOption, match="xyz is not installed"):
        measure_sample(lines_of_print(), json.dumps(zones).encode(), replace(SETTINGS, language="xyz"))


@pytest.mark.usefixtures("linguist")
def test_a_language_that_is_not_installed_is_refused_before_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layout, "fine_page", None)
    monkeypatch.setattr(layout, "rectify", None)
    for options in (
        LayoutOptions(language="deu+xyz"),
        LayoutOptions(language="xyz", ocr=False, rectify=True),
    ):
        for images in ([lines_of_print()], [lines_of_print()] * 2):
            with pytest.raises(
                InvalidOption, match="xyz is not installed on this server; installed are deu, eng"
            ) as told:
                recognize_uploads(images, None, None, [], options, SETTINGS)
            assert told.value.field == "language"
    page = letter_page(np.random.default_rng(2), draw=False).document()
    # Zones alone are not read, so that an operator's default language does not matter.
    reply = recognize_upload(
        None, json.dumps(page).encode(), None, [], LayoutOptions(language="xyz"), SETTINGS
    )
    assert as_json_of(reply)["language"] is None
