"""Tesseract inside the process, by `tesserocr` (its wheel bundles the library, not the language data)."""

import logging
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from services.arrays import GrayImage
from services.deadline import time_left_s
from services.ocr.cpu_limit import CpuTimeOver, can_limit, cpu_limit
from services.ocr.engine import OcrEngine, ReadDirection, SecondReader, Word
from services.ocr.languages import DEFAULT_LANGUAGE
from services.ocr.network import LANGUAGES, open_network
from services.ocr.reading_direction import order_letters

_log = logging.getLogger(__name__)

_TESSDATA_FOLDERS = (
    "/usr/share/tesseract-ocr/5/tessdata",
    "/usr/share/tesseract-ocr/4.00/tessdata",
    "/usr/share/tesseract-ocr/tessdata",
    "/usr/share/tessdata",
    "/usr/local/share/tessdata",
)
_NO_LANGUAGES = frozenset({"osd", "equ", "snum"})
"""Data files of orientation, formulas and serial numbers."""
_LARGEST_SIDE_PX = 16000
"""Tesseract keeps coordinates in 16 bits."""
_SMALLEST_SIDE_PX = 3
_LINE_DPI = "300"


class EngineUnavailable(Exception):
    """The engine's library or its language data is not installed; the message says which."""


def find_tessdata(language: str) -> Path | None:
    """Folder that holds the data of `language` (`eng`, or all of `eng+fra`).

    TESSDATA_PREFIX is searched first, then where distributions put it.
    """
    names = [f"{name}.traineddata" for name in language.split("+")]
    return next((folder for folder in _folders() if all((folder / name).is_file() for name in names)), None)


def installed_languages() -> tuple[str, ...]:
    """Languages whose data are installed, in alphabetical order."""
    names = {file.stem for folder in _folders() if folder.is_dir() for file in folder.glob("*.traineddata")}
    return tuple(sorted(names - _NO_LANGUAGES))


def default_language() -> str:
    """English where it is installed, else the first language that is."""
    installed = installed_languages()
    return DEFAULT_LANGUAGE if DEFAULT_LANGUAGE in installed or not installed else installed[0]


def _folders() -> list[Path]:
    prefix = os.environ.get("TESSDATA_PREFIX")
    folders = [Path(prefix), Path(prefix) / "tessdata"] if prefix else []
    return folders + [Path(folder) for folder in _TESSDATA_FOLDERS]


def open_engine(language: str | None = None) -> OcrEngine | None:
    """A new engine for the calling thread or process; None if none is installed (logged once).

    `language` is one of Tesseract's, or several (`eng+fra`); None: the default.
    """
    try:
        return TesseractEngine(language or default_language())
    except EngineUnavailable as error:
        _tell_once(str(error))
        return None


@cache
def _tell_once(reason: str) -> None:
    _log.warning("No text is read, and pages are not turned upright: %s.", reason)


