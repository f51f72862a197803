"""The dissertation's experiments on simulated photos, its figures beside ours.

python -m benchmarks rectify_simulated [--experiment planar|curved|...|folded|...|all] [--degraded|--both]
                                       [--limit N] [--peers] [--reader tesseract|rapidocr] [--fresh]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.common.baseline import judge
from benchmarks.common.figures import NAN, CaseFigures, Score, StripErrors, score_of
from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.peers import find_page_dewarp
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT, data_folder
from benchmarks.common.reading import Reader, character_score, make_reader, word_rate
from benchmarks.common.residuals import (
    RulingErrors,
    field_of_view_error_deg,
    is_upright,
    mesh_on_page,
    mesh_residual_percent,
    normal_error_deg,
    normals_at,
    ruling_errors,
)
from benchmarks.common.sheet_errors import measure_sheet
from benchmarks.common.stopwatch import Usage, measured
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.rectify.cases import (
    CHOSEN_PAGES,
    EXPERIMENTS,
    Case,
    all_cases,
    load_own_pages,
    load_pages,
    photograph_case,
)
from benchmarks.rectify.simulated_pictures import save_case, save_run
from benchmarks.rectify.simulated_report import METRICS, OCR_METRICS, figures_by_case, report, summary
from benchmarks.rectify.subject import FlowErrors, measure_steps, rectify_photo, rectify_spread
from benchmarks.rectify.true_map import flatten_by_truth, flatten_in_frame
from services.arrays import RgbImage
from services.errors import DocumentError
from services.operations.reader import ocr_engine
from services.rectify.results import RectifyResult
from services.sheet.surfaces import StripsSurface
from simulation.flat_page import Points
from simulation.photo import SimulatedPhoto
from simulation.truth import Truth

_SAMPLE_POINTS = 400


@dataclass(frozen=True, slots=True)
class Options:
    """What a worker needs to know; it is sent to every process."""

    data: Path
    pages: tuple[str, ...]
    reader: str | None
    rapidocr_python: str
    page_dewarp: str | None
    peer_limit: int | None
    memory: Path | None
    pictures: Path
    own_pages: tuple[str, ...] = ()
    corners: bool = False


class Bench:
    """What a worker process keeps between cases: the pages, the judge, the service's own engine."""

    def __init__(self, options: Options) -> None:
        cv2.setNumThreads(1)
        self.options = options
        self.pages = {page.name: page for page in load_pages(options.data, options.pages)[0]}
        self.pages.update((page.name, page) for page in load_own_pages(options.data, options.own_pages))
        self.engine = ocr_engine()
        self.memory = Memory(options.memory)
        self.reader: Reader | None = None
        if options.reader:
            self.reader = make_reader(options.reader, options.rapidocr_python)
        self.read_clean = lru_cache(maxsize=None)(self._read_clean)

    def _read_clean(self, name: str) -> str:
        assert self.reader is not None
        return self.memory.read(self.reader, self.pages[name].image).text


def run_case(case: Case, bench: Bench) -> CaseFigures:
    """Photograph, rectify, compare with the truth, read."""
    page = bench.pages[case.page]
    usage: dict[str, Usage] = {}
    with measured() as usage["simulate"]:
        photo = photograph_case(case, page, bench.pages.get(case.facing))
    points = photo.truth.text_points(np.random.default_rng(case.number), _SAMPLE_POINTS)
    result: RectifyResult | None = None
    flows, strips, failure = FlowErrors(NAN, NAN), StripErrors(), ""
    try:
        with measured() as usage["rectify"]:
            result = _rectified(case, photo, bench)
        if len(points):
            with measured() as usage["steps"]:
                flows, strips = measure_steps(
                    photo.image, photo.truth, points, curved=result.kind == "curved"
                )
    except DocumentError as error:
        failure = f"{error.code}: {error}"
    scores, shown = _read_all(bench, case, photo, result, usage)
    figures = CaseFigures(
        case.name,
        case.page_number,
        case.shape + 1,
        case.pose + 1,
        case.skew_deg,
        failure,
        major_deg=flows.major_deg,
        minor_deg=flows.minor_deg,
        strips=strips,
        scores=scores,
        usage=usage,
    )
    if result is not None:
        figures = replace(figures, **_errors(result, photo.truth, points), stages_ms=dict(result.timings_ms))
    folder = bench.options.pictures / case.experiment.file_name(degraded=case.degraded)
    save_case(folder, figures, photo.image, None if result is None else result.image, shown)
    return figures


