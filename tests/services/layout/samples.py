"""Pages for the tests of layout graphs: simulated ones with their truth, and boxes by hand."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from services.layout.model.layout_model import LayoutModel
from services.layout.page import Box, Page, Zone
from services.layout.pipeline import VersionedModel, content_features, initialize_model
from simulation.labelled_pages import LabelledPage, fax_page, letter_page, memo_page, title_page

MAKERS: dict[str, Callable[..., LabelledPage]] = {
    "letter": letter_page,
    "memo": memo_page,
    "fax": fax_page,
    "plain": partial(title_page, journal="plain"),
    "two-column": partial(title_page, journal="two-column"),
    "margin": partial(title_page, journal="margin"),
}
FIRST_UNSEEN = 1000
"""Seeds of pages that no model was made of start here."""


@lru_cache(maxsize=256)
def labelled_page(document_class: str, seed: int) -> Page:
    """A simulated page with the true labels of its zones, its content features measured."""
    return page_from(MAKERS[document_class](np.random.default_rng(seed), draw=False))


def page_from(page: LabelledPage) -> Page:
    """The same of any simulated page."""
    zones = tuple(
        Zone(
            id=zone.id,
            box=tuple(float(value) for value in zone.box),
            kind=zone.kind,
            lines=zone.lines,
            font_size=zone.font_size or None,
            text=zone.text,
            label=zone.label,
        )
        for zone in page.zones
    )
    return content_features().measure_page(Page(page.width, page.height, zones))


@lru_cache(maxsize=32)
def model_of(document_class: str, samples: int) -> LayoutModel:
    """The model that `samples` simulated pages of a class give."""
    return initialize_model(document_class, [labelled_page(document_class, seed) for seed in range(samples)])


def models_of_all(samples: int) -> list[VersionedModel]:
    return [VersionedModel(model_of(name, samples), 1) for name in MAKERS]


def page_of(*boxes: Box, width: float = 1000.0, height: float = 1000.0, **known: object) -> Page:
    """A page with zones z0, z1 ... that differ in their boxes alone."""
    zones = tuple(Zone(id=f"z{k}", box=box, **known) for k, box in enumerate(boxes))  # type: ignore[arg-type]
    return Page(width, height, zones)


def scaled(page: Page, factor: float) -> Page:
    """The page as another resolution has it."""

    def times(value: float | None) -> float | None:
        return None if value is None else value * factor

    zones = tuple(
        replace(
            zone,
            box=tuple(value * factor for value in zone.box),
            font_size=times(zone.font_size),
            line_spacing=times(zone.line_spacing),
        )
        for zone in page.zones
    )
    return Page(page.width * factor, page.height * factor, zones)


def permuted(page: Page, order: np.ndarray) -> Page:
    return replace(page, zones=tuple(page.zones[int(index)] for index in order))
