"""The dissertation's experiment on 60 simulated planar photos: Tables 2.1, 3.1 and 3.8 beside its figures.

python -m benchmarks.rectify_simulated [--limit N] [--degraded] [--peers] [--reader tesseract|rapidocr]
"""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from benchmarks.baseline import judge
from benchmarks.cases import CHOSEN_PAGES, Case, all_cases, load_pages, photograph_case
from benchmarks.figures import CaseFigures, Score, score_of
from benchmarks.options import make_parser
from benchmarks.peers import find_page_dewarp, run_page_dewarp
from benchmarks.places import BASELINE, OUTPUT, data_folder
from benchmarks.plots import make_strip, save_picture
from benchmarks.reading import Reader, character_score, make_reader, word_rate
from benchmarks.residuals import (
    field_of_view_error_deg,
    is_upright,
    mesh_residual_percent,
    normal_error_deg,
)
from benchmarks.simulated_report import METRICS, figures_by_case, report, save_run
from benchmarks.stopwatch import Usage, measured
from benchmarks.subject import measure_flows, rectify_photo
from benchmarks.true_map import flatten_by_truth, flatten_in_frame
from benchmarks.workers import run_in_workers
from services.arrays import RgbImage
from services.errors import DocumentError
from services.operations import ocr_engine
from services.rectify.results import PlaneSurface, RectifyResult
from simulation.photo import SimulatedPhoto


@dataclass(frozen=True, slots=True)
class Options:
    """What a worker needs to know; it is sent to every process."""

    data: Path
    pages: tuple[str, ...]
    reader: str | None
    rapidocr_python: str
    page_dewarp: str | None
    pictures: Path


class Bench:
    """What a worker process keeps between cases: the pages, the judge, the service's own engine."""

    def __init__(self, options: Options) -> None:
        cv2.setNumThreads(1)
        self.options = options
        self.pages = {page.name: page for page in load_pages(options.data, options.pages)[0]}
        self.engine = ocr_engine()
        self.reader: Reader | None = None
        if options.reader:
            self.reader = make_reader(options.reader, options.rapidocr_python)
        self.read_clean = lru_cache(maxsize=None)(self._read_clean)

    def _read_clean(self, name: str) -> str:
        assert self.reader is not None
        return self.reader.read(self.pages[name].image).text


def run_case(case: Case, bench: Bench) -> CaseFigures:
    """Photograph, rectify, compare with the truth, read."""
    page = bench.pages[case.page]
    usage: dict[str, Usage] = {}
    with measured() as usage["simulate"]:
        photo = photograph_case(case, page)
    truth = photo.truth
    labels = (case.name, case.page_number, case.pose + 1, case.skew_deg)
    try:
        with measured() as usage["rectify"]:
            result = rectify_photo(photo.image, bench.engine)
        flows = measure_flows(photo.image, truth, np.random.default_rng(case.number))
    except DocumentError as error:
        scores, _ = _read_all(bench, case.page, photo, None, usage)
        return CaseFigures(*labels, failure=f"{error.code}: {error}", scores=scores, usage=usage)
    scores, shown = _read_all(bench, case.page, photo, result, usage)
    strip = make_strip([photo.image, result.image, *shown.values()], [case.name, "rectified", *shown])
    save_picture(bench.options.pictures / f"{case.name}.jpg", strip)
    focal = result.camera.focal_length_px
    normal = result.surface.normal if isinstance(result.surface, PlaneSurface) else None
    height, width = result.image.shape[:2]
    nan = float("nan")
    return CaseFigures(
        *labels,
        planar=result.kind == "planar",
        upright=is_upright(result.mesh, width, height, truth),
        focal_source=result.camera.source,
        major_deg=flows.major_deg,
        minor_deg=flows.minor_deg,
        fov_deg=nan if focal is None else field_of_view_error_deg(focal, truth),
        normal_deg=nan if normal is None else normal_error_deg(normal, truth),
        residual_percent=mesh_residual_percent(result.mesh, width, height, truth),
        warnings=tuple(notice.code for notice in result.warnings),
        scores=scores,
        usage=usage,
        stages_ms=dict(result.timings_ms),
    )


