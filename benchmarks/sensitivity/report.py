"""The record of a sensitivity study: its file, and its tables."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.common.figures import write_json

MOST_SENSITIVE = 12


@dataclass(frozen=True, slots=True)
class Trial:
    """A field at `factor` times its default.

    error_change: of the mean error over all cases (more than 0: worse); changed, failed: number of cases whose
    answer was another one, or that raised what is no refusal.
    """

    factor: float
    value: object
    error_change: float
    changed: int
    failed: int


@dataclass(frozen=True, slots=True)
class FieldRecord:
    """A field and its trials; none where no case reads it (`readers` is the number that do)."""

    key: str
    unit: str
    value: object
    readers: int
    trials: list[Trial]

    @property
    def effect(self) -> float:
        """Largest change of the mean error, without sign."""
        return max((abs(trial.error_change) for trial in self.trials), default=0.0)

    @property
    def moves(self) -> bool:
        """Whether any answer changed, or failed, in any trial."""
        return any(trial.changed or trial.failed for trial in self.trials)

    def line(self) -> str:
        """One line: every trial with the number of changed cases, and an exclamation mark for each that failed."""
        told = "  ".join(
            f"x{trial.factor:g} {trial.error_change:+.4f} ({trial.changed})" + "!" * trial.failed
            for trial in self.trials
        )
        return f"{self.key:<72}{self.unit:>6} {self.value!s:>12} {self.readers:>3}  {told}"


@dataclass(frozen=True, slots=True)
class StudyRecord:
    """All fields of a step; `error` is the mean over the cases with every default."""

    step: str
    figure: str
    error: float
    cases: int
    fields: list[FieldRecord]


def save_study(file: Path, record: StudyRecord) -> None:
    """As JSON."""
    write_json(file, asdict(record))


def load_study(file: Path) -> StudyRecord | None:
    """The record that `file` holds; None where there is none."""
    if not file.is_file():
        return None
    told = json.loads(file.read_text(encoding="utf-8"))
    fields = [
        FieldRecord(**{**each, "trials": [Trial(**one) for one in each["trials"]]}) for each in told["fields"]
    ]
    return StudyRecord(**{**told, "fields": fields})


def format_study(record: StudyRecord) -> str:
    """Tables in Markdown: the most sensitive fields, those that move nothing, and those that no case reads."""
    moving = sorted((each for each in record.fields if each.moves), key=lambda each: -each.effect)
    still = [each for each in record.fields if each.readers and not each.moves]
    unread = [each for each in record.fields if not each.readers]
    lines = [
        f"### {record.step}",
        "",
        f"{len(record.fields)} fields, {record.cases} cases. Error: {record.figure}; "
        f"with every default {record.error:.4g}.",
        f"{len(moving)} fields change an answer, {sum(not each.effect for each in moving)} of them without a change "
        f"of the error; {len(still)} move nothing, {len(unread)} are read by no case.",
        "",
        "| field | unit | value | -20 % | +20 % | cases changed |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [_row(each) for each in moving[:MOST_SENSITIVE]]
    lines += ["", f"Nothing moves, not at half or twice the value either: {_names(still)}.", ""]
    lines += [f"Read by no case: {_names(unread)}."]
    return "\n".join(lines)


def _row(each: FieldRecord) -> str:
    by_factor = {trial.factor: trial for trial in each.trials}
    near = [by_factor.get(factor) for factor in (0.8, 1.2)]
    changes = " | ".join("" if trial is None else f"{trial.error_change:+.3g}" for trial in near)
    counts = ", ".join("-" if trial is None else str(trial.changed + trial.failed) for trial in near)
    return f"| `{each.key}` | {each.unit} | {each.value} | {changes} | {counts} |"


def _names(found: Sequence[FieldRecord]) -> str:
    """Fields by their class."""
    by_class: dict[str, list[str]] = {}
    for each in found:
        owner, name = each.key.rsplit(".", 1)
        by_class.setdefault(owner.rsplit(".", 1)[-1], []).append(name)
    return "; ".join(f"`{owner}` {', '.join(names)}" for owner, names in sorted(by_class.items())) or "none"
