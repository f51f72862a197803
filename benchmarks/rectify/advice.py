"""Predicted and measured character error of photos: rank correlation, and the coefficients of what damages cost.

What these say of real pages, and the model of readings, are learned by `python -m benchmarks expected_error`.

*Photo*: the error that the photo's figures let expect. *Reading*: the error that the confidences of the words let
expect, once the page has been read.

Of each damage there are two photos, with other text and other noise: the rank correlation of their errors says how well
any figures of the photo could predict the error (about its square root, since both errors have a part of chance).

python -m benchmarks advice [--photos N] [--seed S] [--fit] [--development]
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, astuple, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import spearmanr

from benchmarks.common.places import OUTPUT, data_folder
from benchmarks.common.reading import character_score
from benchmarks.rectify.advice_photos import Measured, measure_photos, usual_focus_measures
from services.capture.quality import CaptureQuality, measure_quality
from services.capture.readability import (
    ErrorModel,
    features_of,
    predict_character_error,
    predict_damage_error,
    predict_error_of_reading,
)
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.operations.page_reading import read_flat_page, reading_engine
from services.rectify.pipeline import rectify
from services.text.page_text import doubtful_letters

_RIDGE = 0.02
_PARTS = 10
"""Each part of the photos is predicted by a model of the others."""
_UNEVEN_LIGHT = 4.0
"""Set by hand: the photos have no glare."""


def simulated(count: int, seed: int) -> list[Measured]:
    """Measured photos, from the cache if they were measured before."""
    path = OUTPUT / f"advice_{seed}_{count}_pairs_doubt.json"
    if path.is_file():
        return [
            Measured(
                CaptureQuality(**row["quality"]),
                row["error"],
                row["doubtful"],
                tuple(row["focus"]),
                row["group"],
                row["damage"],
            )
            for row in json.loads(path.read_text(encoding="utf-8"))
        ]
    rows = list(measure_photos(count, seed))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([asdict(row) for row in rows], default=float), encoding="utf-8")
    return rows


def fit(qualities: Sequence[CaptureQuality], errors: NDArray[np.float64]) -> ErrorModel:
    """Coefficients of least squared logit distance, drawn to 0 by a ridge.

    No weight is below 0, so that worse figures never make a better photo; that of few pixels may be, as long as smaller
    letters with the same blur are worse all in all.
    """
    cut = np.array([quality.cut_off_fraction for quality in qualities])
    level = 1 - ErrorModel().crooked_lines * np.array([quality.line_tilt_rad for quality in qualities])
    misread = np.clip(1 - (1 - errors) / np.maximum((1 - cut) * level, 0.05), 0.003, 0.997)
    features = np.array([features_of(quality)[:4] for quality in qualities])
    middle, spread = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-9)
    combined = np.column_stack([np.ones(len(errors)), (features - middle) / spread])
    logits = np.log(misread / (1 - misread))

    def loss(weights: NDArray[np.float64]) -> float:
        return float(np.mean((combined @ weights - logits) ** 2) + _RIDGE * np.sum(weights[1:] ** 2))

    letters = {"type": "ineq", "fun": lambda w: w[2] / spread[1] + w[4] / spread[3]}
    bounds = [(None, None), *[(0.0, None)] * 3, (None, None)]
    found = minimize(loss, np.array([-2.0, 1.0, 1.0, 0.3, 0.0]), bounds=bounds, constraints=[letters]).x
    slopes = found[1:] / spread
    constant = float(found[0] - slopes @ middle)
    detail, blur, noise, few_pixels = (round(float(slope), 2) for slope in slopes)
    return ErrorModel(round(constant, 2), detail, blur, noise, few_pixels, _UNEVEN_LIGHT)


def fit_crooked_lines(qualities: Sequence[CaptureQuality], errors: NDArray[np.float64]) -> ErrorModel:
    """The model with the coefficient of crooked lines that has the least absolute distances to the `errors`."""
    without = replace(ErrorModel(), crooked_lines=0.0)
    read = 1 - np.array([predict_damage_error(quality, without) for quality in qualities])
    weights = read * np.maximum([quality.line_tilt_rad for quality in qualities], 1e-6)
    slopes = (errors - 1 + read) / weights
    order = np.argsort(slopes)  # the weighted median
    middle = int(np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2))
    return replace(without, crooked_lines=round(max(float(slopes[order][middle]), 0.0), 2))


def left_out(
    qualities: Sequence[CaptureQuality], errors: NDArray[np.float64], parts: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Errors (N,) that models predict which were fitted to the photos of the other `parts` (N,), not calibrated."""
    predicted = np.zeros(len(errors))
    for part in np.unique(parts):
        model = fit(
            [q for q, own in zip(qualities, parts, strict=True) if own != part], errors[parts != part]
        )
        for index in np.flatnonzero(parts == part):
            predicted[index] = predict_damage_error(qualities[index], model)
    return predicted


