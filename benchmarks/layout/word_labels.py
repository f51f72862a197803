"""Words right from images: the share of words, of ink and of zones that get their right label from the image alone.

python -m benchmarks layout_words [--sets titles/real/jose,letters/real] [--sizes 1,5,all] [--limit N]

A model is made of N samples with their images, then other pages are labelled from their images (`image`). Beside it
the same pages in the zones of segmentation before they are regrouped (`pieces`), in zones that a person drew
(`drawn`, the ceiling), by a random forest on the zones of segmentation (`forest`), and in these zones with the label
that most of their area has (`oracle`, what segmentation alone loses). Words are those that the engine reads within
true zones.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.learning_curve import label_by_forest
from benchmarks.layout.marks import Marks, count_right, count_zones_right, ink_marks, word_marks
from benchmarks.layout.part import share, table
from benchmarks.layout.protocols import Labels, draws, folds, make_model, recognized
from benchmarks.layout.specimens import load_gray
from benchmarks.layout.truth import TITLES_REAL, LabelledPage, layout_folder, load_set
from services.imaging.illumination import flatten_illumination
from services.layout.learning.label_transfer import transfer_labels
from services.layout.page import Page
from services.layout.pipeline import VersionedModel, content_features, recognize, regroup
from services.layout.recognition.results import Recognition
from services.layout.segmentation import FinePage, compose_page, measure_zones, segment_finely
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine

NAME = "layout_words"
SETS: Mapping[str, tuple[str, str | None]] = {
    **{source: (source, None) for source in TITLES_REAL},
    "letters/real": ("letters/real", None),
    "memos": ("letters/made", "memo"),
    "fax sheets": ("letters/made", "fax"),
}
"""Folder and class (None: all) of each set."""
SIZES = ("1", "3", "5", "10", "all")
DRAWS = 2
FOLDS = 8
WAYS = ("image", "pieces", "forest", "drawn", "oracle")
JUDGED = ("image", "drawn")
"""Compared with the baseline; the other ways may be left out, the forest takes longest."""
METRICS = {f"{way}_words_percent": Metric(1.0, True) for way in JUDGED}


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A page seen by its image: lines and first zones, with the true page and its marks."""

    name: str
    true: Page
    fine: FinePage
    own: Page
    words: Marks
    ink: Marks


def read_photo(page: LabelledPage, engine: OcrEngine | None, memory: Memory) -> Photo:
    """The page by its image, read as the service reads it."""
    gray = load_gray(page.image)
    words = [] if engine is None else memory.page_words(engine, flatten_illumination(gray))
    true = content_features().measure_page(measure_zones(gray, page.page))
    fine = segment_finely(gray, words)
    own = content_features().measure_page(transfer_labels(true, compose_page(fine)))
    return Photo(page.name, true, fine, own, word_marks(words, true), ink_marks(gray, true))


def with_labels(page: Page, labels: Labels) -> Page:
    """The page with other labels of its zones."""
    zones = tuple(replace(zone, label=label) for zone, label in zip(page.zones, labels, strict=True))
    return replace(page, zones=zones)


def _labelled(seen: Recognition) -> Page:
    return with_labels(seen.page, tuple(zone.label for zone in seen.zones))


def label_photos(
    samples: Sequence[Photo], tested: Sequence[Photo], ways: Sequence[str]
) -> dict[str, list[Page]]:
    """The tested pages labelled in each of the `WAYS` by what the samples teach."""
    found: dict[str, list[Page]] = {}
    if "oracle" in ways:
        found["oracle"] = [photo.own for photo in tested]
    if "forest" in ways:
        labels = label_by_forest([(photo.own, None) for photo in samples], [photo.own for photo in tested])
        found["forest"] = [with_labels(photo.own, each) for photo, each in zip(tested, labels, strict=True)]
    if {"image", "pieces", "drawn"}.intersection(ways):
        model = make_model("class", [(photo.true, photo.own) for photo in samples])
        versions = [VersionedModel(model, 1)]
        own_zones = bool({"image", "pieces"}.intersection(ways))
        first = [recognize(compose_page(photo.fine), versions) for photo in tested] if own_zones else []
        if "pieces" in ways:
            found["pieces"] = [_labelled(seen) for seen in first]
        if "image" in ways:
            found["image"] = [
                _labelled(regroup(photo.fine, seen, versions))
                for photo, seen in zip(tested, first, strict=True)
            ]
        if "drawn" in ways:
            found["drawn"] = [_labelled(recognized(photo.true, {"class": model})) for photo in tested]
    return found


Counts = dict[str, list[int]]
"""Right and all words, points of ink and zones: [words right, words, ink right, ink, zones right, zones]."""


def add_counts(counts: Counts, way: str, photo: Photo, found: Page) -> None:
    """Count one labelled page."""
    numbers = (
        *count_right(photo.words, found),
        *count_right(photo.ink, found),
        *count_zones_right(photo.true, found),
    )
    counts[way] = [a + b for a, b in zip(counts.get(way, [0] * 6), numbers, strict=True)]