def _read_all(
    bench: Bench, page: str, photo: SimulatedPhoto, result: RectifyResult | None, usage: dict[str, Usage]
) -> tuple[dict[str, Score], dict[str, RgbImage | None]]:
    """Scores of every image of the case, and the further images to show."""
    lines = [" ".join(word.text for word in line) for line in photo.truth.visible_lines()]
    images: dict[str, RgbImage | None] = {"photo": photo.image, "rectified": None}
    shown: dict[str, RgbImage | None] = {"true map": flatten_by_truth(photo.image, photo.truth)}
    if result is not None:
        images["rectified"] = result.image
        shown["true map, our frame"] = flatten_in_frame(photo.image, photo.truth, result)
    if bench.options.page_dewarp:
        shown["page-dewarp"], usage["page-dewarp"], _ = run_page_dewarp(
            bench.options.page_dewarp, photo.image
        )
    scores: dict[str, Score] = {}
    if bench.reader is None:
        return scores, shown
    for name, image in {**images, **shown}.items():
        text = ""
        if image is not None:
            with measured() as usage[f"read {name}"]:
                text = bench.reader.read(image).text
        # What could not be made reads as nothing: a method does not gain by giving up.
        scores[name] = Score(100 * character_score(lines, text), 100 * word_rate(lines, text))
    clean = bench.read_clean(page)
    scores["clean page"] = Score(100 * character_score(lines, clean), 100 * word_rate(lines, clean))
    return scores, shown


_bench: list[Bench] = []


def _start_worker(options: Options) -> None:
    _bench.append(Bench(options))


def _work(case: Case) -> CaseFigures:
    return run_case(case, _bench[0])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    options = _parser().parse_args(arguments)
    data = data_folder(options.data)
    chosen = tuple(options.pages.split(",")) if options.pages else CHOSEN_PAGES
    pages, given = load_pages(data, chosen)
    if not given:
        print(f"no flat pages in {data}/pages: pages of our own are set instead", file=sys.stderr)
    peer = find_page_dewarp(options.page_dewarp) if options.peers else None
    if options.peers and peer is None:
        print("page-dewarp is not installed: see --page-dewarp", file=sys.stderr)
    name = "rectify_simulated" + ("_degraded" if options.degraded else "")
    pictures = OUTPUT / name
    sent = Options(
        data, chosen, None if options.no_reading else options.reader, options.rapidocr_python, peer, pictures
    )
    cases = all_cases(tuple(page.name for page in pages), degraded=options.degraded)[: options.limit]
    done, start = [], time.perf_counter()
    for figures in run_in_workers(_work, cases, _start_worker, sent, options.workers):
        done.append(figures)
        print(
            _progress(len(done), len(cases), time.perf_counter() - start, figures),
            file=sys.stderr,
            flush=True,
        )
    done.sort(key=lambda case: case.name)
    print(report(done))
    save_run(name, done, pictures)
    verdict, good = judge(
        BASELINE / f"{name}.json", figures_by_case(done), METRICS, update=options.update_baseline
    )
    print(f"\n{verdict}\nfigures and pictures: {OUTPUT}")
    return 0 if good else 1


def _progress(number: int, total: int, elapsed_s: float, case: CaseFigures) -> str:
    crs = score_of("rectified")(case)
    return (
        f"[{number}/{total} {elapsed_s:5.0f}s] {case.name:<30} residual {case.residual_percent:6.3f} %  "
        f"fov {case.fov_deg:5.2f}  normal {case.normal_deg:5.2f}  major {case.major_deg:4.2f}  "
        f"minor {case.minor_deg:4.2f}  CRS {crs:5.1f} {case.failure}"
    )


def _parser() -> argparse.ArgumentParser:
    parser = make_parser("rectify_simulated", __doc__)
    parser.add_argument("--limit", type=int, default=None, help="only the first N photos (a varied choice)")
    parser.add_argument("--degraded", action="store_true", help="desk, shadow, vignetting, blur, noise, JPEG")
    parser.add_argument("--pages", default="", help="comma-separated names of other flat pages of the data")
    parser.add_argument("--peers", action="store_true", help="page-dewarp too")
    parser.add_argument("--no-reading", action="store_true", help="no OCR scores: much faster")
    return parser


if __name__ == "__main__":
    sys.exit(main())
