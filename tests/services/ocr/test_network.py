"""The second reader: rows of marks, words of scripted networks, and the real ones on a small receipt."""

from importlib.util import find_spec
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

from services.ocr import network
from services.ocr.network import LINE_PX, Mark, NetworkReader, arrange_rows
from services.ocr.tesseract import TesseractEngine
from services.ocr.word_trust import probability_right

INSTALLED = find_spec("onnxruntime") is not None and find_spec("rapidocr") is not None
LETTERS = "ab漢"


def test_parts_of_a_row_are_one_line_and_columns_are_two() -> None:
    # A name and its price, 3 px lower; then the next row.
    rows = arrange_rows([Mark(300, 53, 40, 20), Mark(100, 50, 120, 20), Mark(100, 80, 120, 20)])
    assert [[mark.x for mark in row] for row in rows] == [[100, 300], [100]]
    # Two columns of prose.
    prose = [Mark(x, y, 400, 20) for y in (50, 80, 110) for x in (210, 650)]
    assert [len(row) for row in arrange_rows(prose)] == [1] * 6
    # A row aslant goes on where it ends, not at the height of its middle.
    slope = np.tan(np.deg2rad(4))
    aslant = [
        Mark(200, 100, 300, 20, 4.0),
        Mark(450, 100 + 250 * slope, 150, 20, 4.0),
        Mark(450, 100, 150, 20),
    ]
    assert sorted(len(row) for row in arrange_rows(aslant)) == [1, 2]
    assert arrange_rows([]) == []


class Detector:
    """Marks the dark rectangles of a page."""

    runs = 0

    def run(self, _: None, inputs: dict[str, np.ndarray]) -> list[np.ndarray]:
        self.runs += 1
        (picture,) = inputs.values()
        return [(picture[:, :1] < 0).astype(np.float32)]


class Recognizer:
    """Reads "ab b" in every line, the last letter with a probability of 0.4; a step is 8 px wide."""

    widths: tuple[int, ...] = ()

    def run(self, _: None, inputs: dict[str, np.ndarray]) -> list[np.ndarray]:
        (picture,) = inputs.values()
        self.widths = (*self.widths, picture.shape[3])
        assert picture.shape[:3] == (1, 3, LINE_PX)
        steps = picture.shape[3] // 8
        scores = np.zeros((1, steps, 2 + len(LETTERS)), np.float32)
        # Blank, a, b, Chinese, space. The a lasts over two steps and is one letter.
        read = {1: 1, 2: 1, 4: 2, steps // 2: 4, steps - 2: 2}
        for step in range(steps):
            scores[0, step, read.get(step, 0)] = 0.4 if step == steps - 2 else 1.0
        # Likelier than the letter, but of another script.
        scores[0, steps - 2, 3] = 0.6
        return [scores]

    def get_modelmeta(self) -> SimpleNamespace:
        return SimpleNamespace(custom_metadata_map={"character": "\n".join(LETTERS)})


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> tuple[NetworkReader, Detector, Recognizer]:
    detector, recognizer = Detector(), Recognizer()
    monkeypatch.setattr(network, "_model", lambda name: name)
    monkeypatch.setattr(
        network, "_session", {network._DETECTOR: detector, network._RECOGNIZER: recognizer}.get
    )
    return NetworkReader(), detector, recognizer


def page_of_bars() -> np.ndarray:
    """Two rows; the upper one has a gap in its middle, where the words part."""
    page = np.full((320, 640), 255, np.uint8)
    page[100:124, 60:260] = page[100:124, 300:500] = 0
    page[200:224, 60:260] = 0
    return page


def test_letters_of_the_steps_are_words_on_the_page(
    scripted: tuple[NetworkReader, Detector, Recognizer],
) -> None:
    words, cut = scripted[0].read_page_within(page_of_bars(), 100.0)
    assert not cut
    assert [(word.text, word.line) for word in words] == [("ab", 0), ("b", 0)] * 2 + [("ab", 1), ("b", 1)]
    x0, y0, _, y1 = words[0].box
    assert (x0, y0, y1) == pytest.approx((60, 100, 124), abs=3)
    assert words[-1].box[2] == pytest.approx(260, abs=3)
    # The words part where the space was read.
    assert words[0].box[2] == pytest.approx(words[1].box[0], abs=15)
    sure, unsure = (probability_right(word.confidence) for word in words[:2])
    assert 0.97 < sure < 0.99
    assert 0.3 < unsure < 0.55


def test_what_cannot_end_in_time_is_not_begun(
    scripted: tuple[NetworkReader, Detector, Recognizer], monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, detector, recognizer = scripted
    assert reader.read_page_within(page_of_bars(), 0.001) == ([], True)
    assert detector.runs == 0
    # Marking takes 1 s of a clock that stands still otherwise; the lines would take some more.
    clock = iter([0.0, 1.0])
    monkeypatch.setattr("services.ocr.network.time.process_time", lambda: next(clock))
    assert reader.read_page_within(page_of_bars(), 1.05) == ([], True)
    assert (detector.runs, recognizer.widths) == (1, ())


@pytest.mark.parametrize("shape", [(1, 1), (4, 900), (900, 4)])
def test_pages_of_any_shape(
    scripted: tuple[NetworkReader, Detector, Recognizer], shape: tuple[int, int]
) -> None:
    assert scripted[0].read_page_within(np.full(shape, 255, np.uint8), 100.0) == ([], False)
    words, _ = scripted[0].read_page_within(np.zeros(shape, np.uint8), 100.0)
    assert all(np.isfinite(word.box).all() for word in words)


def test_it_assists_in_its_languages_and_is_missed_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(network, "find_spec", lambda name: None)
    network.open_network.cache_clear()
    try:
        english, others = TesseractEngine.__new__(TesseractEngine), TesseractEngine.__new__(TesseractEngine)
        english._language, others._language = "eng+fra", "eng+rus"
        assert others.second_reader() is None
        assert not caplog.messages
        assert english.second_reader() is None
        assert english.second_reader() is None
        assert len(caplog.messages) == 1
        assert "rapidocr" in caplog.text
    finally:
        network.open_network.cache_clear()


def receipt() -> np.ndarray:
    """A receipt of dots, as a matrix printer makes them, faint."""
    page = Image.new("L", (420, 330), 255)
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(26)
    for number, (name, price) in enumerate(
        (("COFFEE BEANS", "12.40"), ("GREEN TEA", "7.95"), ("TOTAL", "20.35"))
    ):
        draw.text((30, 60 + 70 * number), name, fill=0, font=font)
        draw.text((310, 60 + 70 * number), price, fill=0, font=font)
    gray = np.asarray(page, np.float64)
    dots = (np.indices(gray.shape) % 3 > 0).all(axis=0)
    return np.asarray(cv2.GaussianBlur(255 - (255 - gray) * dots * 0.6, (0, 0), 0.7), np.uint8)


@pytest.mark.skipif(not INSTALLED, reason="the packages of the second reader are left out")
def test_a_receipt_of_dots_is_read() -> None:
    reader = network.open_network()
    assert reader is not None
    words, _ = reader.read_page_within(receipt(), 100.0)
    lines = [" ".join(word.text for word in words if word.line == number) for number in range(3)]
    assert lines == ["COFFEE BEANS 12.40", "GREEN TEA 7.95", "TOTAL 20.35"]
    total = words[-1]
    assert total.box == pytest.approx((312, 205, 378, 226), abs=6)
    assert probability_right(total.confidence) > 0.8
