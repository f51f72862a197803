"""Pages in ten languages: are they turned upright, and read as the clean page is?

python -m benchmarks languages [--fonts FOLDER] [--only fra,jpn] [--update-baseline]

Every page is photographed flat and bent, each photo turned in four ways. Language data and typefaces are those of the
machine; what is missing is said, with Debian's packages. A baseline of some languages keeps the figures of the others.
"""

import argparse
import json
import sys
import time
import unicodedata
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from rapidfuzz.distance import Levenshtein

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.places import BASELINE
from services.arrays import Points, RgbImage
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import installed_languages, open_engine
from services.operations.page_reading import read_flat_page
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from services.text.photo_places import locate_points
from services.text.plain import write_plain_text
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.language_pages import PACKAGES, find_typeface, set_language_page
from simulation.language_texts import TEXTS, LanguageText
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, PLANE, POSES, photograph

_SIZE = (1500, 2000)
METRICS = {
    "error_percent": Metric(0.5),
    "over_clean_points": Metric(0.5),
    "upright_percent": Metric(0.0, larger_is_better=True),
    "unnamed_upright_percent": Metric(0.0, larger_is_better=True),
}
"""Figures of a language that are compared with the committed ones."""


def normalise(text: str) -> str:
    """The text in Unicode's composed form, without spaces: Tesseract puts some between Chinese characters."""
    return "".join(unicodedata.normalize("NFKC", text).split())


def read_error(image: RgbImage, page: Page, engine: OcrEngine, language: str) -> float:
    """Character error of the product's text of a flat view, percent of the printed characters."""
    text = read_flat_page(image, engine, language)
    wanted = normalise("".join(line[0].text for line in page.lines))
    return 100.0 * Levenshtein.distance(wanted, normalise(write_plain_text([text]).decode())) / len(wanted)


def turned_back(points: Points, turns: int, size: tuple[int, int]) -> Points:
    """Points (N, 2) of `np.rot90(photo, turns)` in the photo itself, of `size` (width, height)."""
    x, y = points.T
    right, foot = size[0] - 1, size[1] - 1
    places = ((x, y), (right - y, x), (right - x, foot - y), (y, foot - x))
    return np.column_stack(places[turns % 4])


def is_upright(result: RectifyResult, photo: SimulatedPhoto, turns: int) -> bool:
    """Whether right and down on the flat view are right and down on the page."""
    height, width = result.image.shape[:2]
    step = min(width, height) / 8
    middle = np.array([width / 2, height / 2])
    view = middle + np.array([[0, 0], [step, 0], [0, step]])
    size = (photo.image.shape[1], photo.image.shape[0])
    places = turned_back(locate_points(result.mesh, width, height, view), turns, size)
    centre, right, down = photo.truth.photo_to_page(places)
    across, along = right - centre, down - centre
    return bool(across[0] > abs(across[1]) and along[1] > abs(along[0]))


def flatten(photo: SimulatedPhoto, turns: int, engine: OcrEngine) -> RectifyResult | None:
    """The product's flat view of the turned photo; None if it is refused."""
    image = np.ascontiguousarray(np.rot90(photo.image, turns))
    try:
        return rectify(image, RectifyParameters(), None, engine)
    except NoText:
        return None


def measure_language(text: LanguageText, page: Page, engine: OcrEngine, usual: OcrEngine) -> dict[str, float]:
    """Figures of one language; `usual` is the engine where a request names no language."""
    clean = read_error(cv2.cvtColor(page.image, cv2.COLOR_GRAY2RGB), page, engine, text.name)
    errors, upright, unnamed = [], [], []
    for index, shape in enumerate((PLANE, BOOK)):
        rng = np.random.default_rng(300 + index)
        photo = photograph(page, POSES[index], 0.0, shape, dirt=PHONE, rng=rng, size=_SIZE)
        for turns in range(4):
            result = flatten(photo, turns, engine)
            upright.append(result is not None and is_upright(result, photo, turns))
            if turns == index:
                read = 100.0 if result is None else read_error(result.image, page, engine, text.name)
                errors.append(read)
            if shape is PLANE:
                result = flatten(photo, turns, usual)
                unnamed.append(result is not None and is_upright(result, photo, turns))
    return {
        "clean_error_percent": clean,
        "error_percent": float(np.mean(errors)),
        "over_clean_points": float(np.mean(errors)) - clean,
        "upright_percent": 100.0 * float(np.mean(upright)),
        "unnamed_upright_percent": 100.0 * float(np.mean(unnamed)),
    }


def main(arguments: Sequence[str]) -> int:
    """Print a line a language and the means; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks languages", description=__doc__)
    parser.add_argument("--fonts", type=Path, action="append", default=[], help="further folder of typefaces")
    parser.add_argument("--only", help="languages by Tesseract's names, with commas")
    parser.add_argument("--update-baseline", action="store_true")
    asked = parser.parse_args(arguments)
    usual = open_engine("eng")
    if usual is None:
        print("no OCR engine is installed", file=sys.stderr)
        return 2
    figures: Figures = {}
    for text in TEXTS:
        if asked.only and text.name not in asked.only.split(","):
            continue
        typeface = find_typeface(text.script, asked.fonts)
        if typeface is None or text.name not in installed_languages():
            package = f"tesseract-ocr-{text.name.replace('_', '-')} and {PACKAGES[text.script]}"
            print(f"{text.name}: NOT MEASURED, no typeface or language data (Debian: {package})")
            continue
        engine = open_engine(text.name)
        assert engine is not None
        start = time.process_time()
        found = measure_language(text, set_language_page(text, typeface), engine, usual)
        figures[text.name] = found
        print(
            f"{text.name:8s} {text.script:10s} error {found['error_percent']:5.2f} % (clean page "
            f"{found['clean_error_percent']:5.2f}), upright {found['upright_percent']:.0f} %, language not named "
            f"{found['unnamed_upright_percent']:.0f} %, {time.process_time() - start:.0f} CPU s",
            flush=True,
        )
    if not figures:
        return 2
    means = {name: np.mean([each[name] for each in figures.values()]) for name in METRICS}
    print(f"{len(figures)} languages: " + ", ".join(f"{name} {mean:.2f}" for name, mean in means.items()))
    path = BASELINE / "languages.json"
    if asked.update_baseline and asked.only:
        figures = json.loads(path.read_text(encoding="utf-8")) | figures
    report, fine = judge(path, figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
