"""Jobs of the layout benchmarks' parts, done by a few processes; what was done before may be kept."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2

from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.places import REPOSITORY
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.part import Part, Result, Results
from benchmarks.layout.specimens import Specimen

_SOURCES = (
    "services/layout/**/*.py",
    "services/contract/*.py",
    "services/operations/*.py",
    "benchmarks/layout/*.py",
)
"""The code that a layout benchmark measures and is made of, beside the module of the part."""


@dataclass(frozen=True, slots=True)
class Job:
    """One measurement of a part."""

    part: str
    name: str
    measure: Callable[[str, Sequence[Specimen]], Result]


class KeptResults:
    """Results of jobs in files, so that a run that was stopped goes on; with None nothing is kept.

    They are filed under a digest of the pages and of the code (`_SOURCES`): a change of either finds none.
    """

    def __init__(self, folder: Path | None, specimens: Sequence[Specimen]) -> None:
        self._folder = folder
        digest = hashlib.sha256()
        for specimen in specimens:
            digest.update(repr((specimen.name, specimen.source, specimen.true, specimen.own)).encode())
        for file in sorted(file for pattern in _SOURCES for file in REPOSITORY.glob(pattern)):
            digest.update(file.read_bytes())
        self._digest = digest.hexdigest()

    def find(self, job: Job) -> Result | None:
        """What the job measured in an earlier run."""
        file = self._file(job)
        if file is None or not file.is_file():
            return None
        result: Result = json.loads(file.read_text(encoding="utf-8"))
        return result

    def keep(self, job: Job, result: Result) -> None:
        """Times are kept too: they are those of the run in which they were measured."""
        file = self._file(job)
        if file is not None:
            write_json(file, plain_values(result))

    def _file(self, job: Job) -> Path | None:
        if self._folder is None:
            return None
        told = hashlib.sha256(f"{self._digest} {job.part} {job.name}".encode())
        told.update(Path(job.measure.__code__.co_filename).read_bytes())
        name = told.hexdigest()[:32]
        return self._folder / f"{name}.json"


_specimens: list[Specimen] = []


def _start(specimens: Sequence[Specimen]) -> None:
    cv2.setNumThreads(1)
    _specimens.extend(specimens)


def _measure(job: Job) -> tuple[Job, Result]:
    return job, job.measure(job.name, _specimens)


def measure_all(
    parts: Mapping[str, Part],
    specimens: Sequence[Specimen],
    workers: int,
    slowest_first: Sequence[str] = (),
    kept: KeptResults | None = None,
) -> dict[str, Results]:
    """Results of all jobs by part, in the order of the parts and their jobs."""
    jobs = [Job(name, job, part.measure) for name, part in parts.items() for job in part.jobs(specimens)]
    done: dict[Job, Result] = {}
    for job in jobs:
        result = kept.find(job) if kept else None
        if result is not None:
            done[job] = result
    first = sorted((job for job in jobs if job not in done), key=lambda job: job.part not in slowest_first)
    progress = Progress(len(first))
    for job, result in run_in_workers(_measure, first, _start, list(specimens), workers):
        done[job] = result
        if kept:
            kept.keep(job, result)
        progress.tell(f"{job.part}: {job.name}")
    results: dict[str, Results] = {part: {} for part in parts}
    for job in jobs:
        results[job.part][job.name] = done[job]
    return results
