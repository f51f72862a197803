"""The engine where it is installed, and an honest answer where it is not."""

import importlib.util
import logging
import sys
from pathlib import Path

import numpy as np
import pytest

from services.ocr import tesseract
from services.ocr.engine import BoundedReader, DirectionDetector, OcrEngine
from services.ocr.tesseract import (
    EngineUnavailable,
    TesseractEngine,
    default_language,
    find_tessdata,
    installed_languages,
    open_engine,
)
from tests.services.ocr.pages import blank, set_lines, text_of_line, text_page


def is_missing(engine: OcrEngine | None) -> bool:
    """True where there is no engine, and then for a reason."""
    if engine is None:
        assert importlib.util.find_spec("tesserocr") is None or find_tessdata("eng") is None
        return True
    return False


def test_line_is_read() -> None:
    engine = open_engine()
    if is_missing(engine):
        return
    assert engine is not None
    page = blank(700, 60)
    set_lines(page, (20, 10), 1, 30, words=6)
    text, confidence = engine.read_line(np.asarray(page, dtype=np.uint8))
    assert text.split() == text_of_line(0, 6).split()
    assert 0.8 < confidence <= 1.0
    upside_down = np.asarray(page, dtype=np.uint8)[::-1, ::-1]  # negative strides too
    assert engine.read_line(upside_down)[1] < confidence - 0.3


def test_page_is_read_with_boxes_in_its_own_pixels() -> None:
    engine = open_engine()
    if is_missing(engine):
        return
    assert engine is not None
    page = blank(900, 500)
    boxes = set_lines(page, (60, 60), 6, 28)
    words = engine.read_page(np.asarray(page, dtype=np.uint8))
    assert [word.text for word in words] == " ".join(text_of_line(line, 8) for line in range(6)).split()
    assert all(0.0 <= word.confidence <= 1.0 for word in words)
    first = words[0].box
    assert first[0] == pytest.approx(boxes[0][0], abs=4)
    assert first[1] == pytest.approx(boxes[0][1], abs=4)
    assert max(word.box[3] for word in words) == pytest.approx(boxes[-1][3], abs=8)
    assert [word.line for word in words] == sorted(8 * list(range(6)))
    assert isinstance(engine, BoundedReader)
    assert engine.read_page_within(np.asarray(page, dtype=np.uint8), 600.0) == (words, False)
    early, cut = engine.read_page_within(np.asarray(page, dtype=np.uint8), 0.0)
    assert cut
    assert len(early) < len(words)


@pytest.mark.pipeline
def test_direction_is_detected_where_its_data_is_installed() -> None:
    engine = open_engine()
    if is_missing(engine):
        return
    assert isinstance(engine, DirectionDetector)
    page = text_page(lines=9, height=600)
    for turns in range(4):
        direction = engine.detect_direction(np.rot90(page, -turns))
        if find_tessdata("osd") is None:
            assert direction is None
        else:
            assert direction is not None
            assert (direction.turned_deg, direction.script) == (90 * turns, "Latin")


@pytest.mark.parametrize("shape", [(1, 1), (2, 400), (400, 2), (36, 5), (60, 300)])
def test_blank_and_tiny_images_read_as_nothing(shape: tuple[int, int]) -> None:
    engine = open_engine()
    if is_missing(engine):
        return
    assert isinstance(engine, TesseractEngine)
    image = np.full(shape, 255, np.uint8)
    assert engine.read_line(image) == ("", 0.0)
    assert engine.read_page(image) == []
    assert engine.detect_direction(image) is None
    engine.close()
    assert engine.read_line(image) == ("", 0.0)


def test_noise_is_read_without_harm() -> None:
    engine = open_engine()
    if is_missing(engine):
        return
    assert engine is not None
    noise = np.random.default_rng(3).integers(0, 256, (36, 600), dtype=np.uint8)
    text, confidence = engine.read_line(noise)
    assert isinstance(text, str)
    assert 0.0 <= confidence < 0.6


def test_service_goes_without_the_library_and_says_so_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, "tesserocr", None)
    tesseract._tell_once.cache_clear()
    with caplog.at_level(logging.WARNING):
        assert open_engine() is None
        assert open_engine() is None
    (record,) = caplog.records
    assert "tesserocr" in record.getMessage()


def test_service_goes_without_language_data(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(tesseract, "find_tessdata", lambda language: None)
    monkeypatch.setitem(sys.modules, "tesserocr", sys)
    tesseract._tell_once.cache_clear()
    with caplog.at_level(logging.WARNING):
        assert open_engine() is None
    assert "eng.traineddata" in caplog.text
    with pytest.raises(EngineUnavailable, match="tesseract-ocr-deu"):
        TesseractEngine("deu")


@pytest.mark.parametrize("below", ["", "tessdata"])
def test_prefix_comes_before_the_usual_folders(
    below: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / below
    folder.mkdir(exist_ok=True)
    (folder / "eng.traineddata").touch()
    monkeypatch.setenv("TESSDATA_PREFIX", str(tmp_path))
    assert find_tessdata("eng") == folder
    assert find_tessdata("no-such-language") is None


def test_languages_are_those_whose_data_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tesseract, "_TESSDATA_FOLDERS", (str(tmp_path / "absent"),))
    monkeypatch.setenv("TESSDATA_PREFIX", str(tmp_path))
    assert installed_languages() == ()
    assert default_language() == "eng"
    for name in ("osd", "fra", "chi_sim"):
        (tmp_path / f"{name}.traineddata").touch()
    assert installed_languages() == ("chi_sim", "fra")
    assert default_language() == "chi_sim"
    assert find_tessdata("fra+chi_sim") == tmp_path
    assert find_tessdata("fra+deu") is None
