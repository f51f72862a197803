"""Simulated photos that several tests look at, with their truth and with what the analysis sees in them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from services.arrays import Points, Vector
from services.geometry.photo_frame import PhotoFrame
from services.geometry.vanishing_points import FlowVanishingPoints
from services.rectify.analysis.page_analysis import PageAnalysis, analyse_photo
from services.sheet.evidence import PageEvidence
from services.texture_flow.field import FlowSamples, angle_difference
from services.texture_flow.vanishing_points import estimate_vanishing_points
from simulation.degradation import PHONE, Degradation
from simulation.flat_page import Page
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, CONE, CURVATURE_SERIES, PLANE, POSES, SKEWS_RAD, WAVE, View, photograph
from simulation.surfaces import Shape
from simulation.truth import Truth


class Shot:
    """A photo of a page, and its analysis (made when first asked for)."""

    def __init__(self, photo: SimulatedPhoto) -> None:
        self.photo = photo

    @property
    def truth(self) -> Truth:
        """What is known of the photo."""
        return self.photo.truth

    @property
    def frame(self) -> PhotoFrame:
        """Its size."""
        return PhotoFrame(self.photo.image.shape[1], self.photo.image.shape[0])

    @cached_property
    def analysis(self) -> PageAnalysis:
        """Text and flows."""
        return analyse_photo(self.photo.image)

    @property
    def major(self) -> FlowSamples:
        """Major flow in centred unit coordinates."""
        return self.analysis.major.centred(self.frame)

    @property
    def minor(self) -> FlowSamples:
        """Minor flow in centred unit coordinates."""
        assert self.analysis.minor is not None
        return self.analysis.minor.centred(self.frame)

    @cached_property
    def evidence(self) -> PageEvidence:
        """What a shape is fitted to."""
        return self.analysis.evidence(self.frame)

    @cached_property
    def vanishing_points(self) -> FlowVanishingPoints:
        """Of both flows."""
        return estimate_vanishing_points(self.major, self.minor)

    @cached_property
    def text_points(self) -> Points:
        """Photo points (N, 2) on words, evenly drawn."""
        return self.truth.text_points(np.random.default_rng(1))


@dataclass(frozen=True, slots=True)
class Scene:
    """Which page is photographed how; `width` px of a photo 7 : 9, the page in proportion."""

    page: int
    view: View
    skew_rad: float = 0.0
    shape: Shape = PLANE
    dirt: Degradation | None = None
    width: int = 1050


FRONTAL = View("frontal", 2300.0, 0.0, 0.0, 0.0)

FLAT_SCENES = {
    "plain": Scene(0, POSES[0]),
    "skewed": Scene(1, POSES[1], SKEWS_RAD[1]),
    "picture": Scene(2, POSES[2], SKEWS_RAD[2]),
    "ragged": Scene(3, POSES[3], SKEWS_RAD[1]),
    "columns": Scene(4, POSES[0], SKEWS_RAD[2]),
    "dirty": Scene(1, POSES[2], dirt=PHONE),
    "large": Scene(0, POSES[1], width=1500),
}
CURVED_SCENES = {
    "book": Scene(0, POSES[0], shape=BOOK),
    "wave": Scene(3, POSES[2], SKEWS_RAD[1], WAVE),
    "bent": Scene(0, POSES[0], shape=CURVATURE_SERIES[1]),
}
SCENES = FLAT_SCENES | CURVED_SCENES | {"frontal": Scene(0, FRONTAL), "cone": Scene(1, POSES[1], shape=CONE)}


class Album:
    """The shots of `SCENES` by name, each taken once."""

    def __init__(self) -> None:
        self._shots: dict[str, Shot] = {}
        self._pages: dict[int, tuple[Page, ...]] = {}

    def pages(self, width: int = 800) -> tuple[Page, ...]:
        """The five pages of our own setting, `width` : 25/16 `width` px, a 38th of that to the em."""
        if width not in self._pages:
            self._pages[width] = own_pages(width, round(width * 25 / 16))
        return self._pages[width]

    def __getitem__(self, name: str) -> Shot:
        if name not in self._shots:
            scene = SCENES[name]
            page = self.pages(round(scene.width * 16 / 21))[scene.page]
            size = (scene.width, round(scene.width * 9 / 7))
            rng = np.random.default_rng(5)
            photo = photograph(
                page, scene.view, scene.skew_rad, scene.shape, dirt=scene.dirt, rng=rng, size=size
            )
            self._shots[name] = Shot(photo)
        return self._shots[name]


def errors_deg(found: Vector, truth: Vector) -> Vector:
    """Absolute differences (N,) of directions, degrees."""
    return np.asarray(np.degrees(np.abs(angle_difference(found, truth))))
