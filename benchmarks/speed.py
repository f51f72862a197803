"""What one answer of each kind costs, in CPU ms and over the floor, and how it grows with what is sent.

Photos by megapixels, mosaics by number of photos, pages by resolution, models and zones, one feedback, an overlay. The
floor is that of `rectify_speed`: decode, one remap and encode of a JPEG of 12 megapixels. Rows of models and zones need
the data's labelled pages.

python -m benchmarks speed [--parts photos,mosaics,models,pages] [--repeats N]
"""

import argparse
import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from multiprocessing import get_context

import cv2
import numpy as np

from app.engine.worker import SINGLE_THREAD_ENVIRONMENT, collect_seldom
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.places import OUTPUT
from benchmarks.common.stopwatch import measured
from benchmarks.layout.protocols import unlabelled
from benchmarks.layout.specimens import Specimen, by_class, load_specimens
from benchmarks.learning.speed import SETTINGS, follow_feedback, stored_model
from benchmarks.mosaic.subject import assemble
from benchmarks.rectify.floor import run_floor
from benchmarks.rectify.speed import make_upload
from benchmarks.rectify.subject import rectify_bytes
from services.contract.layout import LayoutOptions, ModelDocument
from services.layout.exchange.page_json import page_to_document
from services.layout.page import Page
from services.operations.layout import recognize_upload
from simulation.letter_pages import letter_pages
from simulation.mosaic_sets import photograph_set

MEGAPIXELS = (1.5, 3.0, 6.0, 12.0)
PHOTOS = (2, 4, 8)
MODELS = (1, 6, 50, 200)
READ_NOTHING = LayoutOptions(ocr=False)
_FLOORS = 9


@dataclass(frozen=True, slots=True)
class Cost:
    """Least CPU time of a few runs of one kind of answer, and the largest size of its process."""

    name: str
    cpu_ms: float
    peak_mb: float


def measure_floor(repeats: int) -> list[Cost]:
    """Of a photo of 12 megapixels."""
    upload = make_upload("planar-12", degraded=True)
    return [_least("the floor, 12 MP", lambda: run_floor(upload), max(repeats, _FLOORS))]


def measure_photos(repeats: int) -> list[Cost]:
    """A flat page by megapixels of its photo."""
    uploads = {size: make_upload(f"planar-{size:g}", degraded=True) for size in MEGAPIXELS}
    return [
        _least(f"flat page, {size:g} MP", _call(rectify_bytes, upload), repeats)
        for size, upload in uploads.items()
    ]


def measure_mosaics(repeats: int) -> list[Cost]:
    """Mosaics by number of photos, of 1 to 1.6 megapixels each."""
    found = []
    for count in PHOTOS:
        images = photograph_set(letter_pages()[0], count, 0.2, np.random.default_rng(104)).images
        found.append(_least(f"mosaic of {count} photos", _call(assemble, images), repeats))
    return found


def measure_models(repeats: int) -> list[Cost]:
    """Pages with given zones by number of models and of zones; one feedback."""
    classes = _classes()
    if not classes:
        return []
    models = [stored_model(name, [each.true for each in members]) for name, members in classes.items()]
    page = next(iter(classes.values()))[0].true
    zones = _zones(page)
    found = []
    for count in MODELS:
        some = [ModelDocument(f"class-{k}", 1, models[k % len(models)].document) for k in range(count)]
        found.append(
            _least(f"{len(page.zones)} zones, {count} models", _recognition(None, zones, some), repeats)
        )
    pages = sorted(
        (each.true for members in classes.values() for each in members), key=lambda p: len(p.zones)
    )
    for share in (0.05, 0.5, 1.0):
        page = pages[int(share * (len(pages) - 1))]
        call = _recognition(None, _zones(page), models)
        found.append(_least(f"{len(page.zones)} zones, {len(models)} models", call, repeats))
    name, members = next(iter(classes.items()))
    known = {name: stored_model(name, [each.true for each in members[1:]])}
    taught = [members[0].true]
    follow_feedback(taught, known, [name], "passive-aggressive")
    spent = [
        follow_feedback(taught, known, [name], "passive-aggressive")[0].adaptation for _ in range(repeats)
    ]
    return [*found, Cost("one feedback, one model", min(spent), 0.0)]


