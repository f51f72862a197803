"""Confidences of read words: how often words are right, by what the engine says and by the calibration.

python -m benchmarks text_confidence [--data FOLDER] [--update-baseline]

All flat pages of the data are read clean, coarse, blurred, noisy and faint. A word is right if it is the printed one at
its place. Expected calibration error over 15 bins: of the engine's confidences, of the calibration as shipped, and of
one that was learned without the page. The coefficients that all pages teach are printed.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import write_json
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, OUTPUT, data_folder
from benchmarks.common.reading import normalise_text
from benchmarks.layout.label_trust import expected_error
from services.arrays import GrayImage
from services.imaging.illumination import flatten_illumination
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine
from services.ocr.word_trust import WordTrust, features_of, probability_right
from simulation.flat_page import Page
from simulation.pages import load_page

NAME = "text_confidence"
METRICS = {"expected_error_percent": Metric(0.5)}
Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Damage:
    """Resolution, blur (px), noise (gray levels) and contrast of a picture of a page."""

    dpi: float
    blur_px: float
    noise: float
    contrast: float


DAMAGES = (
    Damage(150, 0.0, 0.0, 1.0),
    Damage(150, 0.8, 8.0, 0.8),
    Damage(110, 0.6, 6.0, 0.7),
    Damage(90, 0.5, 5.0, 0.8),
    Damage(150, 1.5, 12.0, 0.7),
    Damage(150, 2.0, 6.0, 0.5),
)


def damaged(page: Page, damage: Damage, rng: np.random.Generator) -> GrayImage:
    """The page (h, w) uint8 as a poor scanner would have it."""
    gray = page.image if page.image.ndim == 2 else cv2.cvtColor(page.image, cv2.COLOR_RGB2GRAY)
    scale = damage.dpi / page.dpi
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA).astype(np.float64)
    if damage.blur_px:
        small = cv2.GaussianBlur(small, (0, 0), damage.blur_px)
    paper = 240.0 - (255.0 - small) * damage.contrast
    return np.clip(paper + rng.normal(0.0, damage.noise, small.shape), 0, 255).astype(np.uint8)


def read_words(
    page: Page, damage: Damage, engine: OcrEngine, rng: np.random.Generator
) -> list[tuple[float, bool]]:
    """Confidence of every word that was read where one is printed, and whether it is that one."""
    scale = damage.dpi / page.dpi
    printed = [word for line in page.lines for word in line]
    boxes = scale * np.array([word.box for word in printed])
    found = []
    for word in engine.read_page(flatten_illumination(damaged(page, damage, rng))):
        x0, y0, x1, y1 = word.box
        across = np.minimum(boxes[:, 2], x1) - np.maximum(boxes[:, 0], x0)
        down = np.minimum(boxes[:, 3], y1) - np.maximum(boxes[:, 1], y0)
        shared = np.maximum(across, 0.0) * np.maximum(down, 0.0)
        best = int(np.argmax(shared))
        if shared[best] >= 0.3 * (x1 - x0) * (y1 - y0):
            is_right = normalise_text(word.text) == normalise_text(printed[best].text)
            found.append((word.confidence, is_right))
    return found


def learn(confidence: Vector, is_right: NDArray[np.bool_]) -> WordTrust:
    """The coefficients that make the words' being right most probable."""
    columns, sign = np.array([features_of(each) for each in confidence]), np.where(is_right, 1.0, -1.0)

    def loss(weights: Vector) -> tuple[float, Vector]:
        margin = sign * (columns @ weights)
        return float(np.logaddexp(0.0, -margin).sum()), -(sign * expit(-margin)) @ columns

    return WordTrust(*minimize(loss, np.zeros(3), jac=True, method="BFGS").x)


def trusted(confidence: Vector, trust: WordTrust | None = None) -> Vector:
    """`probability_right` of all words."""
    return np.array([probability_right(each, trust) for each in confidence])


def main(arguments: Sequence[str] | None = None) -> int:
    """Read, measure, learn, compare with the baseline; its exit status."""
    given = make_parser(NAME, __doc__).parse_args(arguments)
    files = sorted((data_folder(given.data) / "pages").glob("*.png"))
    engine = open_engine()
    if engine is None or not files:
        print("It takes an OCR engine and flat pages (--data); one of them is missing.", file=sys.stderr)
        return 1
    words: list[tuple[float, bool]] = []
    owner: list[int] = []
    for number, file in enumerate(files):
        page, rng = load_page(file), np.random.default_rng(number)
        for damage in DAMAGES:
            read = read_words(page, damage, engine, rng)
            words += read
            owner += [number] * len(read)
        print(f"{page.name}: {len(words)} words so far", file=sys.stderr)
    confidence = np.array([each for each, _ in words])
    is_right, pages = np.array([each for _, each in words]), np.array(owner)
    left_out = np.zeros(len(words))
    for number in np.unique(pages):
        own = pages == number
        left_out[own] = trusted(confidence[own], learn(confidence[~own], is_right[~own]))
    errors = {
        "engine": 100 * expected_error((confidence, is_right)),
        "shipped": 100 * expected_error((trusted(confidence), is_right)),
        "learned without the page": 100 * expected_error((left_out, is_right)),
    }
    print(f"{len(words)} words, {100 * is_right.mean():.1f} % right; expected calibration error, %:")
    print("\n".join(f"  {name:<26}{error:6.2f}" for name, error in errors.items()))
    best = learn(confidence, is_right)
    print("learned: " + ", ".join(f"{each.name} {getattr(best, each.name):.2f}" for each in fields(best)))
    figures: Figures = {name: {"expected_error_percent": error} for name, error in errors.items()}
    write_json(OUTPUT / f"{NAME}.json", figures)
    report, good = judge(BASELINE / f"{NAME}.json", figures, METRICS, update=given.update_baseline)
    print(report)
    return 0 if good else 1
