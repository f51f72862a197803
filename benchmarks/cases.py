"""The experiment of 2.4: five pages x three skews x four poses = 60 planar photos."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.pages import load_page, own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import PAGE_SIZE, PLANE, POSES, SKEWS_RAD, photograph

CHOSEN_PAGES = ("usrguide", "clsguide", "natbib", "amsldoc", "lion")
"""Pages 1 to 5 where the data is there: single columns, two with code, one with mathematics."""


@dataclass(frozen=True, slots=True)
class Case:
    """One photo of the experiment; `number` seeds its dirt."""

    number: int
    page: str
    page_number: int
    pose: int
    skew: int
    degraded: bool

    @property
    def skew_deg(self) -> int:
        """Of the page in its frame."""
        return round(float(np.degrees(SKEWS_RAD[self.skew])))

    @property
    def name(self) -> str:
        """As figures are filed under."""
        return f"{self.page}_pose{self.pose + 1}_skew{self.skew_deg:+d}" + ("_dirty" if self.degraded else "")


def load_pages(folder: Path, names: tuple[str, ...] = CHOSEN_PAGES) -> tuple[tuple[Page, ...], bool]:
    """The pages, and whether they are the data's (False: of our own setting, the data being absent)."""
    files = [folder / "pages" / f"{name}.png" for name in names]
    if not all(file.is_file() for file in files):
        return own_pages(*PAGE_SIZE), False
    return tuple(load_page(file, *PAGE_SIZE) for file in files), True


def all_cases(pages: tuple[str, ...], *, degraded: bool) -> list[Case]:
    """Pages x skews x poses, in an order in which any first few are varied."""
    combinations = [
        (page, pose, skew)
        for page in range(len(pages))
        for pose in range(len(POSES))
        for skew in range(len(SKEWS_RAD))
    ]
    cases = [
        Case(number, pages[page], page + 1, pose, skew, degraded)
        for number, (page, pose, skew) in enumerate(combinations)
    ]
    order = np.random.default_rng(60).permutation(len(cases))
    return [cases[i] for i in order]


def photograph_case(case: Case, page: Page) -> SimulatedPhoto:
    """The case's photo: clean on black as in the dissertation, or on a desk and dirty."""
    dirt = PHONE if case.degraded else None
    rng = np.random.default_rng(1000 + case.number)
    return photograph(page, POSES[case.pose], SKEWS_RAD[case.skew], PLANE, dirt=dirt, rng=rng)
