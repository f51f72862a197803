"""What the benchmarks that learn weights share: the pages of several sets, read, and the tasks of set and size."""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

import cv2

from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.places import MEMORY
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.truth import LabelledPage, layout_folder
from benchmarks.layout.word_labels import Photo, load_pages, read_photo
from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine

Sets = Mapping[str, tuple[str, str | None]]
Case = tuple[str, str]
"""A set, and the number of samples of its models."""
Task = tuple[str, str, Sequence[Photo]]
R = TypeVar("R")


def measure_cases(
    name: str,
    description: str | None,
    arguments: Sequence[str] | None,
    sets: Sets,
    sizes: Sequence[str],
    measure: Callable[[Task], tuple[Case, R]],
) -> dict[Case, R]:
    """What `measure` finds of each set by models of each size, in the order of both; nothing without data."""
    parser = make_parser(name, description)
    parser.add_argument("--sets", default=",".join(sets), help="which sets, by commas (default: all)")
    parser.add_argument("--sizes", default=",".join(sizes), help="numbers of samples, by commas")
    parser.add_argument("--limit", type=int, default=None, help="only the first N pages of each set")
    options = parser.parse_args(arguments)
    names = options.sets.split(",")
    if unknown := [each for each in names if each not in sets]:
        parser.error(f"no such set: {', '.join(unknown)} (there are {', '.join(sets)})")
    pages = [(each, page) for each in names for page in load_pages(each, options.data, options.limit, sets)]
    if not pages:
        print(f"no pages in {layout_folder(options.data)}: nothing is learned", file=sys.stderr)
        return {}
    kept = None if options.fresh else "kept"
    photos: dict[str, list[Photo]] = {each: [] for each in names}
    progress = Progress(len(pages))
    for owner, photo in run_in_workers(read_named, pages, start_reading, kept, options.workers):
        photos[owner].append(photo)
        progress.tell(photo.name)
    tasks = [
        (each, size, sorted(photos[each], key=lambda photo: photo.name))
        for each in names
        for size in options.sizes.split(",")
        if len(photos[each]) > (1 if size == "all" else int(size))
    ]
    found: dict[Case, R] = {}
    progress = Progress(len(tasks))
    for case, result in run_in_workers(measure, tasks, start_reading, kept, options.workers):
        found[case] = result
        progress.tell(f"{case[0]}, {case[1]} samples")
    return {(each, size): found[each, size] for each, size, _ in tasks}


def told(weights: Iterable[float]) -> list[str]:
    """Weights as cells of a table."""
    return [f"{each:.3f}" for each in weights]


_started: list[tuple[OcrEngine | None, Memory]] = []


def start_reading(memory: str | None) -> None:
    """Start of a worker: an engine and what was read before."""
    cv2.setNumThreads(1)
    _started[:] = [(open_engine(), Memory(MEMORY if memory else None))]


def read_named(task: tuple[str, LabelledPage]) -> tuple[str, Photo]:
    """A set's name and the photo of one of its pages, in a worker that `start_reading` has started."""
    return task[0], read_photo(task[1], *_started[0])
