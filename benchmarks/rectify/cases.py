"""The experiments on simulated photos: which pages, shapes, skews and poses each photographs."""

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.rectify.experiments import Experiment
from benchmarks.rectify.sheet_experiments import SHEET_EXPERIMENTS
from simulation.cropping import crop_photo
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.pages import load_page, own_pages
from simulation.photo import SimulatedPhoto
from simulation.picture_pages import PICTURE_PAGES, picture_page
from simulation.scenes import (
    CONE,
    CURVATURE_SERIES,
    CURVED_SHAPES,
    PAGE_SIZE,
    PLANE,
    POSES,
    SKEWS_RAD,
    TILT_SERIES,
    photograph,
)
from simulation.sheets import Staging, photograph_sheet, with_margins
from simulation.spreads import photograph_spread
from simulation.surfaces import Plane

T = TypeVar("T")

CHOSEN_PAGES = ("usrguide", "clsguide", "natbib", "amsldoc", "lion")
"""Pages 1 to 5 where the data is there: single columns, two with code, one with mathematics."""


EXPERIMENTS: Mapping[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        Experiment("planar", (PLANE,)),
        Experiment("curved", CURVED_SHAPES),
        Experiment("curvature", CURVATURE_SERIES, POSES[:1], SKEWS_RAD[:1]),
        Experiment("tilt", CURVATURE_SERIES[2:3], TILT_SERIES, SKEWS_RAD[:1]),
        Experiment("cone", (CONE,)),
        *SHEET_EXPERIMENTS,
    )
}
"""With five pages 60 (2.4), 120 (2.4), 35 and 35 (3.4.2) photos; `cone` and what follows are not the dissertation's."""


@dataclass(frozen=True, slots=True)
class Case:
    """One photo of an experiment. Shape, pose and skew are indices into it.

    `number` seeds its dirt; `rank` is its place in an order in which any first few are varied. `facing` is the
    other page of an opened book.
    """

    experiment: Experiment
    number: int
    page: str
    page_number: int
    shape: int
    pose: int
    skew: int
    degraded: bool
    rank: int
    facing: str = ""

    @property
    def skew_deg(self) -> int:
        """Of the page in its frame."""
        return round(float(np.degrees(self.experiment.skews_rad[self.skew])))

    @property
    def is_planar(self) -> bool:
        """Whether the page is flat."""
        return isinstance(self.experiment.shapes[self.shape], Plane)

    @property
    def name(self) -> str:
        """As figures are filed under."""
        shape = f"_shape{self.shape + 1}" if len(self.experiment.shapes) > 1 else ""
        dirt = "_dirty" if self.degraded else ""
        return f"{self.page}{shape}_pose{self.pose + 1}_skew{self.skew_deg:+d}{dirt}"


def load_pages(folder: Path, names: tuple[str, ...] = CHOSEN_PAGES) -> tuple[tuple[Page, ...], bool]:
    """The pages, and whether they are the data's (False: of our own setting, the data being absent)."""
    files = [folder / "pages" / f"{name}.png" for name in names]
    if not all(file.is_file() for file in files):
        return own_pages(*PAGE_SIZE), False
    return tuple(load_page(file, *PAGE_SIZE) for file in files), True


def load_own_pages(folder: Path, names: Iterable[str]) -> tuple[Page, ...]:
    """The pages that experiments name: pictures of our own, or the data's; our own two columns where that is absent."""
    found = []
    for name in names:
        file = folder / "pages" / f"{name}.png"
        if name in PICTURE_PAGES:
            found.append(picture_page(name))
        elif file.is_file():
            found.append(load_page(file, *PAGE_SIZE))
        else:
            found.append(replace(own_pages(*PAGE_SIZE)[-1], name=name))
    return tuple(found)


def all_cases(experiment: Experiment, pages: tuple[str, ...], *, degraded: bool) -> list[Case]:
    """Pages x shapes x poses x skews, or each shape once, in an order in which any first few are varied."""
    pages = experiment.pages or pages
    if experiment.once:
        return _each_shape_once(experiment, pages, degraded=degraded)
    combinations = itertools.product(
        range(len(pages)), range(len(experiment.shapes)), range(len(experiment.views)),
        range(len(experiment.skews_rad)),
    )  # fmt: skip
    indices = list(combinations)
    order = np.random.default_rng(60).permutation(len(indices)).tolist()
    return [
        Case(experiment, number, pages[page], page + 1, shape, pose, skew, degraded, rank)
        for rank, number in enumerate(order)
        for page, shape, pose, skew in (indices[number],)
    ]


def photograph_case(case: Case, page: Page, facing: Page | None = None) -> SimulatedPhoto:
    """The case's photo: clean on black as in the dissertation, or on a desk and dirty.

    Of a spread `facing` is the other page; without it the case's page is photographed alone, at its place.
    """
    experiment = case.experiment
    if experiment.is_spread:
        return _photograph_spread(case, page, facing)
    if experiment.stagings:
        return _photograph_sheet(case, page)
    photo = photograph(
        page,
        experiment.views[case.pose],
        experiment.skews_rad[case.skew],
        experiment.shapes[case.shape],
        dirt=PHONE if case.degraded else None,
        rng=np.random.default_rng(1000 + case.number),
    )
    return crop_photo(photo, _turn(experiment.cuts, case)) if experiment.cuts else photo


def _each_shape_once(experiment: Experiment, pages: tuple[str, ...], *, degraded: bool) -> list[Case]:
    count = len(experiment.shapes)
    # Both pages of a book share their pose; the others take turns.
    photos = [number // 2 if experiment.is_spread else number for number in range(count)]
    order = np.random.default_rng(60).permutation(count).tolist()
    views, skews = len(experiment.views), len(experiment.skews_rad)
    return [
        Case(
            experiment, number, pages[number % len(pages)], number % len(pages) + 1, number,
            photos[number] % views, number % skews, degraded, rank,
            pages[(number ^ 1) % len(pages)] if experiment.is_spread else "",
        )
        for rank, number in enumerate(order)
    ]  # fmt: skip


def _photograph_sheet(case: Case, page: Page) -> SimulatedPhoto:
    experiment = case.experiment
    return photograph_sheet(
        page if page.name in PICTURE_PAGES else with_margins(page),
        experiment.views[case.pose],
        experiment.shapes[case.shape],
        _staging(case),
        dirt=PHONE if case.degraded else None,
        rng=np.random.default_rng(1000 + case.number),
        skew_rad=experiment.skews_rad[case.skew],
    )


def _photograph_spread(case: Case, page: Page, facing: Page | None) -> SimulatedPhoto:
    """Both pages in one photo, the truth that of the case's page; or this page alone."""
    side = case.number % 2
    own = with_margins(page)
    other = own if facing is None else with_margins(facing)
    left, right = (own, other) if side == 0 else (other, own)
    photos = photograph_spread(
        left,
        right,
        case.experiment.views[case.pose],
        case.experiment.shapes[case.shape],
        _staging(case),
        dirt=PHONE if case.degraded else None,
        # Both pages of a book are cases, of one photo.
        rng=np.random.default_rng(1000 + case.number // 2),
        only=side if facing is None else None,
    )
    return photos[side]


def _staging(case: Case) -> Staging:
    staging = _turn(case.experiment.stagings, case)
    return staging if case.degraded else replace(staging, ground="black")


def _turn(choices: tuple[T, ...], case: Case) -> T:
    number = case.number // 2 if case.experiment.is_spread else case.number
    return choices[number % len(choices)]
