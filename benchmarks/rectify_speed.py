"""Time and memory of one upload, bytes to bytes, as a worker sees it, against the size of the photo.

python -m benchmarks.rectify_speed [--megapixels 3,6,12,24] [--degraded]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from typing import Any

import cv2
import numpy as np

from benchmarks.figures import plain_values, write_json
from benchmarks.places import OUTPUT
from benchmarks.stopwatch import Usage, measured
from benchmarks.subject import rectify_bytes
from simulation.degradation import PHONE
from simulation.pages import own_pages
from simulation.scenes import PAGE_SIZE, PHOTO_SIZE, POSES, photograph

WANTED_CPU_S, WANTED_PEAK_MB = 1.2, 700.0
"""Of a 12 megapixel JPEG, upright included."""
_REPEATS = 3
_MEGAPIXELS = (3.0, 6.0, 12.0, 24.0)


@dataclass(frozen=True, slots=True)
class SpeedFigures:
    """The median of a few runs in a process that has done the same before (imports, engine, caches)."""

    megapixels: float
    usage: Usage
    stages_ms: dict[str, float] = field(default_factory=dict)


def make_upload(megapixels: float, *, degraded: bool) -> bytes:
    """A JPEG of one of our own pages at about one photo pixel to the page pixel, pose no. 3."""
    scale = float(np.sqrt(megapixels * 1e6 / (PHOTO_SIZE[0] * PHOTO_SIZE[1])))
    page = own_pages(round(PAGE_SIZE[0] * scale), round(PAGE_SIZE[1] * scale))[0]
    size = (round(PHOTO_SIZE[0] * scale), round(PHOTO_SIZE[1] * scale))
    dirt = PHONE if degraded else None
    photo = photograph(page, POSES[2], 0.0, dirt=dirt, rng=np.random.default_rng(12), size=size)
    _, data = cv2.imencode(".jpg", photo.image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
    return data.tobytes()


def measure_upload(upload: bytes, megapixels: float) -> SpeedFigures:
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
    return SpeedFigures(megapixels, usage, stages_ms)


def format_speed(figures: Sequence[SpeedFigures]) -> str:
    """A column a size: CPU, peak, and every stage in milliseconds."""
    lines = [f"{'megapixels':<20}" + "".join(f"{entry.megapixels:>10.1f}" for entry in figures)]
    rows: dict[str, list[float]] = {
        "CPU s": [entry.usage.cpu_s for entry in figures],
        "CPU s / megapixel": [entry.usage.cpu_s / entry.megapixels for entry in figures],
        "peak MB": [entry.usage.peak_mb for entry in figures],
    }
    for stage in dict.fromkeys(stage for entry in figures for stage in entry.stages_ms):
        rows[f"  {stage} ms"] = [entry.stages_ms.get(stage, 0.0) for entry in figures]
    for label, values in rows.items():
        digits = 0 if label.endswith(("MB", "ms")) else 3
        lines.append(f"{label:<20}" + "".join(f"{value:>10.{digits}f}" for value in values))
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save; 1 when 12 megapixels cost more than is wanted."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rectify_speed", description=__doc__)
    parser.add_argument("--megapixels", default=",".join(f"{size:g}" for size in _MEGAPIXELS))
    parser.add_argument("--degraded", action="store_true", help="desk, shadow, vignetting, blur, noise, JPEG")
    options = parser.parse_args(arguments)
    figures = []
    for size in map(float, options.megapixels.split(",")):
        upload = make_upload(size, degraded=options.degraded)
        # One process a size: a peak of memory must not stand on what the last size left behind.
        with get_context("spawn").Pool(1) as pool:
            figures.append(pool.apply(measure_upload, (upload, size)))
        print(f"{size:g} megapixels: {figures[-1].usage.cpu_s:.2f} CPU s", file=sys.stderr, flush=True)
    print(format_speed(figures))
    saved: list[Any] = [plain_values(asdict(entry)) for entry in figures]
    write_json(OUTPUT / "rectify_speed.json", saved)
    slow = [entry for entry in figures if entry.megapixels == 12.0 and not _is_wanted(entry.usage)]
    if slow:
        print(f"12 megapixels cost more than {WANTED_CPU_S} CPU s or {WANTED_PEAK_MB:.0f} MB")
    return 1 if slow else 0


def _is_wanted(usage: Usage) -> bool:
    return usage.cpu_s <= WANTED_CPU_S and usage.peak_mb <= WANTED_PEAK_MB


if __name__ == "__main__":
    sys.exit(main())
