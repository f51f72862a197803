"""A second reader, for pages that Tesseract reads poorly: two small networks (PP-OCRv6) on onnxruntime.

The first marks text on the page, the second reads it line by line. The models lie in the wheel of `rapidocr`, whose
code is not imported: it would bring seven more packages and take a quarter more processor time. Nothing is loaded
before the first page is read.
"""

import functools
import logging
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.ocr.engine import Word
from services.ocr.word_trust import WordTrust, confidence_for, probability_right

_log = logging.getLogger(__name__)

LANGUAGES = frozenset({
    "dan", "deu", "eng", "est", "fin", "fra", "hun", "ind", "ita", "nld", "nor", "pol", "por", "ron", "slv",
    "spa", "swe",
})  # fmt: skip
"""Languages, by Tesseract's names, that it reads: of clean pages of 420 x 595 px at most 0.2 % of characters are wrong.
Left out: cat, hrv, isl, lit, lav, tur (0.3 to 1.5), ces (2), slk (7), vie (14), and all that are not Latin."""
_FIRST_ELSEWHERE = "\u2e80"
"""First letter of the Chinese script, which the networks read too."""
_DETECTOR, _RECOGNIZER = "PP-OCRv6_det_small.onnx", "PP-OCRv6_rec_small.onnx"
DETECTION_SIDE_PX = 1280
"""Longer side of the picture in which text is marked. Receipts and photos read 96.3 and 96.5 % of characters at 960 px,
96.5 and 96.9 at 1280; photos 97.0 at 1600, for 1.7 times the processor time of detection."""
_MULTIPLE_PX = 32
"""What the sides of that picture are multiples of."""
_IS_TEXT, _IS_LINE = 0.3, 0.5
"""Least probability of a pixel in a mark, and of a mark in the mean; like the next, those of the models' authors."""
_GROWTH = 1.6
"""The marks are narrower than the print: they grow by this times area over perimeter on each side."""
_LEAST_MARK_PX = 3.0
LINE_PX = 48
"""Height of the line crops."""
_SHORTEST_PX, _LONGEST_PX = 16, 4800
"""Bounds of their width: the longest line of a page is 100 heights."""
LEVEL = 0.5
"""Marks are level, parts of one row, if their facing ends differ by less than this of the lower one's height."""
COLUMN_WIDTH = 8.0
"""In heights: a part of a row that is wider may be a line of a column of prose."""
MOST_COLUMNS = 0.3
"""Where more of the neighbours in rows are both so wide, the page has columns, and each mark is a line: of photos with
columns 0.63 to 0.92 are, of 15 receipts none."""
PACE_S = 2e-6
"""Processor time a pixel that marking text may take: twice what it takes on the machine of the benchmarks."""
RECOGNITION_PACE = 1.5
"""Processor time of recognition a pixel of the crops, in times of what marking took; 1.3 to 1.45 on 64 pages."""
TRUST = WordTrust(-0.06, 0.77, 0.94)
"""Calibration of the product of a word's letters' probabilities, learned on 11,700 words of development receipts and
photos: expected calibration error 1.6 and 0.9 %, log loss 0.205 on receipts. Their mean and their least say
less (0.229 and 0.209)."""


@dataclass(frozen=True, slots=True)
class _Crop:
    """A line, upright and `LINE_PX` high, and the affine map (2, 3) from its pixels to the page's."""

    picture: GrayImage
    to_page: NDArray[np.float64]


@functools.cache
def open_network() -> "NetworkReader | None":
    """The reader of this process, loaded at the first call; None (logged) where its packages are not installed."""
    try:
        return NetworkReader()
    except (ImportError, OSError) as error:
        _log.warning("Pages that read poorly are not read by the second reader: %s.", error)
        return None