def measure_pages(repeats: int) -> list[Cost]:
    """Page images to labels without OCR, by class and resolution, and the same with an overlay as the answer."""
    classes = _classes()
    models = [stored_model(name, [each.true for each in members]) for name, members in classes.items()]
    found = []
    for name in [name for name in ("jose", "letter", "memo") if name in classes]:
        gray = cv2.imread(str(classes[name][0].image), cv2.IMREAD_GRAYSCALE)
        for factor in (1, 2):
            image = cv2.resize(np.asarray(gray), None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
            upload = cv2.imencode(".png", image)[1].tobytes()
            call = _recognition(upload, None, models)
            found.append(_least(f"image to labels, {name}, {150 * factor} dpi", call, repeats))
            if factor == 1:
                call = _recognition(upload, None, models, LayoutOptions(ocr=False, format="png"))
                found.append(_least(f"... and an overlay, {name}, 150 dpi", call, repeats))
    return found


PARTS: dict[str, Callable[[int], list[Cost]]] = {
    "photos": measure_photos,
    "mosaics": measure_mosaics,
    "models": measure_models,
    "pages": measure_pages,
}


def _classes() -> dict[str, list[Specimen]]:
    """Labelled pages of the classes whose samples have texts and zones."""
    pages = [each for each in load_specimens(None) if each.true.zones]
    return {name: members for name, members in by_class(pages).items() if len(members) > 1}


def _zones(page: Page) -> bytes:
    return json.dumps(page_to_document(unlabelled(page))).encode()


def _recognition(
    image: bytes | None,
    zones: bytes | None,
    models: Sequence[ModelDocument],
    options: LayoutOptions = READ_NOTHING,
) -> Callable[[], object]:
    return lambda: recognize_upload(image, zones, None, models, options, SETTINGS)


def _call(work: Callable[..., object], *arguments: object) -> Callable[[], object]:
    return lambda: work(*arguments)


def _least(name: str, work: Callable[[], object], repeats: int) -> Cost:
    """The least of `repeats` runs, after one that fills caches."""
    work()
    runs = []
    for _ in range(repeats):
        with measured() as usage:
            work()
        runs.append(usage)
    return Cost(name, 1000 * min(run.cpu_s for run in runs), max(run.peak_mb for run in runs))


def _run_part(part: str, repeats: int) -> list[Cost]:
    """In a fresh process, set up as a worker is."""
    cv2.setNumThreads(1)
    collect_seldom()
    return (measure_floor if part == "floor" else PARTS[part])(repeats)


def _costs(parts: Sequence[str], repeats: int) -> Iterator[Cost]:
    for part in ("floor", *parts):
        with get_context("spawn").Pool(1) as pool:
            yield from pool.apply(_run_part, (part, repeats))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save; nothing is compared, since times belong to a machine."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks speed",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--parts", default=",".join(PARTS), help="only these, comma separated")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each row; the least counts")
    options = parser.parse_args(arguments)
    os.environ.update(SINGLE_THREAD_ENVIRONMENT)
    print(f"{'CPU time of one answer':<40}{'ms':>9}{'floors':>9}{'peak MB':>9}")
    found: list[Cost] = []
    for cost in _costs(options.parts.split(","), options.repeats):
        found.append(cost)
        over = cost.cpu_ms / found[0].cpu_ms
        print(f"{cost.name:<40}{cost.cpu_ms:>9.1f}{over:>9.2f}{cost.peak_mb:>9.0f}", flush=True)
    write_json(OUTPUT / "speed.json", [plain_values(asdict(cost)) for cost in found])
    return 0
