"""Time, proofs and gaps of matching on simulated cost tables of pages, against the number of zones and labels.

python -m benchmarks layout_matching [--pages 20] [--two-steps]
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.layout.simulated_cost_tables import EASY, HARD, HOPELESS, TYPICAL, Hardness, simulated_tables
from services.layout.matching import MatchingParameters, match_directly, match_in_two_steps
from services.layout.matching.cost_tables import CostTables, Matching

WANTED_MS = {(15, 10): 2.0, (60, 15): 50.0}
"""Median CPU time of a direct matching of a typical page, by zones and labels."""
SIZES = ((15, 10, 1.0), (30, 12, 1.0), (60, 15, 1.0), (200, 15, 0.2))
"""Zones, labels besides null, share of pairs that have costs."""
LEVELS = {"easy": EASY, "typical": TYPICAL, "hard": HARD, "hopeless": HOPELESS}
_REPEATS = 3


@dataclass(frozen=True, slots=True)
class MatchingFigures:
    """One page, matched one way: CPU time (the least of a few runs), what was proved, zones labelled rightly."""

    cpu_ms: float
    optimal: bool
    gap: float
    explored: int
    right: float


def measure(match: Callable[[], Matching], truth: np.ndarray) -> MatchingFigures:
    spent = []
    for _ in range(_REPEATS):
        start = time.process_time()
        found = match()
        spent.append(time.process_time() - start)
    right = float((found.labels == truth).mean())
    return MatchingFigures(1000 * min(spent), found.optimal, found.gap, found.explored, right)


def measure_pages(
    zones: int, labels: int, density: float, level: Hardness, pages: int, *, two_steps: bool
) -> list[MatchingFigures]:
    """Figures of `pages` simulated pages, seeds 0, 1, ..."""
    # the simulated zones have no boxes that agree with their relations
    figures, parameters = [], MatchingParameters(manhattan=False)
    for seed in range(pages):
        rng = np.random.default_rng(seed)
        tables, truth = simulated_tables(zones, labels, level, rng, density)
        boxes = _grid(zones)

        def match(tables: CostTables = tables, boxes: np.ndarray = boxes) -> Matching:
            if two_steps:
                return match_in_two_steps(tables, boxes, parameters).matching
            return match_directly(tables, parameters)

        figures.append(measure(match, truth))
    return figures


def _grid(zones: int) -> np.ndarray:
    """Boxes (N, 4) in rows of three that do not overlap."""
    row, column = np.divmod(np.arange(zones), 3)
    corner = np.stack([100.0 * column, 30.0 * row], 1)
    return np.hstack([corner, corner + np.array([90.0, 20.0])])


def format_row(name: str, figures: Sequence[MatchingFigures]) -> str:
    cpu = [figure.cpu_ms for figure in figures]
    means = [
        float(np.mean([getattr(figure, part) for figure in figures]))
        for part in ("optimal", "gap", "explored", "right")
    ]
    return (
        f"{name:<26}{np.median(cpu):>10.2f}{np.percentile(cpu, 95):>10.2f}{100 * means[0]:>10.0f}{means[1]:>10.2f}"
        f"{means[2]:>10.0f}{100 * means[3]:>10.1f}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks layout_matching", description=__doc__)
    parser.add_argument("--pages", type=int, default=20, help="simulated pages of each kind")
    parser.add_argument("--two-steps", action="store_true", help="measure the two steps besides")
    options = parser.parse_args(arguments)
    too_slow = []
    columns = ("ms median", "ms 95 %", "proved %", "gap", "explored", "right %")
    print(f"{'zones x labels':<26}" + "".join(f"{name:>10}" for name in columns))
    for two_steps in (False, True) if options.two_steps else (False,):
        print("in two steps" if two_steps else "direct")
        for zones, labels, density in SIZES:
            for name, level in LEVELS.items():
                figures = measure_pages(zones, labels, density, level, options.pages, two_steps=two_steps)
                print(format_row(f"{zones} x {labels} {name}", figures), flush=True)
                median = float(np.median([figure.cpu_ms for figure in figures]))
                wanted = WANTED_MS.get((zones, labels))
                if wanted is not None and name == "typical" and not two_steps and median > wanted:
                    too_slow.append(f"{zones} x {labels}: {median:.2f} ms, wanted {wanted:.1f}")
    for line in too_slow:
        print("too slow:", line)
    return 1 if too_slow else 0
