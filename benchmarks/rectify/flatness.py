"""The error of the mesh that a view expects of itself beside the true one, on right shapes and on losing ones.

python -m benchmarks flatness [--scenes N] [--first N] [--fit] [--update-baseline]

Simulated sheets (flat, smooth, folded, crumpled; many poses, sizes in the frame and skews, with and without sides in
view) are shaped in every way that the service knows: its own choice, the plane, the smooth sheet, the creased one, and
these with a wrong focal length. So most views are wrong on purpose. Every second scene is held out: `--fit` prints the
coefficients of the others.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import spearmanr

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.places import BASELINE, data_folder
from benchmarks.common.residuals import mesh_residual_percent
from benchmarks.rectify.cases import load_pages
from benchmarks.rectify.sheet_experiments import CROSSED, CRUMPLED, FOLDED, GENTLE, LAMPS
from services.arrays import RgbImage, Vector
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_frame import mesh_of
from services.rectify.analysis.focal_length import requested_prior
from services.rectify.page_search import find_page
from services.rectify.shape_choice.hypotheses import Hypotheses
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.stage_clock import StageClock
from services.rectify.view.flatness import FLOOR_PERCENT, GAIN
from services.rectify.view.judged_view import judge_view
from services.sheet.plane.outline_plane import read_sides
from services.sheet.shape import PageShape
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, CONE, CURVATURE_SERIES, PLANE, POSES, WAVE, View
from simulation.sheets import SHEET_VIEWS, photograph_sheet, with_margins
from simulation.surfaces import Shape

_PAGES = ("usrguide", "clsguide", "natbib", "amsldoc", "lion", "revtex", "quantum")
_KINDS: tuple[tuple[str, float, tuple[Shape, ...]], ...] = (
    ("flat", 0.33, (PLANE,)),
    ("smooth", 0.4, (BOOK, WAVE, CONE, *CURVATURE_SERIES, *GENTLE)),
    ("folded", 0.13, FOLDED),
    ("creased", 0.14, (*CROSSED, *CRUMPLED)),
)
_MARGINS = (("whole", 0.4, 0.05), ("two thirds", 0.2, 0.16), ("half", 0.1, 0.25), ("close", 0.3, 0.05))
"""Part of the frame that the sheet takes, share of the scenes, margin round it; "close": no side is in view."""
_SIZES = ((1500, 2000), (2100, 2700))
_WRONG_FOCAL = 0.35
"""Of the logarithm, up or down."""
WRONG_PERCENT, RIGHT_PERCENT = 1.0, 0.3
"""Views that are off by more must be warned of, views that are off by less must not."""
METRICS = {"log_ratio": Metric(0.05), "wrongly_judged": Metric(0.02)}
"""Figures of a view that are compared with the committed ones."""


@dataclass(frozen=True, slots=True)
class JudgedHypothesis:
    """One view of a scene: its true error, what it asks for and expects, in percent of the page's width."""

    scene: int
    name: str
    true: float
    asked: float
    expected: float
    warned: bool


def simulate_scene(number: int, pages: Sequence[Page]) -> tuple[str, SimulatedPhoto]:
    """What the scene is, and its photo; every third knows its focal length."""
    rng = np.random.default_rng(number)
    kind, _, shapes = _KINDS[rng.choice(len(_KINDS), p=[share for _, share, _ in _KINDS])]
    size_name, _, margin = _MARGINS[rng.choice(len(_MARGINS), p=[share for _, share, _ in _MARGINS])]
    page, shape = pages[rng.integers(len(pages))], shapes[rng.integers(len(shapes))]
    held = (*SHEET_VIEWS, *POSES)[rng.integers(len(SHEET_VIEWS) + len(POSES))]
    tilt = held.tilt_deg * rng.uniform(0.3, 1.1)
    view = View(held.name, rng.uniform(1900, 3000), tilt, rng.uniform(0, 360), rng.uniform(-12, 12))
    lamp = replace(LAMPS[rng.integers(len(LAMPS))], margin=margin, close=size_name == "close")
    skew = float(np.radians(rng.choice([0.0, 0.0, 0.0, 1.5, -1.0])))
    size = _SIZES[rng.integers(len(_SIZES))]
    photo = photograph_sheet(
        with_margins(page), view, shape, lamp, dirt=PHONE, rng=rng, skew_rad=skew, size=size
    )
    return f"{number} {kind} {size_name} {page.name}", photo


