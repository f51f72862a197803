"""What was measured on real photos, and its tables: photo by photo, by kind, against scans."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.common.baseline import Figures, Metric
from benchmarks.common.figures import NAN
from benchmarks.common.scan_distances import ScanDistances
from benchmarks.common.stopwatch import Usage
from benchmarks.rectify.real_photos import KINDS

METHODS = ("photo", "rectified", "page-dewarp", "UVDoc")
"""Images in the order of the tables; "rectified" is ours."""
PEERS = METHODS[2:]
NEAR_PEER = 0.5
"""By as many points of character score we may lie below a peer."""
METRICS = {
    "error_rate": Metric(0.01),
    "characters": Metric(0.5, True),
    "words": Metric(0.7, True),
    "sure_characters": Metric(20.0, True),
    "ms_ssim": Metric(0.01, True),
    "aligned_distortion_px": Metric(0.05),
}


@dataclass(frozen=True, slots=True)
class ScanFigures:
    """One view against a scan of the page: distances, and what is read in it against what is read in the scan."""

    distances: ScanDistances
    edit_distance: int
    error_rate: float


@dataclass(frozen=True, slots=True)
class ImageFigures:
    """How one image of a photo reads: CER, character score and word rate (percent) are NaN without a known text."""

    width: int
    height: int
    error_rate: float
    characters: float
    words: float
    sure_characters: int
    scan: ScanFigures | None = None


@dataclass(frozen=True, slots=True)
class PhotoFigures:
    """One photo: the images by method (of `METHODS`), what they took and what was said of them.

    `usage` has the methods that were tried; one without an image has failed, and `answers` says why.
    """

    name: str
    kind: str
    warnings: tuple[str, ...] = ()
    answers: dict[str, str] = field(default_factory=dict)
    images: dict[str, ImageFigures] = field(default_factory=dict)
    usage: dict[str, Usage] = field(default_factory=dict)
    stages_ms: dict[str, float] = field(default_factory=dict)

    @property
    def known(self) -> bool:
        """Whether the page's text is known."""
        return "photo" in self.images and np.isfinite(self.images["photo"].characters)

    def score(self, method: str, part: str = "characters") -> float:
        """A method's score, percent: 0 where it gave no page, NaN where it was not tried or no text is known."""
        if not self.known or (method not in self.images and method not in self.usage):
            return NAN
        return float(getattr(self.images[method], part)) if method in self.images else 0.0

    @property
    def lost_to(self) -> dict[str, float]:
        """The peers that read better than ours by more than `NEAR_PEER`, with their scores."""
        ours = self.score("rectified")
        scores = {peer: self.score(peer) for peer in PEERS}
        return {peer: score for peer, score in scores.items() if score > ours + NEAR_PEER}


def format_photos(photos: Sequence[PhotoFigures]) -> str:
    """One line a photo and method; CER, CRS and WRR where the text is known, else characters surely read."""
    lines = [
        f"{'photo':<46}{'image':<12}{'size':>11}{'CER':>7}{'CRS %':>7}{'WRR %':>7}{'sure ch.':>9}"
        f"{'CPU s':>7}{'MB':>6}  answer"
    ]
    for photo in photos:
        for method in METHODS:
            figures, used = photo.images.get(method), photo.usage.get(method)
            if figures is None and used is None:
                continue
            line = f"{f'{photo.name} ({photo.kind})' if method == 'photo' else '':<46}{method:<12}"
            line += _figures_line(figures) if figures else f"{'-':>11}{'-':>7}{'-':>7}{'-':>7}{'-':>9}"
            line += f"{used.cpu_s:>7.2f}{used.peak_mb:>6.0f}" if used else " " * 13
            notes = [photo.answers.get(method, ""), *(photo.warnings if method == "rectified" else ())]
            lines.append(f"{line}  {'; '.join(note for note in notes if note)}".rstrip())
    return "\n".join(lines)


def _figures_line(figures: ImageFigures) -> str:
    size = f"{figures.width}x{figures.height}"
    known = np.isfinite(figures.characters)
    rates = (
        f"{figures.error_rate:>7.3f}{figures.characters:>7.1f}{figures.words:>7.1f}" if known else f"{'':>21}"
    )
    return f"{size:>11}{rates}{figures.sure_characters:>9}"


