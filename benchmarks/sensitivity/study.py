"""Which parameters matter: every numeric field of a step changed by -20 % and +20 %, on a few reduced cases.

python -m benchmarks sensitivity --step rectify|page_choice|mosaic [--only TEXT] [--cases N]
    [--minutes N] [--fresh]

A field that changes no answer is tried at half and at twice its value too. What was measured is kept in
benchmarks/output/sensitivity_STEP.json, so that a run that was stopped goes on; `--fresh` does without.
The table shows the change of the mean error, and the number of cases whose answer changed at all.
"""

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.places import OUTPUT, data_folder
from benchmarks.sensitivity.fields import Field, Watch, find_fields, watching
from benchmarks.sensitivity.replay import Replay, find_slow, replaying
from benchmarks.sensitivity.report import (
    FAR,
    NEAR,
    FieldRecord,
    StudyRecord,
    Trial,
    format_study,
    load_study,
    save_study,
)
from benchmarks.sensitivity.steps import STEPS, Case, Outcome, Step


@dataclass(frozen=True, slots=True)
class Known:
    """A case with every default: its outcome, and the fields that it reads."""

    run: Case
    outcome: Outcome
    reads: frozenset[str]


class Study:
    """The cases of a step with their outcomes, and trials of single fields."""

    def __init__(
        self, cases: Mapping[str, Case], found: Sequence[Field], watch: Watch, replay: Replay
    ) -> None:
        self.watch, self.replay = watch, replay
        self.fields = found
        self.known = {name: self._observe(run) for name, run in cases.items()}

    def _observe(self, run: Case) -> Known:
        self.watch.reads.append(set())
        outcome = run()
        return Known(run, outcome, frozenset(self.watch.reads.pop()))

    @property
    def error(self) -> float:
        """Mean error with every default."""
        return float(np.mean([each.outcome.error for each in self.known.values()]))

    def measure(self, field: Field) -> FieldRecord:
        """Trials of one field, on the cases that read it."""
        readers = [name for name, each in self.known.items() if field.key in each.reads]
        trials: list[Trial] = []
        if readers:
            trials = [trial for factor in NEAR for trial in self._try(field, factor, readers)]
            if not any(trial.changed or trial.failed for trial in trials):
                trials += [trial for factor in FAR for trial in self._try(field, factor, readers)]
        self.replay.forget_changes()
        return FieldRecord(field.key, field.unit, _plain(field.value), len(readers), trials)

    def _try(self, field: Field, factor: float, readers: Sequence[str]) -> list[Trial]:
        value = field.changed(factor)
        if value is None:
            return []
        moved, changed, failed = 0.0, 0, 0
        with self.watch.changing(field, value):
            for name in readers:
                known = self.known[name]
                try:
                    outcome = known.run()
                except Exception as error:  # What a wild value does is a finding, and no reason to stop.
                    print(f"  {field.key} x {factor:g}, {name}: {error!r}", file=sys.stderr)
                    failed += 1
                    continue
                changed += outcome.answer != known.outcome.answer
                moved += outcome.error - known.outcome.error
        return [Trial(factor, _plain(value), moved / len(self.known), changed, failed)]


def _plain(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value


def run_study(
    step: Step,
    data: Path,
    file: Path,
    *,
    only: str = "",
    most_cases: int | None = None,
    minutes: float = 600.0,
    fresh: bool = False,
) -> StudyRecord:
    """Measure the fields that `file` does not hold yet for so many cases; it is written after each of them."""
    end = time.monotonic() + 60.0 * minutes
    cases = dict(list(step.cases(data).items())[:most_cases])
    if not cases:
        raise FileNotFoundError(f"no cases for {step.name} in {data}")
    found = find_fields(step.studied)
    watched = find_fields(step.packages)
    watch = Watch()
    replay = Replay(watch)
    slow = find_slow(step.packages, lambda: [run() for run in cases.values()])
    with ExitStack() as stack:
        stack.enter_context(watching(watched, watch))
        stack.enter_context(replaying(slow, step.packages, replay))
        study = Study(cases, found, watch, replay)
        before = None if fresh else load_study(file)
        kept = {each.key: each for each in before.fields} if before and before.cases == len(cases) else {}
        record = StudyRecord(step.name, step.error, study.error, len(cases), [])
        print(
            f"{step.name}: {len(found)} fields, {len(cases)} cases, mean error {study.error:.4f}", flush=True
        )
        for field in found:
            known = kept.get(field.key)
            if known is None or known.value != _plain(field.value):
                known = None
                if only in field.key and time.monotonic() < end:
                    known = study.measure(field)
                    print(f"  {known.line()}", flush=True)
            if known is not None:
                record.fields.append(known)
                save_study(file, record)
    return record


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the table; 0, or 1 where there is no data."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks sensitivity",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--step", choices=tuple(STEPS), required=True, help="which step's parameters")
    add("--data", default=None, help="folder of the data (default: DOCUMENT_DATA, else ../shared/data)")
    add("--only", default="", help="only fields whose module, class or name holds this text")
    add("--cases", type=int, default=None, help="only the first N cases")
    add("--minutes", type=float, default=600.0, help="begin no further field after this time")
    add("--fresh", action="store_true", help="keep nothing of earlier runs")
    given = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    file = OUTPUT / f"sensitivity_{given.step}.json"
    try:
        record = run_study(
            STEPS[given.step], data_folder(given.data), file,
            only=given.only, most_cases=given.cases, minutes=given.minutes, fresh=given.fresh,
        )  # fmt: skip
    except FileNotFoundError as error:
        print(error, file=sys.stderr)
        return 1
    print(format_study(record))
    return 0