def hypotheses(photo: RgbImage, exif_px: float | None, number: int) -> Iterator[tuple[str, ShapedPage]]:
    """The service's page, then the same page by every other shape."""
    page = find_page(photo, RectifyParameters(), exif_px, StageClock())
    yield "chosen", page
    if page.analysis is None:
        return
    evidence, outline = page.analysis.evidence(page.view), page.outline
    prior = requested_prior(page.view, RectifyParameters(), exif_px)
    off = FocalPrior(prior.log_focal + (_WRONG_FOCAL if number % 2 else -_WRONG_FOCAL), 0.02, "given")
    found: dict[str, PageShape | None] = {}
    for name, known in (("", prior), (" wrong focal length", off)):
        fits = Hypotheses(evidence, known, "planar", outline, read_sides(outline, page.view, known))
        found["plane" + name] = fits.plane
        found["smooth" + name] = fits.smooth_by_text
        found["smooth, sides" + name] = fits.smooth
        if not name:
            found["creased"] = fits.creased
    for name, shape in found.items():
        if shape is not None:
            yield name, replace(page, shape=shape)


def judge_scene(number: int, pages: Sequence[Page]) -> tuple[str, list[JudgedHypothesis]]:
    """All views of a scene, each once."""
    name, photo = simulate_scene(number, pages)
    exif_px = photo.truth.camera.focal_length_px if number % 3 == 0 else None
    found: dict[float, JudgedHypothesis] = {}
    for shape, page in hypotheses(photo.image, exif_px, number):
        view = judge_view(photo.image, page, "sheet")
        mesh = np.asarray(mesh_of(view.frame), np.float64)
        true = mesh_residual_percent(mesh, view.frame.width, view.frame.height, photo.truth)
        if view.flatness is not None and np.isfinite(true):
            asked, expected = view.flatness.asked_percent, view.flatness.error_percent
            judged = JudgedHypothesis(number, shape, true, asked, expected, not view.flatness.passes)
            found.setdefault(round(true, 6), judged)
    return name, list(found.values())


def fit_calibration(asked: Vector, true: Vector) -> tuple[float, float]:
    """Floor and gain for which hypot(floor, gain asked) is nearest to `true`, by the mean distance of logarithms."""
    floors, gains = np.geomspace(0.005, 0.3, 60), np.geomspace(0.5, 6.0, 60)
    misses = [
        (float(np.mean(np.abs(np.log(np.hypot(floor, gain * asked) / np.maximum(true, 0.02))))), floor, gain)
        for floor in floors
        for gain in gains
    ]
    _, floor, gain = min(misses)
    return float(floor), float(gain)


def describe(name: str, views: Sequence[JudgedHypothesis]) -> str:
    """Shares of wrong views that are warned of and of right ones that are, and how well the errors agree."""
    true, expected = (np.array([getattr(view, part) for view in views]) for part in ("true", "expected"))
    warned, wrong, right = np.array([v.warned for v in views]), true > WRONG_PERCENT, true < RIGHT_PERCENT
    ratio = np.log(expected / np.maximum(true, 0.02))
    low, middle, high = np.exp(np.percentile(ratio, [16, 50, 84]))
    return (
        f"{name}: {len(views)} views; off by more than {WRONG_PERCENT} %: warned of {warned[wrong].sum()} of "
        f"{wrong.sum()}; within {RIGHT_PERCENT} %: {warned[right].sum()} of {right.sum()}; rank correlation "
        f"{spearmanr(true, expected)[0]:.3f}; expected over true {middle:.2f} ({low:.2f} to {high:.2f})"
    )


def main(arguments: Sequence[str]) -> int:
    """Print a line a scene, the shares and the coefficients; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks flatness", description=__doc__)
    parser.add_argument("--scenes", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--fit", action="store_true", help="print the calibration by every second scene")
    parser.add_argument("--update-baseline", action="store_true")
    asked = parser.parse_args(arguments)
    pages = (*own_pages(), *load_pages(data_folder(None), _PAGES)[0])
    views: list[JudgedHypothesis] = []
    figures: Figures = {}
    for number in range(asked.first, asked.first + asked.scenes):
        try:
            name, found = judge_scene(number, pages)
        except (NoText, ValueError) as error:
            print(f"{number}: {error}")
            continue
        views += found
        told = "  ".join(f"{view.name} {view.true:.2f} ({view.expected:.2f})" for view in found)
        print(f"{name}: {told}", flush=True)
        for view in found:
            missed = view.true > WRONG_PERCENT and not view.warned
            wrongly = missed or (view.true < RIGHT_PERCENT and view.warned)
            ratio = abs(np.log(view.expected / max(view.true, 0.02)))
            figures[f"{name} {view.name}"] = {"log_ratio": float(ratio), "wrongly_judged": float(wrongly)}
    fitted, held_out = ([view for view in views if view.scene % 2 == odd] for odd in (0, 1))
    print(describe("all", views), describe("every second, held out", held_out), sep="\n")
    if asked.fit:
        floor, gain = fit_calibration(
            *(np.array([getattr(v, part) for v in fitted]) for part in ("asked", "true"))
        )
        print(f"FLOOR_PERCENT = {floor:.3f} (now {FLOOR_PERCENT}), GAIN = {gain:.2f} (now {GAIN})")
    report, fine = judge(BASELINE / "flatness.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
