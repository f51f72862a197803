"""Print that a view keeps: words of the photo that lie in the view with their whole box, by an independent count.

python -m benchmarks print_kept [--simulated N] [--photos N] [--names NAME ...] [--update-baseline]

On simulated photos the words are those of the truth that are whole in the photo. On real photos they are those that
Tesseract reads in the photo itself with a confidence of 80 or more; where the page's text is known only words of that
text count, so that a facing page does not, and elsewhere photos with a facing page are left out. A word that the view
draws as blank paper is lost too.
"""

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.memory import Memory
from benchmarks.common.places import BASELINE, MEMORY, data_folder
from benchmarks.common.reading import enlarge, enlargement, normalise_text, prepare
from benchmarks.rectify.cases import (
    CHOSEN_PAGES,
    EXPERIMENTS,
    all_cases,
    load_own_pages,
    load_pages,
    photograph_case,
)
from benchmarks.rectify.real_photos import FOLDERS, find_photos
from services.arrays import Floats, GrayImage, Points, RgbImage
from services.contract.images import ImageLimits
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.imaging.codec import decode_image
from services.ocr.engine import OcrEngine
from services.operations.reader import ocr_engine
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from simulation.truth import Truth

_FOLDERS = (*FOLDERS, "photos_app")
_EXPERIMENTS = (
    "planar",
    "curved",
    "cone",
    "folded",
    "crossed",
    "crumpled",
    "ground",
    "cropped",
    "two_columns",
)
_CONFIDENCE = 0.8
_LETTERS = re.compile(r"\w{2,}")
"""What counts as a word: specks are read as single signs."""
_LOOSE = 0.15
"""Of a read box's height, by which it is larger than its print."""
_BLANK = 250
METRICS = {"kept_percent": Metric(0.05, larger_is_better=True)}
"""Figures of a photo that are compared with the committed ones."""


def kept_words(result: RectifyResult, boxes: Floats) -> list[bool]:
    """Which `boxes` (N, 4, 2), corners in the photo, the view shows whole and not blank."""
    height, width = result.image.shape[:2]
    rows, columns = result.mesh.shape[:2]
    x, y = np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows))
    place = LinearNDInterpolator(result.mesh.reshape(-1, 2), np.column_stack([x.ravel(), y.ravel()]))
    darkest = result.image.min(axis=2)
    kept = []
    for box in boxes:
        parts = [place(part) for part in _ends(box)]
        shown = all(_is_inked(darkest, part) for part in parts)
        kept.append(bool(shown and np.isfinite(place(box)).all()))
    return kept


def _ends(box: Points, count: int = 12) -> tuple[Points, Points]:
    """Points of the first and the last third of a quadrilateral (4, 2), close enough to meet a letter."""
    s, t = np.meshgrid(np.linspace(0.0, 1.0, 3 * count)[:, None], np.linspace(0.1, 0.9, count))
    s, t = s.ravel()[:, None], t.ravel()[:, None]
    points = (1 - t) * ((1 - s) * box[0] + s * box[1]) + t * ((1 - s) * box[3] + s * box[2])
    return points[s[:, 0] < 0.34], points[s[:, 0] > 0.66]


def _is_inked(darkest: GrayImage, pixels: Points) -> bool:
    """Whether one of the view's `pixels` (N, 2) is not as white as what is drawn outside of the sheet."""
    x, y = pixels[np.isfinite(pixels).all(axis=1)].round().astype(int).T
    return bool(darkest[y, x].min(initial=255) < _BLANK)


def true_words(truth: Truth) -> Floats:
    """Corners (N, 4, 2) in the photo of the words that are whole in it."""
    boxes = [word.box for line in truth.visible_lines() for word in line]
    corners = np.array([[(x0, y0), (x1, y0), (x1, y1), (x0, y1)] for x0, y0, x1, y1 in boxes])
    return truth.page_to_photo(corners.reshape(-1, 2)).reshape(-1, 4, 2)


