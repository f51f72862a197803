"""The character error that answers expect, beside the measured one: rank correlation and means, and the coefficients.

python -m benchmarks expected_error [--parts app,photos,receipts] [--fit] [--fresh] [--update-baseline]

*Photo*: `predicted_character_error` where nothing was read. *Reading*: where the page was read. Every photo is measured
as it is and, if it is larger, with shorter sides of 1000 and 700 px (JPEG 85), 3 to 8 CPU s each; rows are kept. The
figures are of photos as they are. Coefficients (`--fit`) are those of the greatest likelihood of the share of misread
characters (a fractional logistic regression, whose mean is the measured one), from sheets that are not set aside; all
kinds weigh the same, and so do photos with all their sizes. Receipts are scans, and no figure of a picture shows what
is wrong with thermal print: they teach the reading only.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit
from scipy.stats import spearmanr

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, OUTPUT, data_folder
from benchmarks.common.reading import character_score
from benchmarks.reading.cases import Case, find_cases
from services.arrays import RgbImage, Vector
from services.capture.quality import CaptureQuality, measure_quality
from services.capture.readability import (
    PhotoCalibration,
    ReadingModel,
    photo_variables,
    predict_character_error,
    predict_error_of_reading,
    reading_variable,
)
from services.contract.images import ImageLimits
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.imaging.channels import luminance
from services.imaging.codec import decode_image
from services.operations.page_reading import read_flat_page
from services.operations.reader import ocr_engine
from services.rectify.pipeline import rectify
from services.text.page_text import doubtful_letters

NAME = "expected_error"
METRICS = {
    "photo_rank": Metric(0.03, larger_is_better=True),
    "photo_off": Metric(1.0),
    "reading_rank": Metric(0.03, larger_is_better=True),
    "reading_off": Metric(1.0),
}
"""Rank correlations, and how far the means are apart in points."""
SIDES_PX = (None, 1000, 700)
LEAST_REDUCTION = 1.25
"""Photos are reduced by this factor at least: smaller steps make no new photo."""


@dataclass(frozen=True, slots=True)
class Row:
    """A photo in one size (`side_px`: its shorter side, None as it is), its figures and its measured error in 0-1."""

    name: str
    part: str
    group: str
    is_set_aside: bool
    side_px: int | None
    quality: CaptureQuality
    doubtful: float
    error: float


def measure(case: Case, side_px: int | None) -> Row | None:
    """Figures and error of one photo in one size; None if that is no smaller, or if its page is not found."""
    decoded = decode_image(case.path.read_bytes(), ImageLimits())
    photo, focal_px = decoded.pixels, decoded.focal_length_px
    if side_px is not None:
        factor = side_px / min(photo.shape[:2])
        if factor * LEAST_REDUCTION > 1.0:
            return None
        photo, focal_px = reduced(photo, factor), None if focal_px is None else factor * focal_px
    engine = ocr_engine(case.language)
    assert engine is not None
    try:
        result = rectify(photo, RectifyParameters(), focal_px, engine)
    except DocumentError:
        return None
    found = result.print
    if found is None:
        return None
    quality = measure_quality(luminance(photo), found.characters, found.heights_px, result.mesh)
    if quality is None:
        return None
    text = read_flat_page(result.image, engine, case.language)
    read = " ".join(line.text for line in text.lines)
    error = 1.0 - character_score(case.lines, read.upper() if case.part == "receipts" else read)
    doubtful = doubtful_letters(text.words)
    return Row(case.name, case.part, case.group, case.is_set_aside, side_px, quality, doubtful, error)


def reduced(photo: RgbImage, factor: float) -> RgbImage:
    """The photo (H, W, 3) at `factor` of its size, as a phone would have kept it."""
    small = cv2.resize(photo, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    data = cv2.imencode(".jpg", small[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
    return decode_image(data.tobytes(), ImageLimits()).pixels


def kept_rows(cases: Sequence[Case], *, fresh: bool) -> Iterator[Row]:
    """Rows of all cases in all sizes, from the file of an earlier run where they are there."""
    path = OUTPUT / f"{NAME}_rows.json"
    kept = {} if fresh or not path.is_file() else json.loads(path.read_text(encoding="utf-8"))
    for case in cases:
        for side_px in SIDES_PX:
            key = f"{case.name} {side_px}"
            if key not in kept:
                row = measure(case, side_px)
                kept[key] = None if row is None else asdict(row)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(json.dumps(kept, default=float), encoding="utf-8")
            if kept[key] is not None:
                yield Row(**{**kept[key], "quality": CaptureQuality(**kept[key]["quality"])})


def misread(row: Row) -> float:
    """Share of the characters in view that were not read right."""
    return float(np.clip(1 - (1 - row.error) / max(1 - row.quality.cut_off_fraction, 0.05), 0.0, 1.0))


def weights_of(rows: Sequence[Row]) -> Vector:
    """Weight of each row: kinds weigh the same, and so do the photos of a kind."""
    names, parts = np.array([row.name for row in rows]), np.array([row.part for row in rows])
    each = 1.0 / np.array([(names == name).sum() for name in names])
    return np.asarray(each / [each[parts == part].sum() for part in parts])


def learn(variables: NDArray[np.float64], errors: Vector, weights: Vector) -> Vector:
    """Constant and slopes (1 + K,) of the most probable logistic model of `errors` (N,) by `variables` (N, K).

    No slope is below 0: worse figures never make a better photo.
    """
    columns = np.column_stack([np.ones(len(errors)), variables])

    def loss(c: Vector) -> tuple[float, Vector]:
        logits = columns @ c
        each = np.logaddexp(0.0, logits) - errors * logits
        return float(weights @ each), (weights * (expit(logits) - errors)) @ columns

    bounds = [(None, None)] + [(0.0, None)] * variables.shape[1]
    return np.asarray(minimize(loss, np.zeros(columns.shape[1]), jac=True, bounds=bounds).x)


def learn_photo(rows: Sequence[Row]) -> PhotoCalibration:
    """From photos of pages, without receipts."""
    rows = [row for row in rows if row.part != "receipts"]
    variables = np.array([photo_variables(row.quality) for row in rows])
    found = learn(variables, np.array([misread(row) for row in rows]), weights_of(rows))
    return PhotoCalibration(*found.round(2).tolist())


def learn_reading(rows: Sequence[Row]) -> ReadingModel:
    """From all kinds."""
    variables = np.array([[reading_variable(row.doubtful)] for row in rows])
    found = learn(variables, np.array([misread(row) for row in rows]), weights_of(rows))
    return ReadingModel(*found.round(2).tolist())


def without_sheet(rows: Sequence[Row]) -> tuple[Vector, Vector]:
    """Errors (N,) by photo and by reading, from coefficients that were learned without the row's sheet."""
    photo, reading = np.zeros(len(rows)), np.zeros(len(rows))
    for group in {row.group for row in rows}:
        others = [row for row in rows if row.group != group]
        calibration, model = learn_photo(others), learn_reading(others)
        for index, row in enumerate(rows):
            if row.group == group:
                photo[index] = predict_character_error(row.quality, calibration)
                reading[index] = predict_error_of_reading(row.quality, row.doubtful, model)
    return photo, reading


