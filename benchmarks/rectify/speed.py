"""Time and memory of one upload, bytes to bytes, as a worker sees it, against the size of the photo.

A curved photo of 12 megapixels is added, page-dewarp beside it on the same JPEG.

python -m benchmarks rectify_speed [--megapixels 3,6,12,24] [--degraded] [--page-dewarp COMMAND | --no-peers]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from typing import Any

import cv2
import numpy as np

from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.peers import find_page_dewarp, run_page_dewarp, start_of_page_dewarp
from benchmarks.common.places import OUTPUT
from benchmarks.common.stopwatch import Usage, measured
from benchmarks.rectify.subject import rectify_bytes
from simulation.degradation import PHONE
from simulation.pages import own_pages
from simulation.scenes import BOOK, PAGE_SIZE, PHOTO_SIZE, PLANE, POSES, photograph

WANTED_CPU_S, WANTED_PEAK_MB = 1.2, 700.0
"""Of a 12 megapixel JPEG of a flat page, upright included."""
WANTED_CURVED_CPU_S, WANTED_CURVED_PEAK_MB, WANTED_PEER_RATIO = 3.0, 900.0, 5.0
"""Of one of a curved page, and how many times as long page-dewarp takes at least by Powell's method."""
_PEER_METHODS = {"Powell's method": "Powell", "its default": None}
"""By the words of the report; the default is L-BFGS-B with jax where that is installed."""
_WANTED_AT_MEGAPIXELS = 12.0
_REPEATS = 3
_MEGAPIXELS = (3.0, 6.0, 12.0, 24.0)


@dataclass(frozen=True, slots=True)
class SpeedFigures:
    """The median of a few runs in a process that has done the same before (imports, engine, caches)."""

    megapixels: float
    usage: Usage
    stages_ms: dict[str, float] = field(default_factory=dict)
    curved: bool = False

    @property
    def label(self) -> str:
        """Head of its column."""
        return f"{self.megapixels:.1f}" + (" curved" if self.curved else "")

    @property
    def is_wanted(self) -> bool:
        """Whether it is within what is wanted; nothing is of sizes other than 12 megapixels."""
        if self.megapixels != _WANTED_AT_MEGAPIXELS:
            return True
        cpu_s = WANTED_CURVED_CPU_S if self.curved else WANTED_CPU_S
        peak_mb = WANTED_CURVED_PEAK_MB if self.curved else WANTED_PEAK_MB
        return self.usage.cpu_s <= cpu_s and self.usage.peak_mb <= peak_mb


@dataclass(frozen=True, slots=True)
class PeerSpeed:
    """page-dewarp's run on the curved photo, of which `start` was spent before it saw the photo."""

    usage: Usage
    start: Usage
    trouble: str

    def ratio(self, ours: Usage) -> float:
        """Its CPU time over ours; its start is left out, as our worker has started once for all photos."""
        return (self.usage.cpu_s - self.start.cpu_s) / max(ours.cpu_s, 1e-9)


