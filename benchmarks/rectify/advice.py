"""Predicted and measured character error of photos: rank correlation, and the coefficients of the model.

python -m benchmarks advice [--photos N] [--fit]
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import astuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import spearmanr

from benchmarks.common.places import data_folder
from benchmarks.common.reading import character_score
from services.capture.quality import CaptureQuality, measure_quality
from services.capture.readability import ErrorModel, features_of, predict_character_error
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.operations.page_reading import read_flat_page, reading_engine
from services.rectify.pipeline import rectify
from simulation.degradation import Degradation, Exposure, expose
from simulation.pages import own_pages
from simulation.scenes import View, photograph

_SIZES = (600, 750, 900, 1100, 1400, 1700)
"""Long sides of the photos; print of 10 points is 7 to 23 pixels high in them."""
_RIDGE = 0.02


def make_photos(count: int, seed: int = 19) -> Iterator[tuple[NDArray[np.uint8], list[str]]]:
    """Photos of known text at several distances, blurred, noisy, faint, cut off; with the lines of the page."""
    rng = np.random.default_rng(seed)
    pages = own_pages(800, 1250)
    for index in range(count):
        page = pages[index % len(pages)]
        long_side = int(rng.choice(_SIZES))
        size = (round(long_side * 0.72), long_side)
        view = View("advice", 1.2 * long_side, rng.uniform(0, 35), rng.uniform(0, 360), rng.uniform(-8, 8))
        height = 21 * long_side / 1800
        dirt = Degradation(
            shadow=rng.uniform(0, 0.5),
            blur_sigma_px=float(rng.choice([0.3, 0.6, 0.6, 1.0, 1.5])) * height / 12,
            motion_px=float(rng.choice([0, 0, 0, 0.3, 0.6])) * height,
            noise_sigma=rng.uniform(1, 12),
            jpeg_quality=int(rng.integers(50, 95)),
        )
        photo = photograph(page, view, 0.0, dirt=dirt, rng=rng, size=size).image
        faint = float(rng.choice([1, 1, 1, 0.5, 0.2]))
        photo = np.asarray(255 - (255 - photo.astype(np.float32)) * faint, np.uint8)
        photo = expose(photo, Exposure(gain=rng.uniform(0.5, 1.05)))
        if index % 6 == 5:  # a part of the page is out of view
            photo = np.ascontiguousarray(photo[:, round(size[0] * rng.uniform(0.1, 0.3)) :])
        yield photo, [" ".join(word.text for word in line) for line in page.lines]


def usual_focus_measures(gray: NDArray[np.uint8]) -> tuple[float, float, float]:
    """Variance of the Laplacian, Tenengrad, and Brenner's measure (larger is sharper)."""
    across, down = cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1)
    values = gray.astype(np.float32)
    brenner = float(np.mean((values[:, 2:] - values[:, :-2]) ** 2))
    return float(cv2.Laplacian(gray, cv2.CV_32F).var()), float(np.mean(across**2 + down**2)), brenner


def measure(photo: NDArray[np.uint8], lines: Sequence[str]) -> tuple[CaptureQuality, float] | None:
    """Figures and the measured character error of a photo; None if its page was not found."""
    engine, language = reading_engine(None)
    try:
        result = rectify(photo, RectifyParameters(), None, engine)
    except DocumentError:
        return None
    if result.print is None:
        return None
    gray = np.asarray(cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY), np.uint8)
    quality = measure_quality(gray, result.print.characters, result.print.heights_px, result.mesh)
    text = read_flat_page(result.image, engine, language)
    error = 1.0 - character_score(lines, "\n".join(line.text for line in text.lines))
    if quality is None:
        return None
    print(
        f"{error:.3f} measured, {predict_character_error(quality):.3f} predicted, {astuple(quality)}",
        flush=True,
    )
    return quality, error


def fit(qualities: Sequence[CaptureQuality], errors: NDArray[np.float64]) -> ErrorModel:
    """Coefficients of least squared logit distance, weights not below 0, drawn to 0 by a ridge."""
    cut = np.array([quality.cut_off_fraction for quality in qualities])
    misread = np.clip(1 - (1 - errors) / np.maximum(1 - cut, 0.05), 0.002, 0.998)
    features = np.column_stack([np.ones(len(errors)), [features_of(quality) for quality in qualities]])
    logits = np.log(misread / (1 - misread))

    def loss(weights: NDArray[np.float64]) -> float:
        return float(np.mean((features @ weights - logits) ** 2) + _RIDGE * np.sum(weights[1:] ** 2) / 10)

    bounds = [(None, None), *[(0.0, None)] * 4]
    found = minimize(loss, np.array([-4.0, 1.0, 5.0, 1.0, 2.0]), bounds=bounds).x
    return ErrorModel(*(round(float(weight), 3) for weight in found))


def main(arguments: Sequence[str]) -> int:
    """Print rank correlations, and the fitted coefficients with `--fit`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks advice", description=__doc__)
    parser.add_argument("--photos", type=int, default=24, help="simulated photos")
    parser.add_argument("--fit", action="store_true", help="fit the coefficients to half of the photos")
    parser.add_argument("--development", action="store_true", help="also the development photos with text")
    asked = parser.parse_args(arguments)
    qualities, errors, focus = [], [], []
    for photo, lines in make_photos(asked.photos):
        found = measure(photo, lines)
        if found is not None:
            qualities.append(found[0])
            errors.append(found[1])
            focus.append(usual_focus_measures(np.asarray(cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY), np.uint8)))
    _report("simulated", qualities, np.array(errors), np.array(focus), asked.fit)
    if asked.development:
        _report("development", *_development(), False)
    return 0


def _development() -> tuple[list[CaptureQuality], NDArray[np.float64], NDArray[np.float64]]:
    qualities, errors, focus = [], [], []
    for text in sorted((data_folder(None) / "photos").glob("*.txt")):
        pictures = [
            text.with_suffix(suffix) for suffix in (".jpg", ".png") if text.with_suffix(suffix).is_file()
        ]
        for picture in pictures[:1]:
            photo = cv2.imread(str(picture))
            rgb = np.ascontiguousarray(photo[:, :, ::-1]).astype(np.uint8)
            found = measure(rgb, text.read_text(encoding="utf-8").splitlines())
            if found is not None:
                qualities.append(found[0])
                errors.append(found[1])
                focus.append(
                    usual_focus_measures(np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8))
                )
    return qualities, np.array(errors), np.array(focus)


def _report(
    name: str,
    qualities: list[CaptureQuality],
    errors: NDArray[np.float64],
    focus: NDArray[np.float64],
    fits: bool,
) -> None:
    predicted = [predict_character_error(quality) for quality in qualities]
    print(f"{name}: {len(errors)} photos, character error {np.median(errors):.3f} (median)")
    print(f"  rank correlation of predicted and measured error {spearmanr(predicted, errors).statistic:.3f}")
    ranks = [spearmanr(-focus[:, column], errors).statistic for column in range(focus.shape[1])]
    print(f"  of the best usual focus measure {max(ranks):.3f}")
    if not fits:
        return
    even = np.arange(len(errors)) % 2 == 0
    halves = [
        fit([q for q, own in zip(qualities, part, strict=True) if own], errors[part])
        for part in (even, ~even)
    ]
    held_out = np.array(
        [
            predict_character_error(quality, halves[int(own)])
            for quality, own in zip(qualities, even, strict=True)
        ]
    )
    print(f"  held out (two halves) {spearmanr(held_out, errors).statistic:.3f}")
    print(f"  coefficients of all: {astuple(fit(qualities, errors))}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
