"""Figures against the committed ones: a regression is flagged, an improvement is kept on request."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.common.figures import write_json


@dataclass(frozen=True, slots=True)
class Metric:
    """How one figure is judged: `slack` is what its mean may worsen by, in its unit."""

    slack: float
    larger_is_better: bool = False


Figures = dict[str, dict[str, float]]
"""Case -> metric -> value. Times are left out: they belong to a machine."""


def compare(current: Figures, committed: Figures, metrics: Mapping[str, Metric]) -> list[str]:
    """A line for every metric whose mean over the shared cases worsened by more than its slack.

    A case that had a figure and has none now is a regression too.
    """
    shared = sorted(set(current) & set(committed))
    found = []
    for name, metric in metrics.items():
        had = [case for case in shared if name in committed[case]]
        lost = [case for case in had if name not in current[case]]
        if lost:
            found.append(f"{name}: no figure any more for {', '.join(lost)}")
        both = [case for case in had if name in current[case]]
        if not both:
            continue
        now = float(np.mean([current[case][name] for case in both]))
        then = float(np.mean([committed[case][name] for case in both]))
        worse = then - now if metric.larger_is_better else now - then
        if worse > metric.slack + 1e-9:
            found.append(f"{name}: {now:.3f}, baseline {then:.3f} (mean of {len(both)} cases)")
    return found


def judge(path: Path, current: Figures, metrics: Mapping[str, Metric], *, update: bool) -> tuple[str, bool]:
    """Report against the committed file, and whether nothing got worse; `update` adopts the figures."""
    committed: Figures = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    if update:
        write_json(path, {**committed, **current})
        return f"baseline updated: {path.name}, {len(current)} cases", True
    shared = set(current) & set(committed)
    if not shared:
        return "no baseline for these cases (--update-baseline makes one)", True
    worse = compare(current, committed, metrics)
    if worse:
        return "WORSE THAN THE BASELINE:\n  " + "\n  ".join(worse), False
    return f"no worse than the baseline on {len(shared)} cases", True