def measure(photo: NDArray[np.uint8], lines: Sequence[str]) -> Measured | None:
    """Figures and the measured character error of a whole photo; None if its page was not found."""
    engine, language = reading_engine(None)
    try:
        result = rectify(photo, RectifyParameters(), None, engine)
    except DocumentError:
        return None
    if result.print is None:
        return None
    gray = np.asarray(cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY), np.uint8)
    quality = measure_quality(gray, result.print.characters, result.print.heights_px, result.mesh)
    if quality is None:
        return None
    text = read_flat_page(result.image, engine, language)
    error = 1.0 - character_score(lines, "\n".join(line.text for line in text.lines))
    doubtful = doubtful_letters(text.words)
    return Measured(quality, error, doubtful, usual_focus_measures(gray), "development")


def main(arguments: Sequence[str]) -> int:
    """Print rank correlations, and the fitted coefficients with `--fit`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks advice", description=__doc__)
    parser.add_argument(
        "--photos", type=int, default=192, help="simulated pairs of photos, about 1 CPU s each"
    )
    parser.add_argument("--seed", type=int, default=19)
    parser.add_argument(
        "--fit", action="store_true", help="print coefficients that are fitted to all of them"
    )
    parser.add_argument("--development", action="store_true", help="also the development photos with text")
    asked = parser.parse_args(arguments)
    rows = simulated(asked.photos, asked.seed)
    qualities, errors = [row.quality for row in rows], np.array([row.error for row in rows])
    _report("simulated", rows)
    groups = np.unique([row.group for row in rows], return_inverse=True)[1]
    damages = np.array([row.damage for row in rows])
    _report_chance(damages, errors)
    for name, parts in (("tenths", damages % _PARTS), ("kinds of damage", groups)):
        found = spearmanr(left_out(qualities, errors, parts), errors).statistic
        print(f"  of models without the photo's part, {name}: {found:.3f}")
    if asked.fit:
        print(f"  coefficients of all: {astuple(fit(qualities, errors))}")
    if asked.development:
        own = _development()
        _report("development", own)
        qualities, errors = [row.quality for row in own], np.array([row.error for row in own])
        each = [
            predict_damage_error(
                quality, fit_crooked_lines(qualities[:k] + qualities[k + 1 :], np.delete(errors, k))
            )
            for k, quality in enumerate(qualities)
        ]
        print(f"  of models without the photo, by its lines: {spearmanr(each, errors).statistic:.3f}")
        if asked.fit:
            model = fit_crooked_lines(qualities, errors)
            print(f"  coefficient of crooked lines: {model.crooked_lines}")
    return 0


def _report_chance(damages: NDArray[np.intp], errors: NDArray[np.float64]) -> None:
    pairs = np.array([errors[damages == one] for one in np.unique(damages) if (damages == one).sum() == 2])
    itself = float(spearmanr(*pairs.T).statistic)
    print(
        f"  of the errors of two photos with one damage ({len(pairs)} pairs) {itself:.3f}; "
        f"perfect figures could reach {np.sqrt(itself):.3f}"
    )


def _development() -> list[Measured]:
    rows = []
    folder = data_folder(None)
    texts = sorted(file for name in ("photos", "photos_more") for file in (folder / name).glob("*.txt"))
    for text in texts:
        pictures = [
            text.with_suffix(suffix) for suffix in (".jpg", ".png") if text.with_suffix(suffix).is_file()
        ]
        for picture in pictures[:1]:
            photo = cv2.imread(str(picture))
            rgb = np.ascontiguousarray(photo[:, :, ::-1]).astype(np.uint8)
            found = measure(rgb, text.read_text(encoding="utf-8").splitlines())
            if found is not None:
                rows.append(found)
    return rows


def _report(name: str, rows: Sequence[Measured]) -> None:
    errors, focus = np.array([row.error for row in rows]), np.array([row.focus for row in rows])
    predicted = {
        "photo": [predict_character_error(row.quality) for row in rows],
        "reading": [predict_error_of_reading(row.quality, row.doubtful) for row in rows],
    }
    middle = np.percentile(errors, [25, 50, 75])
    print(
        f"{name}: {len(errors)} photos, character error {middle[0]:.3f}, {middle[1]:.3f}, {middle[2]:.3f} (quartiles)"
    )
    for source, expected in predicted.items():
        off = np.abs(np.array(expected) - errors)
        print(
            f"  rank correlation of the error predicted from the {source} and the measured one "
            f"{spearmanr(expected, errors).statistic:.3f}; off by {100 * np.median(off):.1f} points (median)"
        )
    ranks = [spearmanr(-focus[:, column], errors).statistic for column in range(focus.shape[1])]
    print(f"  of variance of the Laplacian, Tenengrad, Brenner {', '.join(f'{rank:.3f}' for rank in ranks)}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