class TesseractEngine:
    """`OcrEngine` over Tesseract's LSTM; 1.4-2.4 CPU s a page. One object per thread or process.

    Each page segmentation mode keeps an API object, made at first use (80 ms and 20-80 MB each).

    Raises
    ------
    EngineUnavailable
        When `tesserocr` cannot be imported, or the language data is not installed.
    """

    name = "tesseract"

    def __init__(self, language: str = "eng") -> None:
        # OpenMP inside Tesseract costs CPU and gains nothing where every core has a worker of its own.
        os.environ.setdefault("OMP_THREAD_LIMIT", "1")
        try:
            import tesserocr
        except ImportError as error:
            raise EngineUnavailable(f"the Python package tesserocr cannot be imported ({error})") from error
        folder = find_tessdata(language)
        if folder is None:
            raise EngineUnavailable(
                f"{language}.traineddata was not found in TESSDATA_PREFIX or the usual folders "
                f"(on Debian: package tesseract-ocr-{language})"
            )
        self._library = tesserocr
        self._language = language
        self._folder = folder
        self._apis: dict[str, Any] = {}

    def read_page(self, image: GrayImage) -> list[Word]:
        """Words of a whole page, in reading order; boxes are in pixels of `image` (H, W) uint8."""
        return self._read_page(image, None)[0]

    def read_page_within(self, image: GrayImage, seconds: float) -> tuple[list[Word], bool]:
        """See `BoundedReader`; layout analysis, which comes first, is always done."""
        return self._read_page(image, max(0.001, seconds))

    def _read_page(self, image: GrayImage, limit_s: float | None) -> tuple[list[Word], bool]:
        if min(image.shape) < _SMALLEST_SIDE_PX:
            return [], False
        factor = min(1.0, _LARGEST_SIDE_PX / max(image.shape))
        if factor < 1.0:
            size = (max(1, int(image.shape[1] * factor)), max(1, int(image.shape[0] * factor)))
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        api = self._api("page", self._library.PSM.AUTO, self._language)
        self._set_image(api, image)
        return self._recognize(api, factor, limit_s)

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        """Text of one horizontal line crop, and the length-weighted confidence of its words, 0-1."""
        if min(image.shape) < _SMALLEST_SIDE_PX or max(image.shape) > _LARGEST_SIDE_PX:
            return "", 0.0
        api = self._api("line", self._library.PSM.SINGLE_LINE, self._language)
        self._set_image(api, image)
        words, _ = self._recognize(api)
        length = sum(len(word.text) for word in words)
        if length == 0:
            return "", 0.0
        confidence = sum(len(word.text) * word.confidence for word in words) / length
        return " ".join(word.text for word in words), confidence

    def read_line_words(self, image: GrayImage) -> list[Word]:
        """See `LineReader`."""
        if min(image.shape) < _SMALLEST_SIDE_PX or max(image.shape) > _LARGEST_SIDE_PX:
            return []
        api = self._api("line words", self._library.PSM.RAW_LINE, self._language)
        self._set_image(api, image)
        return self._recognize(api)[0]

    def detect_direction(self, image: GrayImage) -> ReadDirection | None:
        """Orientation of a page by Tesseract's own script detection; None without its data or enough text."""
        readable = min(image.shape) >= _SMALLEST_SIDE_PX and max(image.shape) <= _LARGEST_SIDE_PX
        if not readable or find_tessdata("osd") is None:
            return None
        api = self._api("direction", self._library.PSM.OSD_ONLY, "osd")
        self._set_image(api, image)
        try:
            found = api.DetectOrientationScript()
        finally:
            api.Clear()
        if not found:
            return None
        return ReadDirection(
            int(found["orient_deg"]) % 360, float(found["orient_conf"]), str(found["script_name"])
        )

    def second_reader(self) -> SecondReader | None:
        """See `AssistedReader`."""
        return open_network() if LANGUAGES.issuperset(self._language.split("+")) else None

    def close(self) -> None:
        """Release the memory of the library."""
        while self._apis:
            self._apis.popitem()[1].End()

    def _api(self, use: str, segmentation: int, language: str) -> Any:
        if use not in self._apis:
            folder = self._folder if language == self._language else find_tessdata(language)
            api = self._library.PyTessBaseAPI(path=str(folder), lang=language, psm=segmentation)
            api.SetVariable("debug_file", os.devnull)
            if use in ("line", "line words"):
                # Polarity is settled before a line is read; trying both doubles the cost of unreadable lines.
                api.SetVariable("tessedit_do_invert", "0")
                api.SetVariable("user_defined_dpi", _LINE_DPI)
            self._apis[use] = api
        return self._apis[use]

    @staticmethod
    def _set_image(api: Any, image: GrayImage) -> None:
        height, width = image.shape
        api.SetImageBytes(np.ascontiguousarray(image).tobytes(), width, height, 1, width)

    def _recognize(
        self, api: Any, factor: float = 1.0, limit_s: float | None = None
    ) -> tuple[list[Word], bool]:
        """Words that were recognized, and whether the limit came first; what was recognized until then is there."""
        try:
            done = self._recognize_within(api, limit_s)
            cut = limit_s is not None and not done
            words = list(self._words(api, factor)) if done or cut else []
        finally:
            api.Clear()
        # On blank ground the engine makes up a word, without any confidence.
        return (words if any(word.confidence > 0.0 for word in words) else []), cut

    @staticmethod
    def _recognize_within(api: Any, limit_s: float | None) -> bool:
        """Whether the recognition came to its end; in other threads than the main one the limit is of wall time."""
        if limit_s is None or not can_limit():
            wall_s = None if limit_s is None else min(limit_s, time_left_s())
            return bool(api.Recognize(0 if wall_s is None else max(1, round(1000 * wall_s))))
        try:
            with cpu_limit(limit_s):
                return bool(api.Recognize())
        except CpuTimeOver:
            return False

    def _words(self, api: Any, factor: float) -> Iterator[Word]:
        """Words of the last recognition; boxes are divided by `factor`."""
        level, line = self._library.RIL.WORD, -1
        words = api.GetIterator()
        if words is None:
            return
        for word in self._library.iterate_level(words, level):
            line += word.IsAtBeginningOf(self._library.RIL.TEXTLINE)
            box = word.BoundingBox(level)
            if word.Empty(level) or box is None:
                continue
            try:
                text = order_letters(word.GetUTF8Text(level).strip())
            except RuntimeError:  # "No text returned": the library's word for an empty one.
                continue
            if text:
                x0, y0, x1, y1 = (float(edge) / factor for edge in box)
                confidence = min(1.0, max(0.0, word.Confidence(level) / 100.0))
                yield Word(text, (x0, y0, x1, y1), confidence, line)
