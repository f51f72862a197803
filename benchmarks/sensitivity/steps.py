"""The steps that are studied: which packages, on which few reduced cases, and how an answer is judged."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.residuals import mesh_residual_percent
from benchmarks.mosaic.cases import HomographyMap, MosaicCase, TrueSet, load_case
from benchmarks.mosaic.errors import FALSE_PX, measure_placement
from benchmarks.rectify.cases import load_pages
from benchmarks.rectify.sheet_experiments import CRUMPLED, FOLDED, GENTLE, LAMPS
from benchmarks.sensitivity.replay import digest
from services.arrays import RgbImage
from services.contract.mosaic import MosaicParameters
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.mosaic.pipeline import mosaic
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.pipeline import rectify
from simulation.degradation import PHONE
from simulation.flat_page import Page as FlatPage
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, PLANE, POSES, SKEWS_RAD, View, photograph
from simulation.sheets import SHEET_VIEWS, photograph_sheet, with_margins
from simulation.spread import page_beside_gutter, photograph_spread
from simulation.surfaces import Shape
from simulation.truth import Truth


@dataclass(frozen=True, slots=True)
class Outcome:
    """`error` against the truth (less is better), and a digest by which two answers are compared."""

    error: float
    answer: bytes | None


Case = Callable[[], Outcome]


@dataclass(frozen=True, slots=True)
class Step:
    """A step: its fields are those of `studied`; functions of `packages` may be replayed."""

    name: str
    studied: tuple[str, ...]
    packages: tuple[str, ...]
    error: str
    cases: Callable[[Path], Mapping[str, Case]]


PHOTO_SIZE = (840, 1080)
"""Width and height of the photos, px: text is 7 to 9 px high, the least that every step still works on."""
WORST_MESH_PERCENT = 5.0
"""What a refusal counts as, and the most that any answer does."""


def rectify_cases(data: Path) -> Mapping[str, Case]:
    """Six photos: flat, flat and oblique, a book's page, a gently bent sheet, a folded and a crumpled one."""
    pages, _ = load_pages(data)

    def filling(page: FlatPage, pose: int, skew: int, shape: Shape) -> Case:
        rng = np.random.default_rng(pose)
        skew_rad = SKEWS_RAD[skew]
        return _rectification(
            photograph(page, POSES[pose], skew_rad, shape, dirt=PHONE, rng=rng, size=PHOTO_SIZE)
        )

    def sheet(page: FlatPage, number: int, shape: Shape) -> Case:
        rng = np.random.default_rng(number)
        view, lamp = SHEET_VIEWS[number], LAMPS[number]
        return _rectification(
            photograph_sheet(with_margins(page), view, shape, lamp, dirt=PHONE, rng=rng, size=PHOTO_SIZE)
        )

    # Each of the first three has another shape: --cases 3 is the quickest varied choice.
    return {
        "oblique": filling(pages[1], 3, 0, PLANE),
        "book": filling(pages[2], 1, 0, BOOK),
        "folded": sheet(pages[0], 1, FOLDED[0]),
        "flat": filling(pages[0], 0, 1, PLANE),
        "gentle": sheet(pages[3], 0, GENTLE[1]),
        "crumpled": sheet(pages[1], 2, CRUMPLED[0]),
    }


def _rectification(photo: SimulatedPhoto) -> Case:
    def run() -> Outcome:
        try:
            answer = rectify(photo.image, RectifyParameters(), None, None)
        except DocumentError as error:
            return Outcome(WORST_MESH_PERCENT, digest(error.code))
        height, width = answer.image.shape[:2]
        error_percent = mesh_residual_percent(answer.mesh, width, height, photo.truth)
        capped = min(error_percent, WORST_MESH_PERCENT) if np.isfinite(error_percent) else WORST_MESH_PERCENT
        return Outcome(capped, digest(answer.mesh.tobytes(), answer.image.tobytes()))

    return run


SPREAD_SIZE = (1200, 880)
"""Width and height of a photo of two pages, px."""
BINDINGS = (
    (14.0, 80.0, (0.7, 0.5)),
    (24.0, 250.0, (0.4, 0.8)),
    (4.0, 170.0, (0.3, 0.3)),
    (20.0, 10.0, (0.8, 0.4)),
)
"""Tilt and its direction in degrees, and how far each page rises beside the gutter."""
SEEN_WIDTHS = (1.0, 0.72, 0.6)
"""Shares of the photo that are left when its right end is cut off: two pages, one and a part, one and a strip."""