def _rectified(case: Case, photo: SimulatedPhoto, bench: Bench) -> RectifyResult:
    """The answer; of an opened book, the one that shows the case's page best."""
    if not case.facing:
        corners = photo.truth.outline(1)[:4] if bench.options.corners else None
        return rectify_photo(photo.image, bench.engine, photo.exif_focal_length_px, corners)
    answers = rectify_spread(photo.image, bench.engine)

    def shown(answer: RectifyResult) -> int:
        height, width = answer.image.shape[:2]
        return len(mesh_on_page(answer.mesh, width, height, photo.truth)[0])

    return max(answers, key=shown)


def _alone(case: Case, bench: Bench) -> RgbImage | None:
    """What is answered of a book's page where the facing page is not there; None where it is refused."""
    try:
        return rectify_photo(photograph_case(case, bench.pages[case.page]).image, bench.engine).image
    except DocumentError:
        return None


def _errors(result: RectifyResult, truth: Truth, points: Points) -> dict[str, Any]:
    """Fields of `CaseFigures` that the answer has."""
    focal, surface = result.camera.focal_length_px, result.surface
    normals = normals_at(surface, points)
    rulings = RulingErrors(NAN, NAN)
    if isinstance(surface, StripsSurface):
        rulings = ruling_errors(surface.points, surface.angles_rad, truth, surface.vanishing_points)
    height, width = result.image.shape[:2]
    return {
        "classified": (result.kind == "planar") == truth.is_planar,
        "upright": is_upright(result.mesh, width, height, truth),
        "focal_source": result.camera.source,
        "ruling_2d_deg": rulings.photo_deg,
        "ruling_3d_deg": rulings.space_deg,
        "fov_deg": NAN if focal is None else field_of_view_error_deg(focal, truth),
        "normal_deg": NAN if normals is None else normal_error_deg(normals, truth, points),
        "sheet": measure_sheet(result.mesh, width, height, truth),
        "residual_percent": mesh_residual_percent(result.mesh, width, height, truth),
        "warnings": tuple(notice.code for notice in result.warnings),
    }


def _read_all(
    bench: Bench, case: Case, photo: SimulatedPhoto, result: RectifyResult | None, usage: dict[str, Usage]
) -> tuple[dict[str, Score], dict[str, RgbImage | None]]:
    """Scores of every image of the case, and the further images to show."""
    lines = [" ".join(word.text for word in line) for line in photo.truth.visible_lines()]
    ours = None if result is None else result.image
    shown: dict[str, RgbImage | None] = {"true map": flatten_by_truth(photo.image, photo.truth)}
    if result is not None:
        shown["true map, our frame"] = flatten_in_frame(photo.image, photo.truth, result)
    peer_limit = bench.options.peer_limit
    if bench.options.page_dewarp and (peer_limit is None or case.rank < peer_limit):
        shown["page-dewarp"], usage["page-dewarp"], _ = bench.memory.page_dewarp(
            bench.options.page_dewarp, photo.image
        )
    scores: dict[str, Score] = {}
    if bench.reader is None or not lines:
        return scores, shown
    if case.facing:
        shown["alone"] = _alone(case, bench)
    images: dict[str, RgbImage | None] = {"photo": photo.image, "rectified": ours, **shown}
    for name, image in images.items():
        text = ""
        if image is not None:
            with measured() as usage[f"read {name}"]:
                # What our own code has a part in is another image every time: not worth keeping.
                kept = name not in ("rectified", "true map, our frame", "alone")
                text = (bench.memory.read(bench.reader, image) if kept else bench.reader.read(image)).text
        # What could not be made reads as nothing: a method does not gain by giving up.
        scores[name] = Score(100 * character_score(lines, text), 100 * word_rate(lines, text))
    clean = bench.read_clean(case.page)
    scores["clean page"] = Score(100 * character_score(lines, clean), 100 * word_rate(lines, clean))
    return scores, shown


_bench: list[Bench] = []


def _start_worker(options: Options) -> None:
    _bench.append(Bench(options))