def make_upload(megapixels: float, *, degraded: bool, curved: bool = False) -> bytes:
    """A JPEG of one of our own pages at about one photo pixel to the page pixel, pose no. 3."""
    scale = float(np.sqrt(megapixels * 1e6 / (PHOTO_SIZE[0] * PHOTO_SIZE[1])))
    page = own_pages(round(PAGE_SIZE[0] * scale), round(PAGE_SIZE[1] * scale))[0]
    size = (round(PHOTO_SIZE[0] * scale), round(PHOTO_SIZE[1] * scale))
    dirt, shape = PHONE if degraded else None, BOOK if curved else PLANE
    photo = photograph(page, POSES[2], 0.0, shape, dirt=dirt, rng=np.random.default_rng(12), size=size)
    _, data = cv2.imencode(".jpg", photo.image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
    return data.tobytes()


def measure_upload(upload: bytes, megapixels: float, curved: bool) -> SpeedFigures:
    """Run in a fresh process; what is measured begins and ends with bytes."""
    cv2.setNumThreads(1)
    rectify_bytes(upload)
    runs: list[tuple[Usage, dict[str, float]]] = []
    for _ in range(_REPEATS):
        with measured() as usage:
            stages_ms = rectify_bytes(upload)
        runs.append((usage, stages_ms))
    runs.sort(key=lambda run: run[0].cpu_s)
    usage, stages_ms = runs[len(runs) // 2]
    return SpeedFigures(megapixels, usage, stages_ms, curved)


def measure_peer(command: str, upload: bytes, method: str | None) -> PeerSpeed:
    """page-dewarp by one of its methods on the same JPEG, in a process of its own."""
    _, usage, trouble = run_page_dewarp(command, upload, method)
    return PeerSpeed(usage, start_of_page_dewarp(command), trouble)


def format_speed(figures: Sequence[SpeedFigures]) -> str:
    """A column a photo: CPU, peak, and every stage in milliseconds."""
    lines = [f"{'megapixels':<20}" + "".join(f"{entry.label:>13}" for entry in figures)]
    rows: dict[str, list[float]] = {
        "CPU s": [entry.usage.cpu_s for entry in figures],
        "CPU s / megapixel": [entry.usage.cpu_s / entry.megapixels for entry in figures],
        "peak MB": [entry.usage.peak_mb for entry in figures],
    }
    for stage in dict.fromkeys(stage for entry in figures for stage in entry.stages_ms):
        rows[f"  {stage} ms"] = [entry.stages_ms.get(stage, 0.0) for entry in figures]
    for label, values in rows.items():
        digits = 0 if label.endswith(("MB", "ms")) else 3
        lines.append(f"{label:<20}" + "".join(f"{value:>13.{digits}f}" for value in values))
    return "\n".join(lines)


def format_peer(label: str, peer: PeerSpeed, ours: Usage) -> str:
    """page-dewarp's time beside ours, on the same curved photo."""
    with_start = peer.usage.cpu_s / max(ours.cpu_s, 1e-9)
    failed = f" (it failed: {peer.trouble})" if peer.trouble else ""
    return (
        f"page-dewarp ({label}) on the curved photo{failed}: {peer.usage.cpu_s:.2f} CPU s, "
        f"{peer.start.cpu_s:.2f} of them its start, {peer.usage.peak_mb:.0f} MB; "
        f"ours {ours.cpu_s:.2f} CPU s, {ours.peak_mb:.0f} MB: "
        f"{peer.ratio(ours):.1f} times ours ({with_start:.1f} with its start)"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save; 1 when 12 megapixels cost more than is wanted, or page-dewarp is too near."""
    options = _parser().parse_args(arguments)
    command = None if options.no_peers else find_page_dewarp(options.page_dewarp)
    if command is None and not options.no_peers:
        print("page-dewarp is not installed: see --page-dewarp", file=sys.stderr)
    figures: list[SpeedFigures] = []
    peers: dict[str, PeerSpeed] = {}
    wanted = [(size, False) for size in map(float, options.megapixels.split(","))]
    for size, curved in [*wanted, (_WANTED_AT_MEGAPIXELS, True)]:
        upload = make_upload(size, degraded=options.degraded, curved=curved)
        # One process a photo: a peak of memory must not stand on what the last one left behind.
        with get_context("spawn").Pool(1) as pool:
            figures.append(pool.apply(measure_upload, (upload, size, curved)))
        print(
            f"{figures[-1].label} megapixels: {figures[-1].usage.cpu_s:.2f} CPU s",
            file=sys.stderr,
            flush=True,
        )
        if curved and command:
            for label, method in _PEER_METHODS.items():
                peers[label] = measure_peer(command, upload, method)
    print(format_speed(figures))
    saved: list[Any] = [plain_values(asdict(entry)) for entry in figures]
    good = True
    for entry in figures:
        if not entry.is_wanted:
            print(f"{entry.label} megapixels cost more than is wanted")
            good = False
    ours = figures[-1].usage
    for label, peer in peers.items():
        print(format_peer(label, peer, ours))
        ratio = peer.ratio(ours)
        saved.append({f"page-dewarp, {label}": plain_values(asdict(peer)), "ratio": round(ratio, 3)})
        if _PEER_METHODS[label] == "Powell" and not peer.trouble and ratio < WANTED_PEER_RATIO:
            print(f"page-dewarp takes less than {WANTED_PEER_RATIO:g} times as long")
            good = False
    write_json(OUTPUT / "rectify_speed.json", saved)
    return 0 if good else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks rectify_speed",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--megapixels", default=",".join(f"{size:g}" for size in _MEGAPIXELS), help="of the flat photos")
    add("--degraded", action="store_true", help="desk, shadow, vignetting, blur, noise, JPEG")
    add("--page-dewarp", default=None, help="page-dewarp's command (default: PAGE_DEWARP, else the PATH)")
    add("--no-peers", action="store_true", help="ours alone")
    return parser