def page_cases(data: Path) -> Mapping[str, Case]:
    """Opened books of one and of two columns, whole and with the right page cut off by the end of the photo."""
    pages = own_pages(560, 880)
    cases: dict[str, Case] = {}
    for number, (tilt, direction, rises) in enumerate(BINDINGS):
        shapes = tuple(
            page_beside_gutter(rise, 0.1, right=right)
            for rise, right in zip(rises, (False, True), strict=True)
        )
        spread = photograph_spread(
            (pages[number], pages[(number + 3) % len(pages)]),
            View(f"book {number}", 2400.0, tilt, direction, 2.0 * number - 3.0),
            (shapes[0], shapes[1]),
            dirt=PHONE,
            rng=np.random.default_rng(number),
            size=SPREAD_SIZE,
        )
        for share in SEEN_WIDTHS:
            seen = np.ascontiguousarray(spread.image[:, : round(share * SPREAD_SIZE[0])])
            cases[f"{number} {share:g}"] = partial(_choose, seen, (spread.left, spread.right))
    return cases


def _choose(photo: RgbImage, truths: tuple[Truth, Truth]) -> Outcome:
    """Characters that are kept although they are on the other page than most of them, %."""
    try:
        analysis = analyse_photo(photo)
    except DocumentError as error:
        return Outcome(50.0, digest(error.code))
    on_page = [truth.on_page(analysis.characters).mean() for truth in truths]
    return Outcome(100.0 * float(min(on_page)), digest(analysis.characters.tobytes()))


MOSAIC_SETS = ("n2_o20_0_patent", "n2_o40_2_ieee")
SMALL_PHOTO = 0.5


def mosaic_cases(data: Path) -> Mapping[str, Case]:
    """Two sets of two photos at half size; none where the data has none."""
    cases: dict[str, Case] = {}
    for name in MOSAIC_SETS:
        if (data / "mosaic" / name / "truth.json").is_file():
            truth = _reduced_set(load_case(MosaicCase("shared", 2, 0.0, name), data, {}))
            cases[name] = partial(_assemble, truth)
    return cases


def _reduced_set(truth: TrueSet) -> TrueSet:
    photos = tuple(
        np.asarray(
            cv2.resize(photo, None, fx=SMALL_PHOTO, fy=SMALL_PHOTO, interpolation=cv2.INTER_AREA), np.uint8
        )
        for photo in truth.photos
    )
    shift = 0.5 * SMALL_PHOTO - 0.5
    H_small_photo = np.array([[SMALL_PHOTO, 0.0, shift], [0.0, SMALL_PHOTO, shift], [0.0, 0.0, 1.0]])
    maps = [each for each in truth.maps if isinstance(each, HomographyMap)]
    reduced = tuple(
        HomographyMap(H_small_photo @ each.H_photo_page, photo.shape[1], photo.shape[0])
        for each, photo in zip(maps, photos, strict=True)
    )
    return replace(truth, photos=photos, maps=reduced)


def _assemble(truth: TrueSet) -> Outcome:
    try:
        answer = mosaic(truth.photos, MosaicParameters(upright=False), None, None)
    except DocumentError as error:
        return Outcome(FALSE_PX, digest(error.code))
    errors = measure_placement(truth, [patch.mesh for patch in answer.patches])
    wrong = errors.false or errors.placed < len(truth.photos) or not np.isfinite(errors.rms_px)
    return Outcome(FALSE_PX if wrong else min(errors.rms_px, FALSE_PX), digest(answer.image.tobytes()))


_PLANE = ("services.texture_flow", "services.imaging", "services.geometry", "services.sheet")
STEPS = {
    step.name: step
    for step in (
        Step(
            "rectify",
            ("services.rectify", *_PLANE),
            ("services.rectify", *_PLANE),
            "mesh against the truth, RMS, % of the page's width",
            rectify_cases,
        ),
        Step(
            "page_choice",
            (
                "services.rectify.analysis.page_choice",
                "services.rectify.analysis.gutter",
                "services.imaging.long_edges",
            ),
            ("services.rectify", *_PLANE),
            "characters of the facing page, %",
            page_cases,
        ),
        Step(
            "mosaic",
            ("services.mosaic",),
            ("services.mosaic", "services.rectify", *_PLANE),
            "photos' places against the truth, RMS, px at 300 dpi",
            mosaic_cases,
        ),
    )
}