def compare(title: str, photo: Vector, reading: Vector, errors: Vector) -> dict[str, float]:
    """Print and return how near predictions (N,) are to the measured errors (N,)."""
    figures: dict[str, float] = {}
    told = f"{title:<24}{len(errors):3d} photos, measured {100 * errors.mean():5.1f} %"
    for name, expected in (("photo", photo), ("reading", reading)):
        rank = float(spearmanr(expected, errors).statistic)
        figures |= {f"{name}_rank": rank, f"{name}_off": 100 * abs(expected.mean() - errors.mean())}
        told += f"; {name} {100 * expected.mean():5.1f} %, rank correlation {rank:5.2f}"
    print(told, flush=True)
    return figures


def main(arguments: Sequence[str]) -> int:
    """Print the figures of each part; compare with the committed ones."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--parts", default="app,photos,receipts", help="with commas")
    parser.add_argument("--fit", action="store_true", help="print coefficients of the sheets not set aside")
    asked = parser.parse_args(arguments)
    cases = [case for part in asked.parts.split(",") for case in find_cases(data_folder(asked.data), part)]
    if not cases:
        print("NOT MEASURED: no data, or no language data for them")
        return 2
    rows = list(kept_rows(cases, fresh=asked.fresh))
    photo = np.array([predict_character_error(row.quality) for row in rows])
    reading = np.array([predict_error_of_reading(row.quality, row.doubtful) for row in rows])
    left_out = without_sheet(rows) if asked.fit else None
    errors = np.array([row.error for row in rows])
    figures: Figures = {}
    for part in asked.parts.split(","):
        own = np.array([row.part == part and row.side_px is None for row in rows])
        aside = np.array([row.is_set_aside for row in rows])
        for title, chosen in (("all", own), ("looked at", own & ~aside), ("set aside", own & aside)):
            if chosen.sum() > 1:
                found = compare(f"{part}, {title}", photo[chosen], reading[chosen], errors[chosen])
                figures |= {part: found} if title == "all" else {}
        if left_out is not None:
            compare(f"{part}, without the sheet", left_out[0][own], left_out[1][own], errors[own])
    if asked.fit:
        learned = [row for row in rows if not row.is_set_aside]
        print(learn_photo(learned), learn_reading(learned))
    report, fine = judge(BASELINE / f"{NAME}.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1