def _work(case: Case) -> CaseFigures:
    return run_case(case, _bench[0])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.no_reading and options.update_baseline:
        parser.error("a baseline holds OCR scores too: no --no-reading with --update-baseline")
    if options.corners and options.update_baseline:
        parser.error("the baseline is that of outlines that are seen: no --corners with --update-baseline")
    metrics = {name: METRICS[name] for name in METRICS if not (options.no_reading and name in OCR_METRICS)}
    data = data_folder(options.data)
    chosen = tuple(options.pages.split(",")) if options.pages else CHOSEN_PAGES
    pages, given = load_pages(data, chosen)
    if not given:
        print(f"no flat pages in {data}/pages: pages of our own are set instead", file=sys.stderr)
    peer = find_page_dewarp(options.page_dewarp) if options.peers else None
    if options.peers and peer is None:
        print("page-dewarp is not installed: see --page-dewarp", file=sys.stderr)
    sent = Options(
        data,
        chosen,
        None if options.no_reading else options.reader,
        options.rapidocr_python,
        peer,
        options.peer_limit,
        None if options.fresh else MEMORY,
        OUTPUT,
    )
    experiments = (
        list(EXPERIMENTS.values()) if options.experiment == "all" else [EXPERIMENTS[options.experiment]]
    )
    names = tuple(page.name for page in pages)
    own = sorted({name for experiment in experiments for name in experiment.pages})
    sent = replace(sent, own_pages=tuple(own), corners=options.corners)
    runs = [
        (experiment, degraded, all_cases(experiment, names, degraded=degraded)[: options.limit])
        for experiment in experiments
        for degraded in ((False, True) if options.both else (options.degraded,))
    ]
    progress = Progress(sum(len(cases) for _, _, cases in runs))
    measured_runs: dict[str, list[CaseFigures]] = {}
    all_good = True
    for experiment, degraded, cases in runs:
        name = experiment.file_name(degraded=degraded)
        done = []
        for figures in run_in_workers(_work, cases, _start_worker, sent, options.workers):
            done.append(figures)
            progress.tell(f"{experiment.name} {_progress(figures)}")
        done.sort(key=lambda case: case.name)
        given = ", true corners given" if options.corners else ""
        print(f"===== {name}{given}: {len(done)} photos =====\n\n{report(done, experiment.name)}")
        save_run(experiment, done, OUTPUT / name, degraded=degraded)
        verdict, good = judge(
            BASELINE / f"{name}.json", figures_by_case(done), metrics, update=options.update_baseline
        )
        print(f"\n{verdict}\n", flush=True)
        all_good &= good
        measured_runs[name.removeprefix("rectify_")] = done
    print(f"{summary(measured_runs)}\n\nfigures and pictures: {OUTPUT}")
    return 0 if all_good else 1


def _progress(case: CaseFigures) -> str:
    return (
        f"{case.name:<34} mesh {case.residual_percent:6.3f} %  fov {case.fov_deg:5.2f}  "
        f"normal {case.normal_deg:5.2f}  rulings {case.ruling_2d_deg:5.2f}  major {case.major_deg:4.2f}  "
        f"minor {case.minor_deg:4.2f}  CRS {score_of('rectified')(case):5.1f} {case.failure}"
    )


def _parser() -> argparse.ArgumentParser:
    parser = make_parser("rectify_simulated", __doc__)
    add = parser.add_argument
    add("--experiment", choices=(*EXPERIMENTS, "all"), default="planar", help="which photos")
    add("--limit", type=int, default=None, help="only the first N photos of each (a varied choice)")
    dirt = parser.add_mutually_exclusive_group()
    dirt.add_argument("--degraded", action="store_true", help="desk, shadow, vignetting, blur, noise, JPEG")
    dirt.add_argument("--both", action="store_true", help="clean, then degraded")
    add("--pages", default="", help="comma-separated names of other flat pages of the data")
    add("--peers", action="store_true", help="page-dewarp too (slow; its pages are kept for the next time)")
    add("--peer-limit", type=int, default=None, help="page-dewarp on the first N photos of each only")
    add("--corners", action="store_true", help="true corners are given where they lie in the photo")
    add("--no-reading", action="store_true", help="no OCR scores: much faster")
    return parser