def read_words(photo: RgbImage, engine: OcrEngine, memory: Memory, text: str) -> tuple[list[str], Floats]:
    """Words that are surely read in the photo, and their corners (N, 4, 2) there; with a `text`, words of it only."""
    factor = enlargement(photo)
    allowed = set(_LETTERS.findall(normalise_text(text)))
    words, corners = [], []
    for word in memory.page_words(engine, prepare(enlarge(photo, factor))):
        parts = _LETTERS.findall(normalise_text(word.text))
        if word.confidence < _CONFIDENCE or not parts or (allowed and not allowed.intersection(parts)):
            continue
        x0, y0, x1, y1 = (value / factor for value in word.box)
        rim = _LOOSE * (y1 - y0)
        words.append(word.text)
        corners.append(
            [(x0 + rim, y0 + rim), (x1 - rim, y0 + rim), (x1 - rim, y1 - rim), (x0 + rim, y1 - rim)]
        )
    return words, np.array(corners).reshape(-1, 4, 2)


def measure_simulated(data: Path, limit: int) -> Iterator[tuple[str, float, int, str]]:
    """Name, percent of the words kept, number of words, and what is to be told, of `limit` photos an experiment."""
    pages = {page.name: page for page in load_pages(data)[0]}
    for name in _EXPERIMENTS:
        experiment = EXPERIMENTS[name]
        pages |= {page.name: page for page in load_own_pages(data, experiment.pages)}
        for case in all_cases(experiment, CHOSEN_PAGES, degraded=True)[:limit]:
            photo = photograph_case(case, pages[case.page])
            yield _measure(f"{name} {case.name}", photo.image, None, true_words(photo.truth), None)


def measure_photos(
    data: Path, names: Sequence[str], limit: int | None
) -> Iterator[tuple[str, float, int, str]]:
    """As `measure_simulated`, of real photos."""
    engine, memory = ocr_engine(), Memory(MEMORY)
    if engine is None:
        print("Tesseract is not installed: no real photos", file=sys.stderr)
        return
    photos = [photo for photo in find_photos(data, _FOLDERS) if not names or photo.name in names]
    for photo in photos[:limit]:
        decoded = decode_image(photo.path.read_bytes(), ImageLimits())
        words, corners = read_words(decoded.pixels, engine, memory, photo.truth)
        if len(words):
            found = _measure(photo.name, decoded.pixels, decoded.focal_length_px, corners, words)
            if photo.truth or "facing-page" not in found[3]:
                yield found


def _measure(
    name: str, photo: RgbImage, exif_px: float | None, corners: Floats, words: Sequence[str] | None
) -> tuple[str, float, int, str]:
    try:
        result = rectify(photo, RectifyParameters(upright=False), exif_px)
    except DocumentError as error:
        return name, float("nan"), len(corners), error.code
    kept = kept_words(result, corners)
    said = [notice.code for notice in result.warnings]
    lost = [] if words is None else [word for word, keeps in zip(words, kept, strict=True) if not keeps]
    own = result.evidence.print_kept
    told = f"{result.kind} {own if own is None else round(own, 4)} {' '.join(said)} {' '.join(lost[:12])}"
    return name, 100.0 * float(np.mean(kept)), len(kept), told


def main(arguments: Sequence[str]) -> int:
    """Print a line a photo, and the shares; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks print_kept", description=__doc__)
    parser.add_argument("--data", default=None, help="folder of the data (default: ../shared/data)")
    parser.add_argument("--simulated", type=int, default=6, help="photos of each experiment")
    parser.add_argument("--photos", type=int, default=None, help="at most this many real photos")
    parser.add_argument("--names", nargs="*", default=[], help="only these real photos")
    parser.add_argument("--update-baseline", action="store_true")
    asked = parser.parse_args(arguments)
    data, figures = data_folder(asked.data), Figures()
    total: dict[str, list[float]] = {"simulated": [], "real": []}
    short: dict[str, int] = {"simulated": 0, "real": 0}
    simulated = () if asked.names else measure_simulated(data, asked.simulated)
    for kind, found in (("simulated", simulated), ("real", measure_photos(data, asked.names, asked.photos))):
        for name, percent, count, told in found:
            print(f"{name:44s} {percent:7.2f} % of {count:4d} words  {told}", flush=True)
            if np.isfinite(percent):
                figures[name] = {"kept_percent": percent}
                total[kind] += [percent] * count
                short[kind] += percent < (100.0 if kind == "simulated" else 99.5) and "print-cut" not in told
    for kind, shares in total.items():
        if shares:
            print(
                f"{kind}: {np.mean(shares):.3f} % of {len(shares)} words; photos below the goal: {short[kind]}"
            )
    report, fine = judge(BASELINE / "print_kept.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