class NetworkReader:
    """`SecondReader` over the two networks; one thread, 1.7 CPU s a receipt, 3 a page of prose.

    Raises
    ------
    ImportError
        When `onnxruntime` or `rapidocr` is not installed.
    OSError
        When the wheel of `rapidocr` has no such models.
    """

    def __init__(self) -> None:
        self._detector, self._recognizer = (_session(_model(name)) for name in (_DETECTOR, _RECOGNIZER))
        letters = self._recognizer.get_modelmeta().custom_metadata_map["character"].splitlines()
        # Between a blank, which divides letters, and the space. Of all others the likeliest of these scripts is read.
        letters = ["", *letters, " "]
        self._columns = [index for index, letter in enumerate(letters) if letter < _FIRST_ELSEWHERE]
        self._letters = [letters[index] for index in self._columns]

    def read_page_within(self, image: GrayImage, seconds: float) -> tuple[list[Word], bool]:
        """See `SecondReader`: words from the top down, boxes in pixels of `image` (H, W) uint8.

        All words or none: what cannot be ended in time is not begun.
        """
        begun_s = time.process_time()
        size = _detection_size(image)
        if PACE_S * size[0] * size[1] > seconds:
            return [], True
        rows = self._rows(image, size)
        spent_s = time.process_time() - begun_s
        pace_s = spent_s / (size[0] * size[1])
        pixels = sum(crop.picture.size for row in rows for crop in row)
        if RECOGNITION_PACE * pace_s * pixels > seconds - spent_s:
            return [], True
        return [
            replace(word, line=number)
            for number, row in enumerate(rows)
            for crop in row
            for word in self._read(crop)
        ], False

    def _rows(self, image: GrayImage, size: tuple[int, int]) -> list[list[_Crop]]:
        """Crops of the lines of a page, from the top down, each of one mark or of several from left to right."""
        height, width = image.shape
        small = cv2.resize(image, size, interpolation=cv2.INTER_AREA if size[0] < width else cv2.INTER_LINEAR)
        probability = self._detector.run(None, {"x": _input(np.asarray(small, np.uint8))})[0][0, 0]
        marks = [mark.scaled(width / size[0], height / size[1]) for mark in _marks(probability)]
        return [[_cut(image, mark) for mark in row] for row in arrange_rows(marks)]

    def _read(self, crop: _Crop) -> Iterator[Word]:
        """Words of a line, without its number."""
        scores = self._recognizer.run(None, {"x": _input(crop.picture)})[0][0][:, self._columns]
        best, sure = scores.argmax(axis=1), scores.max(axis=1)
        step = crop.picture.shape[1] / len(best)
        # A letter that stays the best over several steps is one.
        begins = np.flatnonzero((best != 0) & (best != np.concatenate([[0], best[:-1]])))
        text, left, certainty = "", 0.0, 1.0
        ink = _ink(crop.picture)
        for index in [*begins.tolist(), None]:
            letter = " " if index is None else self._letters[best[index]]
            right = crop.picture.shape[1] if index is None else (index + 0.5) * step
            if not letter.isspace():
                text, certainty = text + letter, certainty * float(sure[index])
                continue
            if text:
                probability = probability_right(certainty, TRUST)
                yield Word(text, _page_box(crop, ink, left, right), confidence_for(probability))
            text, left, certainty = "", right, 1.0


def _model(name: str) -> Path:
    wheel = find_spec("rapidocr")
    if wheel is None or not wheel.submodule_search_locations:
        raise ImportError("the package rapidocr, which brings its models, is not installed")
    return Path(wheel.submodule_search_locations[0]) / "models" / name


