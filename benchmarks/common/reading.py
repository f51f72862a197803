"""How well an image reads: a character score without regard to reading order, and a word rate.

Images are flat-fielded before they are read, for every method alike, so that only geometry and sharpness
count.
"""

import json
import re
import subprocess
import tempfile
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from rapidfuzz import fuzz
from rapidfuzz.distance import Levenshtein

from services.arrays import GrayImage, RgbImage
from services.imaging.illumination import flatten_illumination

LOST_BELOW = 0.35
"""A line that agrees less than this with its best place in the text counts as not read at all."""

SURE_FROM = 0.6
"""Confidence from which on a word counts as surely read."""

READ_FROM_PX = 3200
"""Longer side from which on a real photo is read as it is: at 2800 px the small print of an invoice still gains
10 to 20 points from a quarter more, for every method."""

MOST_ENLARGED = 2400 / 1024
"""Beyond twice the size photos of 1024 px gain nothing (99.3 and 99.2 % at 2 and 3)."""

_LIKE = str.maketrans(
    {
        **dict.fromkeys("‘’‚‛′`´", "'"),
        **dict.fromkeys("“”„‟″«»", '"'),
        **dict.fromkeys("‐‑‒–—―−", "-"),
    }
)


def normalise_text(text: str) -> str:
    """One form for quotes, dashes, ligatures and white space."""
    return re.sub(r"\s+", " ", unicodedata.normalize("NFKC", text).translate(_LIKE)).strip()


def character_score(lines: Sequence[str], read: str) -> float:
    """Character recognition score in 0-1; NaN without truth.

    Each line of the truth takes its best partial alignment in all that was read; its similarity is
    1 - Levenshtein / length, nothing below `LOST_BELOW`. The score is the mean weighted by length, so that
    neither columns nor tables read in another order cost anything.
    """
    text = normalise_text(read)
    wanted = [line for line in map(normalise_text, lines) if line]
    if not wanted:
        return float("nan")
    agreed = sum(len(line) * _line_similarity(line, text) for line in wanted)
    return agreed / sum(map(len, wanted))


def word_rate(lines: Sequence[str], read: str) -> float:
    """Share in 0-1 of the words that were read in full, as multisets; NaN without truth."""
    wanted = Counter(word for line in lines for word in normalise_text(line).split())
    if not wanted:
        return float("nan")
    return (wanted & Counter(normalise_text(read).split())).total() / wanted.total()


def character_error_rate(truth: str, read: str) -> float:
    """Levenshtein distance over the truth's length, in reading order (for single-column photos)."""
    wanted = normalise_text(truth)
    return Levenshtein.distance(wanted, normalise_text(read)) / max(len(wanted), 1)


def _line_similarity(line: str, text: str) -> float:
    if not text:
        return 0.0
    part = text
    if len(text) > len(line):
        place = fuzz.partial_ratio_alignment(line, text)
        part = text[place.dest_start : place.dest_end] if place else ""
    similarity = 1.0 - Levenshtein.distance(line, part) / len(line)
    return similarity if similarity >= LOST_BELOW else 0.0


def prepare(image: RgbImage | GrayImage) -> GrayImage:
    """Gray, with even light: what every reader is given."""
    gray = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
    return flatten_illumination(gray)


def enlargement(photo: RgbImage) -> float:
    """Factor by which all images of a small photo are enlarged before they are read, the same for every method.

    Tesseract reads print of 10 px poorly and by chance: UVDoc's page of a photo of 1024 px reads 87.7 % as it
    is, 99.3 % at twice the size. Views of one photo show its print equally large, so that one factor is fair.
    """
    return float(np.clip(READ_FROM_PX / max(photo.shape[:2]), 1.0, MOST_ENLARGED))


def enlarge(image: RgbImage, factor: float) -> RgbImage:
    """The image `factor` times as large (bicubic)."""
    if factor == 1.0:
        return image
    return np.asarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC), np.uint8)


@dataclass(frozen=True, slots=True)
class Reading:
    """What a judge read: all its text, and how many characters of it lie in words that it is sure of."""

    text: str
    sure_characters: int


class Reader(Protocol):
    """A judge: reads a whole page."""

    name: str

    def read(self, image: RgbImage | GrayImage) -> Reading:
        """Text of the page."""
        ...


class TesseractReader:
    """The embedded engine as the judge."""

    name = "tesseract"

    def __init__(self) -> None:
        from services.ocr.tesseract import TesseractEngine

        self._engine = TesseractEngine()

    def read(self, image: RgbImage | GrayImage) -> Reading:
        """See `Reader`."""
        words = self._engine.read_page(prepare(image))
        return _to_reading((word.text, word.confidence) for word in words)


class RapidOcrReader:
    """RapidOCR as the judge, in a process and a Python environment of its own (1 GB, its own OpenCV)."""

    name = "rapidocr"

    def __init__(self, python: str) -> None:
        script = Path(__file__).with_name("rapidocr_process.py")
        self._process = subprocess.Popen(
            [python, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
        )

    def read(self, image: RgbImage | GrayImage) -> Reading:
        """See `Reader`.

        Raises
        ------
        RuntimeError
            When the other process has ended (`rapidocr` and `onnxruntime` must be installed there).
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "page.png"
            cv2.imwrite(str(path), prepare(image))
            self._process.stdin.write(f"{path}\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(
                "the RapidOCR process has ended; are rapidocr and onnxruntime installed there?"
            )
        return _to_reading((text, confidence) for text, confidence in json.loads(answer))


def _to_reading(parts: Iterable[tuple[str, float]]) -> Reading:
    parts = list(parts)
    sure = sum(len(text.replace(" ", "")) for text, confidence in parts if confidence >= SURE_FROM)
    return Reading(" ".join(text for text, _ in parts), sure)


def make_reader(name: str, rapidocr_python: str) -> Reader:
    """The judge called `name`: "tesseract" or "rapidocr"."""
    return RapidOcrReader(rapidocr_python) if name == "rapidocr" else TesseractReader()
