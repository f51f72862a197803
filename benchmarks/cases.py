"""The experiments on simulated photos: which pages, shapes, skews and poses each photographs."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.experiments import Experiment
from benchmarks.sheet_experiments import SHEET_EXPERIMENTS
from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.pages import load_page, own_pages
from simulation.photo import SimulatedPhoto
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
from simulation.sheets import photograph_sheet, with_margins
from simulation.surfaces import Plane

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

    `number` seeds its dirt; `rank` is its place in an order in which any first few are varied.
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


def all_cases(experiment: Experiment, pages: tuple[str, ...], *, degraded: bool) -> list[Case]:
    """Pages x shapes x poses x skews, or each shape once, in an order in which any first few are varied."""
    if experiment.stagings:
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


def photograph_case(case: Case, page: Page) -> SimulatedPhoto:
    """The case's photo: clean on black as in the dissertation, or on a desk and dirty."""
    experiment = case.experiment
    if experiment.stagings:
        return _photograph_sheet(case, page)
    return photograph(
        page,
        experiment.views[case.pose],
        experiment.skews_rad[case.skew],
        experiment.shapes[case.shape],
        dirt=PHONE if case.degraded else None,
        rng=np.random.default_rng(1000 + case.number),
    )


def _each_shape_once(experiment: Experiment, pages: tuple[str, ...], *, degraded: bool) -> list[Case]:
    count = len(experiment.shapes)
    order = np.random.default_rng(60).permutation(count).tolist()
    views, skews = len(experiment.views), len(experiment.skews_rad)
    return [
        Case(
            experiment, number, pages[number % len(pages)], number % len(pages) + 1, number, number % views,
            number % skews, degraded, rank,
        )
        for rank, number in enumerate(order)
    ]  # fmt: skip


def _photograph_sheet(case: Case, page: Page) -> SimulatedPhoto:
    experiment = case.experiment
    staging = experiment.stagings[case.number % len(experiment.stagings)]
    return photograph_sheet(
        with_margins(page),
        experiment.views[case.pose],
        experiment.shapes[case.shape],
        staging if case.degraded else replace(staging, ground="black"),
        dirt=PHONE if case.degraded else None,
        rng=np.random.default_rng(1000 + case.number),
        skew_rad=experiment.skews_rad[case.skew],
    )