def _session(model: Path) -> Any:
    if not model.is_file():
        raise OSError(f"{model.name} is not in the package rapidocr")
    runtime = import_module("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    # Its arena keeps what the largest page needed.
    options.enable_cpu_mem_arena = False
    options.log_severity_level = 3
    return runtime.InferenceSession(str(model), options, providers=["CPUExecutionProvider"])


def _input(gray: GrayImage) -> NDArray[np.float32]:
    """(1, 3, H, W): the picture from -1 to 1 in three equal channels."""
    even = gray.astype(np.float32) / 127.5 - 1.0
    return np.ascontiguousarray(np.broadcast_to(even, (1, 3, *gray.shape)))


def _detection_size(image: GrayImage) -> tuple[int, int]:
    """Width and height of the picture in which text is marked."""
    height, width = image.shape
    scale = min(1.0, DETECTION_SIDE_PX / max(height, width))
    sides = (max(1, round(scale * side / _MULTIPLE_PX)) * _MULTIPLE_PX for side in (width, height))
    return next(sides), next(sides)


@dataclass(frozen=True, slots=True)
class Mark:
    """A rectangle: its middle, its extent along and across the line, and its turn in degrees, -45 to 45."""

    x: float
    y: float
    along: float
    across: float
    turn: float = 0.0

    @property
    def middle(self) -> tuple[float, float]:
        """Its place (x, y)."""
        return self.x, self.y

    @property
    def extent(self) -> tuple[float, float]:
        """Its sides along and across the line."""
        return self.along, self.across

    def scaled(self, x: float, y: float) -> "Mark":
        """It on a picture that is so many times as large; these factors are nearly equal, so that it stays turned."""
        return Mark(x * self.x, y * self.y, x * self.along, y * self.across, self.turn)

    def end(self, side: int) -> NDArray[np.float64]:
        """The middle of its left (-1) or right (1) side."""
        turn = np.deg2rad(self.turn)
        return np.array([self.x, self.y]) + side * self.along / 2 * np.array([np.cos(turn), np.sin(turn)])


def arrange_rows(marks: Sequence[Mark]) -> list[list[Mark]]:
    """Marks in rows from the top down, those of each from left to right; each mark is a row on a page with columns."""
    rows: list[list[Mark]] = []
    wide = pairs = 0
    for mark in sorted(marks, key=lambda mark: float(mark.end(-1)[0])):
        start = mark.end(-1)
        offsets = [_offset(row[-1], mark, start) for row in rows]
        if not offsets or min(offsets) >= LEVEL:
            rows.append([mark])
            continue
        row = rows[int(np.argmin(offsets))]
        pairs += 1
        wide += all(each.along > COLUMN_WIDTH * each.across for each in (row[-1], mark))
        row.append(mark)
    if wide > MOST_COLUMNS * pairs:
        rows = [[mark] for mark in marks]
    return sorted(rows, key=lambda row: float(np.mean([mark.y for mark in row])))


def _offset(last: Mark, mark: Mark, start: NDArray[np.float64]) -> float:
    """How far a mark is from being level with the last one of a row, in heights; infinite if it is not right of it."""
    end = last.end(1)
    lower = min(last.across, mark.across)
    # Marks are wider than their print.
    return float(abs(end[1] - start[1]) / lower) if start[0] > end[0] - lower else np.inf


def _marks(probability: NDArray[np.float32]) -> Iterator[Mark]:
    """Lines of text, grown to the height of their print, of the probability (H, W) that a pixel is text."""
    mask = cv2.dilate((probability > _IS_TEXT).astype(np.uint8), np.ones((2, 2), np.uint8))
    for contour in cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)[0]:
        (x, y), (along, across), turn = cv2.minAreaRect(contour)
        if min(along, across) < _LEAST_MARK_PX:
            continue
        if abs(turn) > 45.0:
            along, across, turn = across, along, turn - np.copysign(90.0, turn)
        corners = cv2.boxPoints(((x, y), (along, across), turn))
        x0, y0 = np.maximum(np.floor(corners.min(axis=0)), 0).astype(int)
        x1, y1 = np.ceil(corners.max(axis=0)).astype(int) + 1
        part = probability[y0:y1, x0:x1]
        inside = np.zeros(part.shape, np.uint8)
        cv2.fillPoly(inside, [(corners - (x0, y0)).astype(np.int32)], 1)
        if cv2.mean(part, inside)[0] >= _IS_LINE:
            growth = _GROWTH * along * across / (along + across)
            yield Mark(x, y, along + growth, across + growth, float(turn))


def _cut(image: GrayImage, mark: Mark) -> _Crop:
    """The marked line, drawn upright at the height that is read."""
    scale = LINE_PX / mark.across
    width = int(np.clip(round(mark.along * scale), _SHORTEST_PX, _LONGEST_PX))
    # Pixels of the page for one of the crop, along and across the line.
    steps = np.array([mark.along / width, 1 / scale])
    cosine, sine = np.cos(np.deg2rad(mark.turn)), np.sin(np.deg2rad(mark.turn))
    turn = np.array([[cosine, -sine], [sine, cosine]])
    start = mark.middle - turn @ mark.extent / 2
    to_page = np.column_stack([turn * steps, start])
    if scale >= 1.0:
        return _Crop(_warp(image, to_page, (width, LINE_PX)), to_page)
    # Drawn at its own size first: a warp takes single pixels.
    size = (max(1, round(mark.along)), max(1, round(mark.across)))
    drawn = _warp(image, np.column_stack([turn * (np.array(mark.extent) / size), start]), size)
    return _Crop(
        np.asarray(cv2.resize(drawn, (width, LINE_PX), interpolation=cv2.INTER_AREA), np.uint8), to_page
    )


def _warp(image: GrayImage, to_page: NDArray[np.float64], size: tuple[int, int]) -> GrayImage:
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(image, to_page, size, flags=flags, borderMode=cv2.BORDER_REPLICATE), np.uint8
    )


def _ink(line: GrayImage) -> NDArray[np.bool_]:
    """Where a line is darker than the threshold that divides it best."""
    level, _ = cv2.threshold(line, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    return np.asarray(line <= level)


def _page_box(
    crop: _Crop, ink: NDArray[np.bool_], left: float, right: float
) -> tuple[float, float, float, float]:
    """Box on the page of the ink between two columns of a line; of all between them where there is none."""
    first = int(left)
    rows, columns = np.nonzero(ink[:, first : max(first + 1, int(np.ceil(right)))])
    if len(rows):
        x0, x1 = first + columns.min(), first + columns.max() + 1
        y0, y1 = rows.min(), rows.max() + 1
    else:
        x0, y0, x1, y1 = left, 0, right, LINE_PX
    corners = np.array([[x0, y0, 1], [x1, y0, 1], [x0, y1, 1], [x1, y1, 1]]) @ crop.to_page.T
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)
