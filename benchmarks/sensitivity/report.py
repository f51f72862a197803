"""The record of a sensitivity study: its file, and its tables."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.common.figures import write_json

NEAR = (0.8, 1.2)
FAR = (0.5, 2.0)
"""Factors of a field's default; the far ones for fields that move nothing at the near ones."""
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

    def effect(self, factors: Sequence[float]) -> float:
        """Largest change of the mean error at these factors, without sign."""
        return max((abs(trial.error_change) for trial in self.trials if trial.factor in factors), default=0.0)

    def moves_at(self, factors: Sequence[float]) -> bool:
        """Whether any answer changed, or failed, at these factors."""
        return any(trial.changed or trial.failed for trial in self.trials if trial.factor in factors)

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
    near = [each for each in record.fields if each.moves_at(NEAR)]
    near.sort(key=lambda each: -each.effect(NEAR))
    harmless = [each for each in near if not each.effect(NEAR)]
    far = [each for each in record.fields if each.moves_at(FAR)]
    still = [each for each in record.fields if each.readers and not each.moves_at(NEAR + FAR)]
    unread = [each for each in record.fields if not each.readers]
    lines = [
        f"### {record.step}",
        "",
        f"{len(record.fields)} fields, {record.cases} cases. Error: {record.figure}; "
        f"with every default {record.error:.4g}. At -20 % or +20 % {len(near)} fields change an answer, "
        f"{len(harmless)} of them without a change of the error. The {MOST_SENSITIVE} that change it most:",
        "",
        "| field | unit | value | -20 % | +20 % | cases changed |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [_row(each) for each in near[:MOST_SENSITIVE]]
    for head, found in (
        ("Answers change only at half or at twice the value", far),
        ("Nothing changes, not at half or twice the value either", still),
        ("Read by no case", unread),
    ):
        lines += ["", f"{head} ({len(found)}): {_names(found)}."]
    return "\n".join(lines)


def _row(each: FieldRecord) -> str:
    by_factor = {trial.factor: trial for trial in each.trials}
    near = [by_factor.get(factor) for factor in NEAR]
    changes = " | ".join("" if trial is None else f"{trial.error_change:+.3g}" for trial in near)
    counts = ", ".join("-" if trial is None else str(trial.changed + trial.failed) for trial in near)
    name = ".".join(each.key.split(".")[-2:])
    return f"| `{name}` | {each.unit} | {each.value} | {changes} | {counts} |"


def _names(found: Sequence[FieldRecord]) -> str:
    """Fields by their class."""
    by_class: dict[str, list[str]] = {}
    for each in found:
        owner, name = each.key.rsplit(".", 1)
        by_class.setdefault(owner.rsplit(".", 1)[-1], []).append(name)
    return "; ".join(f"`{owner}` {', '.join(names)}" for owner, names in sorted(by_class.items())) or "none"
