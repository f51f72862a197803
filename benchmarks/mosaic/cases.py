"""The sets of photos that mosaics are made of: those of the data, and sets of our own."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.plots import load_picture
from benchmarks.rectify.sheet_experiments import FOLDED
from services.arrays import RgbImage
from services.geometry.homographies import denominators, transform_points
from simulation.flat_page import Page, Points
from simulation.letter_pages import letter_pages
from simulation.mosaic_sets import GENTLE_CURVE, OVERLAPS, photograph_set
from simulation.pages import load_page
from simulation.scenes import BOOK, CONE, WAVE
from simulation.surfaces import Shape
from simulation.truth import Truth

COUNTS = (2, 4, 8)
REPEATS = 3
BENT: dict[str, Shape | None] = {
    "gentle": GENTLE_CURVE,
    "book": BOOK,
    "wave": WAVE,
    "cone": CONE,
    "folded": None,
}
"""Kinds of bent sheets; each folded one is folded otherwise."""
BENT_SETS = 6
"""Of each kind."""
PAGES = ("amsldoc", "aastex", "patent", "natbib", "quantum", "revtex", "usrguide", "clsguide", "lion", "apa7")
"""Flat pages of the data, where it is there: one and two columns, code, tables, mathematics."""


class PageMap(Protocol):
    """Where page and photo show the same."""

    def page_to_photo(self, points: Points) -> Points:
        """Photo pixels (N, 2) of page pixels; NaN where the photo cannot show them."""
        ...

    def photo_to_page(self, points: Points) -> Points:
        """Page pixels (N, 2) of photo pixels."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class HomographyMap:
    """A flat page's, seen by a photo of `width` x `height`."""

    H_photo_page: NDArray[np.float64]
    width: int
    height: int

    def page_to_photo(self, points: Points) -> Points:
        """See `PageMap`: what lies behind the camera has the other sign than what the photo's middle shows."""
        middle = self.photo_to_page(np.array([[(self.width - 1) / 2, (self.height - 1) / 2]]))
        side = denominators(self.H_photo_page, points) * denominators(self.H_photo_page, middle)
        return np.where(side[:, None] > 0, transform_points(self.H_photo_page, points), np.nan)

    def photo_to_page(self, points: Points) -> Points:
        """See `PageMap`."""
        return transform_points(np.linalg.inv(self.H_photo_page), points)


@dataclass(frozen=True, slots=True, eq=False)
class TrueSet:
    """Photos of a page, and where each lies on it.

    `page` is (H, W, 3), `box` (x0, y0, x1, y1) its print in page pixels, `lines` its text; `overlaps` holds the true
    shares of the pairs' common area.
    """

    name: str
    photos: tuple[RgbImage, ...]
    maps: tuple[PageMap, ...]
    page: RgbImage
    dpi: float
    box: tuple[float, float, float, float]
    lines: tuple[str, ...]
    overlaps: dict[tuple[int, int], float]


@dataclass(frozen=True, slots=True)
class MosaicCase:
    """One set. `kind` is "shared", "own", "curved", "turned" or "bent"; the others are of our own simulation too.

    `page` is the name of its flat page, or of the set's folder if it is shared; `sheet` is the kind of a bent sheet.
    """

    kind: str
    count: int
    overlap: float
    page: str
    number: int = 0
    sheet: str = ""

    @property
    def name(self) -> str:
        """As figures are filed under."""
        if self.kind == "shared":
            return self.page
        if self.kind == "bent":
            return f"bent_{self.sheet}_{self.number}_n{self.count}_o{round(100 * self.overlap)}"
        return f"{self.kind}_n{self.count}_o{round(100 * self.overlap)}_{self.number}_{self.page}"


def shared_cases(data: Path) -> list[MosaicCase]:
    """Of the data's sets that have a truth; none where there is no data."""
    cases = []
    for file in sorted((data / "mosaic").glob("*/truth.json")):
        record = json.loads(file.read_text(encoding="utf-8"))
        cases.append(
            MosaicCase("shared", len(record["patches"]), float(record["nominal_overlap"]), file.parent.name)
        )
    return cases


def own_cases(pages: Sequence[str], repeats: int = REPEATS) -> list[MosaicCase]:
    """Counts x overlaps x `repeats`, in an order in which any first few are varied; every set has another page."""
    cases = []
    for repeat in range(repeats):
        for i, count in enumerate(COUNTS):
            for j in range(len(OVERLAPS)):
                overlap = OVERLAPS[(i + j + repeat) % len(OVERLAPS)]
                page = pages[len(cases) % len(pages)]
                cases.append(MosaicCase("own", count, overlap, page, repeat))
    return cases


