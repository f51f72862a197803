"""The dissertation's tables in its form, ours beside its."""

import math
from collections.abc import Iterable, Mapping, Sequence

from benchmarks.common.figures import GROUPS, CaseFigures, Pick, groups, mean_std
from benchmarks.rectify.dissertation import Row

_WIDTH = 15


def format_table(
    title: str,
    columns: Mapping[str, Pick],
    cases: Sequence[CaseFigures],
    printed: Mapping[str, Row] | None = None,
    by: Sequence[str] = GROUPS,
) -> str:
    """Rows of mean/std of all and `by` group; `printed` (the dissertation's, of the first columns) to the right."""
    names = list(columns)
    head = f"{'(mean/std)':<12}" + "".join(f"{name:>{_WIDTH}}" for name in names)
    if printed:
        known = names[: max(map(len, printed.values()))]
        head += "  |" + "".join(f"{name:>{_WIDTH}}" for name in known) + "  (dissertation)"
    lines = [title, head]
    for label, members in groups(cases, by).items():
        line = f"{label:<12}"
        for pick in columns.values():
            line += f"{mean_over_std(*mean_std(pick(case) for case in members)):>{_WIDTH}}"
        if printed:
            row = printed.get(label, ())
            line += "  |" + "".join(f"{mean_over_std(*pair):>{_WIDTH}}" for pair in row)
        lines.append(line.rstrip())
    return "\n".join(lines)


def mean_over_std(mean: float, std: float) -> str:
    """As the dissertation prints it: 0.31/0.04; a dash where there is nothing."""
    return f"{mean:.2f}/{std:.2f}" if math.isfinite(mean) else "-"


def format_usage(cases: Sequence[CaseFigures]) -> str:
    """CPU seconds and peak memory of the benchmark's steps, and CPU of the pipeline's own stages."""
    lines = [f"{'step':<26}{'CPU s mean':>12}{'CPU s max':>12}{'peak MB max':>13}"]
    for step in _keys(case.usage for case in cases):
        taken = [case.usage[step] for case in cases if step in case.usage]
        cpu = [usage.cpu_s for usage in taken]
        peak = max(usage.peak_mb for usage in taken)
        lines.append(f"{step:<26}{sum(cpu) / len(cpu):>12.2f}{max(cpu):>12.2f}{peak:>13.0f}")
    for stage in _keys(case.stages_ms for case in cases):
        spent = [case.stages_ms[stage] / 1000 for case in cases if stage in case.stages_ms]
        lines.append(f"{'  rectify: ' + stage:<26}{sum(spent) / len(spent):>12.2f}{max(spent):>12.2f}")
    return "\n".join(lines)


def _keys(mappings: Iterable[Mapping[str, object]]) -> list[str]:
    """Keys of all mappings in the order of their first appearance."""
    return list(dict.fromkeys(key for mapping in mappings for key in mapping))
