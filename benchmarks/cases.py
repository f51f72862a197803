"""The experiments on simulated photos: which pages, shapes, skews and poses each photographs."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

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
    View,
    photograph,
)
from simulation.surfaces import Plane, Shape

CHOSEN_PAGES = ("usrguide", "clsguide", "natbib", "amsldoc", "lion")
"""Pages 1 to 5 where the data is there: single columns, two with code, one with mathematics."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """Every page in every one of these shapes, poses and skews (radians)."""

    name: str
    shapes: tuple[Shape, ...]
    views: tuple[View, ...] = POSES
    skews_rad: tuple[float, ...] = SKEWS_RAD

    def file_name(self, *, degraded: bool) -> str:
        """What its figures are filed under."""
        return f"rectify_{self.name}" + ("_degraded" if degraded else "")


EXPERIMENTS: Mapping[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        Experiment("planar", (PLANE,)),
        Experiment("curved", CURVED_SHAPES),
        Experiment("curvature", CURVATURE_SERIES, POSES[:1], SKEWS_RAD[:1]),
        Experiment("tilt", CURVATURE_SERIES[2:3], TILT_SERIES, SKEWS_RAD[:1]),
        Experiment("cone", (CONE,)),
    )
}
"""With five pages 60 (2.4), 120 (2.4), 35 and 35 (3.4.2) photos; the last 60 are not the dissertation's."""


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
    """Pages x shapes x poses x skews, in an order in which any first few are varied."""
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
    return photograph(
        page,
        experiment.views[case.pose],
        experiment.skews_rad[case.skew],
        experiment.shapes[case.shape],
        dirt=PHONE if case.degraded else None,
        rng=np.random.default_rng(1000 + case.number),
    )
