"""Pages that layout recognition is measured on: their true zones, and those of our own segmentation."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import cv2
import numpy as np

from benchmarks.common.memory import Memory
from benchmarks.common.plots import load_picture
from benchmarks.layout.truth import SETS, TITLES_MADE, TITLES_REAL, LabelledPage, load_set
from services.arrays import GrayImage
from services.layout.learning.label_transfer import shared_areas, transfer_labels
from services.layout.page import Page
from services.layout.pipeline import content_features
from services.layout.segmentation import segment_page
from services.ocr.engine import OcrEngine

OTHER_LETTERS = "letters/real_other"
"""Pages with a class and without labelled zones."""

Zones = Literal["true", "own"]
ZONES: tuple[Zones, ...] = get_args(Zones)
Trial = Literal["true zones", "own zones", "true to own", "taught to own"]
TRIALS: dict[Trial, tuple[tuple[Zones, ...], Zones]] = {
    "true zones": (("true",), "true"),
    "own zones": (("own",), "own"),
    "true to own": (("true",), "own"),
    "taught to own": (("true", "own"), "own"),
}
"""What a model learns of each sample, and what it is tested on; the last as the service does with images."""

TEN_COMPONENTS = {
    **{
        label: label
        for label in ("receiver", "subject", "date", "salutation", "body", "enclosure", "ps", "cc")
    },
    "closing": "signature",
    "signature": "signature",
    "typist-initials": "typistinit",
}
"""Labels of letters by the dissertation's ten components (5.6.2); all others are unlabelled."""


@dataclass(frozen=True, slots=True, eq=False)
class Specimen:
    """A page whose zones carry labels and content features.

    `true` are the zones of the data, `own` those of our segmentation with the labels that `transfer_labels` gives
    them; None where it was not segmented. `true` has no zones where the data has none.
    """

    name: str
    source: str
    class_name: str
    image: Path
    true: Page
    own: Page | None = None

    def page(self, zones: Zones) -> Page:
        """The page with one kind of zones; without any where they are not known."""
        if zones == "true":
            return self.true
        return self.own or replace(self.true, zones=())


def load_specimens(data: str | None, limit: int | None = None) -> list[Specimen]:
    """All pages of the shared sets with their true zones, `limit` at most of each set; empty without the data."""
    found = []
    for source in (*SETS, OTHER_LETTERS):
        pages = load_set(source, data)
        found += [_specimen(source, page) for page in _first_of_each(pages, limit)]
    return found


def _first_of_each(pages: Sequence[LabelledPage], limit: int | None) -> list[LabelledPage]:
    """At most `limit` pages of each class: a set of letters holds memos and fax sheets too."""
    taken: dict[str, list[LabelledPage]] = {}
    for page in pages:
        taken.setdefault(page.class_name, []).append(page)
    return [page for group in taken.values() for page in group[:limit]]


def _specimen(source: str, page: LabelledPage) -> Specimen:
    true = content_features().measure_page(page.page)
    return Specimen(page.name, source, page.class_name, page.image, true)


def load_gray(path: Path) -> GrayImage:
    """Gray levels of a picture as the service makes them of its colours."""
    return np.asarray(cv2.cvtColor(load_picture(path), cv2.COLOR_RGB2GRAY), np.uint8)


def segmented(specimen: Specimen, engine: OcrEngine | None, memory: Memory) -> Specimen:
    """With zones of our own segmentation, of the words that the engine reads if there is one."""
    gray = load_gray(specimen.image)
    words = None if engine is None else memory.page_words(engine, gray)
    found = content_features().measure_page(segment_page(gray, words))
    return replace(specimen, own=transfer_labels(specimen.true, found))


Lesson = tuple[Page, Page | None]
"""What a model learns of a sample: the verified page, and the page in our own zones if they are told apart."""


def lessons(specimens: Iterable[Specimen], learned: Sequence[Zones]) -> list[Lesson]:
    """What a model learns of these samples by their zones of these kinds; samples without zones are left out."""
    found: list[Lesson] = []
    for specimen in specimens:
        verified = specimen.page(learned[0])
        other = specimen.page(learned[1]) if len(learned) > 1 else None
        if verified.zones:
            taught = other is not None and any(zone.label is not None for zone in other.zones)
            found.append((verified, other if taught else None))
    return found


def of_sources(specimens: Iterable[Specimen], sources: Sequence[str]) -> list[Specimen]:
    return [specimen for specimen in specimens if specimen.source in sources]


def by_class(specimens: Iterable[Specimen]) -> dict[str, list[Specimen]]:
    """Pages with labelled zones of every class: the publications, "letter" (real and made), "memo", "fax"."""
    classes: dict[str, list[Specimen]] = {}
    for specimen in specimens:
        if specimen.source != OTHER_LETTERS:
            classes.setdefault(specimen.class_name, []).append(specimen)
    return classes


def by_kind(specimens: Iterable[Specimen]) -> dict[str, list[Specimen]]:
    """Pages with labelled zones of the four kinds "title-page", "letter", "memo" and "fax"."""
    kinds: dict[str, list[Specimen]] = {}
    for specimen in specimens:
        if specimen.source != OTHER_LETTERS:
            titles = specimen.source in (*TITLES_REAL, *TITLES_MADE)
            kinds.setdefault("title-page" if titles else specimen.class_name, []).append(specimen)
    return kinds


def with_ten_components(page: Page) -> Page:
    """A letter whose zones have the labels of the dissertation's components, None for all others."""
    zones = tuple(replace(zone, label=TEN_COMPONENTS.get(zone.label or "")) for zone in page.zones)
    return replace(page, zones=zones)


def area_labelled(truth: Page, found: Page) -> tuple[float, float, int, int]:
    """How much of the true zones carries its label on the found zones.

    Returns
    -------
    Area of the true zones that found zones of the same label cover, and all their area, square pixels; number of
    true zones that are so covered by half, and of all.
    """
    if not truth.zones:
        return 0.0, 0.0, 0, 0
    boxes = np.array([zone.box for zone in truth.zones], dtype=np.float64)
    areas = np.maximum(np.prod(boxes[:, 2:] - boxes[:, :2], axis=1), 1.0)
    if not found.zones:
        return 0.0, float(areas.sum()), 0, len(areas)
    same = np.array([[a.label == b.label for b in found.zones] for a in truth.zones])
    covered = np.minimum(np.where(same, shared_areas(truth.zones, found.zones), 0.0).sum(axis=1), areas)
    return (
        float(covered.sum()),
        float(areas.sum()),
        int(np.count_nonzero(covered >= 0.5 * areas)),
        len(areas),
    )