def measure_size(photos: Sequence[Photo], size: str, ways: Sequence[str]) -> Counts:
    """Counts for models of `size` samples over `DRAWS` draws, or of all others in folds."""
    if size == "all":
        splits = list(folds(len(photos), FOLDS))
    else:
        drawn = draws(len(photos), int(size), DRAWS, seed=7)
        splits = [(each, [at for at in range(len(photos)) if at not in each]) for each in drawn]
    counts: Counts = {}
    for learned, held_out in splits:
        tested = [photos[at] for at in held_out]
        for way, pages in label_photos([photos[at] for at in learned], tested, ways).items():
            for photo, page in zip(tested, pages, strict=True):
                add_counts(counts, way, photo, page)
    return counts


@dataclass(frozen=True, slots=True)
class _Options:
    memory: str | None
    photos: Mapping[str, Sequence[Photo]]
    ways: tuple[str, ...]


_started: list[tuple[_Options, OcrEngine | None, Memory]] = []


def _start(options: _Options) -> None:
    cv2.setNumThreads(1)
    memory = Memory(MEMORY if options.memory else None)
    _started[:] = [(options, open_engine(), memory)]


def _read(task: tuple[str, LabelledPage]) -> tuple[str, Photo]:
    return task[0], read_photo(task[1], *_started[0][1:])


def _measure(task: tuple[str, str]) -> tuple[str, str, Counts]:
    options = _started[0][0]
    return *task, measure_size(options.photos[task[0]], task[1], options.ways)


def load_pages(
    name: str, data: str | None, limit: int | None, sets: Mapping[str, tuple[str, str | None]] = SETS
) -> list[LabelledPage]:
    """Pages of one of the `sets`."""
    folder, class_name = sets[name]
    pages = [page for page in load_set(folder, data) if class_name in (None, page.class_name)]
    return pages[:limit]


def figures_of(counts: Mapping[tuple[str, str], Counts]) -> Figures:
    """Percent of words, ink and zones that are right, of each set and number of samples."""
    return {
        f"{name}, {size} samples": {
            f"{way}_{what}_percent": share(numbers[2 * place], numbers[2 * place + 1])
            for way, numbers in found.items()
            for place, what in enumerate(("words", "ink", "zones"))
        }
        for (name, size), found in counts.items()
    }


def report(figures: Figures, ways: Sequence[str]) -> str:
    """Three tables: words, ink and zones right, a row for each set and number of samples."""
    parts = []
    for what in ("words", "ink", "zones"):
        rows = [
            [case, *(float(row.get(f"{way}_{what}_percent", np.nan)) for way in ways)]
            for case, row in figures.items()
        ]
        parts.append(
            table(f"{what.capitalize()} with the right label, percent", ("set, samples", *ways), rows)
        )
    return "\n\n".join(parts)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = make_parser(NAME, __doc__)
    add: Callable[..., object] = parser.add_argument
    add("--sets", default=",".join(SETS), help="which sets, by commas (default: all)")
    add("--sizes", default=",".join(SIZES), help="numbers of samples, by commas (default: 1,3,5,10,all)")
    add("--ways", default=",".join(WAYS), help="what is compared, by commas (default: all)")
    add("--limit", type=int, default=None, help="only the first N pages of each set")
    options = parser.parse_args(arguments)
    names, sizes, ways = (value.split(",") for value in (options.sets, options.sizes, options.ways))
    if unknown := [name for name in names if name not in SETS]:
        parser.error(f"no such set: {', '.join(unknown)} (there are {', '.join(SETS)})")
    pages = [(name, page) for name in names for page in load_pages(name, options.data, options.limit)]
    if not pages:
        print(f"no pages in {layout_folder(options.data)}: nothing is measured", file=sys.stderr)
        return 0
    memory = None if options.fresh else "kept"
    photos: dict[str, list[Photo]] = {name: [] for name in names}
    progress = Progress(len(pages))
    for name, photo in run_in_workers(_read, pages, _start, _Options(memory, {}, ()), options.workers):
        photos[name].append(photo)
        progress.tell(photo.name)
    for each in photos.values():
        each.sort(key=lambda photo: photo.name)
    tasks = [
        (name, size) for size in sizes for name in names if size == "all" or int(size) < len(photos[name])
    ]
    counts: dict[tuple[str, str], Counts] = {}
    progress = Progress(len(tasks))
    asked = _Options(memory, photos, tuple(ways))
    for name, size, found in run_in_workers(_measure, tasks, _start, asked, options.workers):
        counts[name, size] = found
        progress.tell(f"{name}, {size} samples")
    figures = figures_of({task: counts[task] for task in tasks})
    print(report(figures, ways))
    write_json(OUTPUT / f"{NAME}.json", plain_values(figures))
    if options.limit or len(names) < len(SETS) or len(sizes) < len(SIZES) or not set(JUDGED).issubset(ways):
        return 0
    verdict, good = judge(
        BASELINE / f"{NAME}.json", plain_values(figures), METRICS, update=options.update_baseline
    )
    print(verdict, flush=True)
    return 0 if good else 1