def format_kinds(photos: Sequence[PhotoFigures]) -> str:
    """Means by kind: character score and word rate of each method, then CPU and memory."""
    tried = [
        method
        for method in METHODS
        if any(method in photo.images or method in photo.usage for photo in photos)
    ]
    lines = ["mean by kind: CRS % / WRR %; CPU s, largest MB".ljust(20)]
    lines.append(f"{'':<12}{'n':>4}" + "".join(f"{method:>26}" for method in tried))
    rows = [("All", [photo for photo in photos if photo.known])]
    rows += [(kind, [photo for photo in photos if photo.kind == kind]) for kind in KINDS]
    for label, members in rows:
        if members:
            cells = "".join(f"{_kind_cell(members, method):>26}" for method in tried)
            lines.append(f"{label:<12}{len(members):>4}{cells}".rstrip())
    behind = [photo for photo in photos if photo.lost_to]
    lines.append(f"\nmore than {NEAR_PEER} points below a peer: {len(behind)} photos")
    for photo in sorted(behind, key=lambda photo: photo.score("rectified") - max(photo.lost_to.values())):
        peers = ", ".join(f"{peer} {score:.1f}" for peer, score in photo.lost_to.items())
        lines.append(f"  {photo.name:<34}{photo.kind:<10}ours {photo.score('rectified'):5.1f}  {peers}")
    return "\n".join(lines)


def _kind_cell(photos: Sequence[PhotoFigures], method: str) -> str:
    used = [photo.usage[method] for photo in photos if method in photo.usage]
    cell = ""
    if any(photo.known for photo in photos):
        characters = _mean(photo.score(method) for photo in photos)
        words = _mean(photo.score(method, "words") for photo in photos)
        cell = f"{characters:.1f} /{words:5.1f}"
    if used:
        cpu, most = _mean(usage.cpu_s for usage in used), max(usage.peak_mb for usage in used)
        cell += f" {cpu:5.1f} s{most:5.0f}"
    return cell


def format_scans(photos: Sequence[PhotoFigures]) -> str:
    """Against scans: ours and UVDoc on the same photos, then the means over the photos that both have."""
    columns: dict[str, Callable[[ScanFigures], float]] = {
        "MS-SSIM": lambda figures: figures.distances.ms_ssim,
        "LD*": lambda figures: figures.distances.local_distortion_px,
        "AD*": lambda figures: figures.distances.aligned_distortion_px,
        "ED": lambda figures: figures.edit_distance,
        "CER": lambda figures: figures.error_rate,
        "aspect %": lambda figures: figures.distances.aspect_error_percent,
    }
    digits = {"MS-SSIM": 3, "AD*": 3, "CER": 3, "ED": 0}
    rows: list[tuple[str, dict[str, ScanFigures]]] = []
    for photo in photos:
        scans = {
            method: photo.images[method].scan for method in ("rectified", "UVDoc") if method in photo.images
        }
        found = {method: scan for method, scan in scans.items() if scan is not None}
        if found:
            rows.append((photo.name, found))
    if not rows:
        return ""
    lines = [
        "against scans, ours then UVDoc (* our own flow: not comparable with published figures)",
        f"{'':<34}" + "".join(f"{name:>18}" for name in columns),
    ]

    def pair(ours: float, theirs: float, name: str) -> str:
        shown = ["-" if np.isnan(value) else f"{value:.{digits.get(name, 1)}f}" for value in (ours, theirs)]
        return f"{shown[0]:>11}{shown[1]:>7}"

    for name, found in rows:
        ours, theirs = found.get("rectified"), found.get("UVDoc")
        cells = (
            pair(pick(ours) if ours else NAN, pick(theirs) if theirs else NAN, column)
            for column, pick in columns.items()
        )
        lines.append(f"{name:<34}{''.join(cells)}")
    both = [found for _, found in rows if len(found) == 2]
    if both:
        cells = (
            pair(
                _mean(pick(found["rectified"]) for found in both),
                _mean(pick(found["UVDoc"]) for found in both),
                column,
            )
            for column, pick in columns.items()
        )
        lines.append(f"{f'mean of {len(both)}':<34}{''.join(cells)}")
    return "\n".join(lines)


def figures_by_photo(photos: Sequence[PhotoFigures]) -> Figures:
    """What the baseline holds of each photo: our image's finite figures."""
    table: Figures = {}
    for photo in photos:
        image = photo.images.get("rectified")
        distances = image.scan.distances if image and image.scan else None
        values = {}
        for name in METRICS:
            for owner in (image, distances):
                if owner is not None and hasattr(owner, name):
                    values[name] = float(getattr(owner, name))
        table[photo.name] = {name: round(value, 4) for name, value in values.items() if np.isfinite(value)}
    return table


def _mean(values: Iterable[float]) -> float:
    finite = [value for value in values if np.isfinite(value)]
    return float(np.mean(finite)) if finite else NAN
