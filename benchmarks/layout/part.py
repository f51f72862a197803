"""A part of the layout benchmark: jobs for the workers, and the tables of their results."""

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.common.baseline import Figures
from benchmarks.layout.specimens import Specimen

Result = dict[str, Any]
"""What a job measured, as JSON has it."""
Results = dict[str, Result]
"""By job."""


@dataclass(frozen=True, slots=True)
class Part:
    """`jobs` names what can be measured on the pages, `measure` does one, `report` prints all, `figures` are for the
    baseline."""

    jobs: Callable[[Sequence[Specimen]], list[str]]
    measure: Callable[[str, Sequence[Specimen]], Result]
    report: Callable[[Results], str]
    figures: Callable[[Results], Figures]


def table(title: str, head: Sequence[str], rows: Sequence[Sequence[object]], first: int = 28) -> str:
    """Rows of text under their heads: the first column to the left, the others right, a dash for NaN and None."""
    widths = [max(9, len(name) + 2) for name in head[1:]]
    for row in rows:
        widths = [max(width, len(_cell(cell)) + 2) for width, cell in zip(widths, row[1:], strict=True)]
    first = max(first, len(head[0]) + 1, *(len(str(row[0])) + 1 for row in rows)) if rows else first
    lines = [
        title,
        f"{head[0]:<{first}}" + "".join(f"{n:>{w}}" for n, w in zip(head[1:], widths, strict=True)),
    ]
    for row in rows:
        cells = "".join(f"{_cell(cell):>{w}}" for cell, w in zip(row[1:], widths, strict=True))
        lines.append(f"{row[0]!s:<{first}}{cells}".rstrip())
    return "\n".join(lines)


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def share(part: float, whole: float) -> float:
    """Percent; NaN of nothing."""
    return 100 * part / whole if whole else float("nan")


def choose_parts(
    parser: argparse.ArgumentParser, options: argparse.Namespace, parts: Mapping[str, Part]
) -> list[str]:
    """Names of the parts that the command line asks for; what cannot be measured so ends the program."""
    names = options.parts.split(",") if options.parts else list(parts)
    if unknown := [name for name in names if name not in parts]:
        parser.error(f"no such part: {', '.join(unknown)} (there are {', '.join(parts)})")
    if options.update_baseline and (options.limit or options.no_reading):
        parser.error(
            "a baseline is of all pages, read: no --limit and no --no-reading with --update-baseline"
        )
    return names