def further_cases(kind: str, pages: Sequence[str]) -> list[MosaicCase]:
    """Three sets of a gently curved page ("curved"), or with half of the photos upside down ("turned")."""
    shift = 1 if kind == "curved" else 4
    return [
        MosaicCase(kind, count, overlap, pages[(shift + i) % len(pages)], i)
        for i, (count, overlap) in enumerate(((2, 0.2), (4, 0.2), (4, 0.4)))
    ]


def bent_cases(pages: Sequence[str]) -> list[MosaicCase]:
    """Sheets of all kinds in turns, in two and four photos, so that any first few are varied."""
    cases = []
    for number in range(BENT_SETS):
        for i, sheet in enumerate(BENT):
            count, overlap = ((2, 0.4), (4, 0.4), (4, 0.2))[(number + i) % 3]
            page = pages[(7 * number + i) % len(pages)]
            cases.append(MosaicCase("bent", count, overlap, page, number, sheet))
    return cases


def load_flat_pages(data: Path) -> Mapping[str, Page]:
    """The data's flat pages, else our own, and always our coloured one."""
    files = [data / "pages" / f"{name}.png" for name in PAGES]
    own = letter_pages()
    given = [load_page(file) for file in files] if all(file.is_file() for file in files) else list(own[:-1])
    return {page.name: page for page in (*given, own[-1])}


def load_case(case: MosaicCase, data: Path, pages: Mapping[str, Page]) -> TrueSet:
    """The photos and their truth; our own are drawn from a seed that is the case's."""
    if case.kind == "shared":
        return _load_shared(data / "mosaic" / case.page)
    page = pages[case.page]
    seed = [case.count, round(100 * case.overlap), case.number, *f"{case.kind}{case.sheet}".encode()]
    rng, hidden = np.random.default_rng(seed), True
    while hidden:
        made = photograph_set(
            page,
            case.count,
            case.overlap,
            rng,
            shape=_shape(case),
            turned=case.count // 2 if case.kind == "turned" else 0,
        )
        hidden = any(_hides_itself(photo.truth) for photo in made.photos)
    words = [word for line in page.lines for word in line]
    boxes = np.array([word.box for word in words])
    x0, y0 = boxes[:, :2].min(axis=0)
    x1, y1 = boxes[:, 2:].max(axis=0)
    return TrueSet(
        case.name,
        made.images,
        tuple(photo.truth for photo in made.photos),
        page.image if page.image.ndim == 3 else np.repeat(page.image[..., None], 3, axis=2),
        page.dpi,
        (float(x0), float(y0), float(x1), float(y1)),
        tuple(" ".join(word.text for word in line) for line in page.lines),
        made.overlaps,
    )


def _shape(case: MosaicCase) -> Shape | None:
    if case.kind == "curved":
        return GENTLE_CURVE
    return FOLDED[case.number] if case.sheet == "folded" else BENT.get(case.sheet)


def _hides_itself(truth: Truth) -> bool:
    """Whether a ray to some point of the page meets the sheet before."""
    x, y = np.linspace(0, truth.page.width - 1, 40), np.linspace(0, truth.page.height - 1, 50)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    seen = truth.page_to_photo(points)
    with np.errstate(invalid="ignore"):
        shown = np.all((seen >= 0) & (seen <= [truth.camera.width - 1, truth.camera.height - 1]), axis=1)
    apart = np.hypot(*(truth.photo_to_page(seen[shown]) - points[shown]).T)
    return not bool(np.all(apart <= 1.0))


def _load_shared(folder: Path) -> TrueSet:
    record = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    text = (folder / "page.txt").read_text(encoding="utf-8")
    x0, y0, x1, y1 = map(float, record["page"]["text_box"])
    overlaps = {}
    for pair, share in record["overlap_area"].items():
        a, b = sorted(map(int, pair.split("-")))
        overlaps[a, b] = float(share)
    photos = tuple(load_picture(folder / patch["file"]) for patch in record["patches"])
    maps = tuple(
        HomographyMap(np.array(patch["H_page_to_photo"]), photo.shape[1], photo.shape[0])
        for patch, photo in zip(record["patches"], photos, strict=True)
    )
    return TrueSet(
        folder.name,
        photos,
        maps,
        load_picture(folder / "page.png"),
        float(record["page"]["dpi"]),
        (x0, y0, x1, y1),
        tuple(line for line in text.splitlines() if line.strip()),
        overlaps,
    )
