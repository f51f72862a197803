"""Several processes on one file: none waits in vain, none undoes another's work, none leaves half of its own."""

import random
import signal
import sqlite3
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from models.repository import Store
from tests.fork_server import CONTEXT
from tests.models import writers
from tests.models.databases import make_file
from tests.models.whole_database import everything
from tests.models.writers import start


def all_reports(pipes: list[Connection]) -> list[Any]:
    for pipe in pipes:
        assert pipe.poll(60)
    return [pipe.recv() for pipe in pipes]


def test_writers_lose_no_update(tmp_path: Path) -> None:
    path, count, number = make_file(tmp_path / "store.sqlite3"), 12, 3
    with Store.open(path) as store:
        store.add_version("letter", {"count": 0}, "import")
    barrier = CONTEXT.Barrier(2 * number)
    receiving, processes = [], []
    for work in (writers.write_versions, writers.write_samples):
        for writer in range(number):
            receiver, sender = CONTEXT.Pipe(duplex=False)
            processes.append(start(work, path, barrier, writer, count, sender))
            receiving.append(receiver)
    conflicts, created = all_reports(receiving[:number]), all_reports(receiving[number:])
    for process in processes:
        process.join()
        assert process.exitcode == 0
    with Store.open(path) as store:
        model = store.model("letter")
        assert model.version == 1 + number * count
        assert model.document == {"count": number * count, **{str(n): count for n in range(number)}}
        history = store.model_versions("letter")
        assert [version.version for version in history] == list(range(1, number * count + 2))
        counts = [store.model("letter", version.version).document for version in history]
        assert [document and document["count"] for document in counts] == list(range(number * count + 1))
        # Of each two pages one is the same for all writers, and counts once.
        assert sum(created) == store.sample_count("memo") == count // 2 + number * count // 2
    assert all(found >= 0 for found in conflicts)
    assert sum(conflicts) > 0  # they did meet


def test_no_feedback_is_lost(where: Path | str) -> None:
    count, number = 10, 3
    with Store.open(where) as store:
        store.add_version("memo", {"count": 0}, "import")
        store.add_version("letter", {"count": 0}, "import")
    barrier = CONTEXT.Barrier(number)
    pipes = [CONTEXT.Pipe(duplex=False) for _ in range(number)]
    processes = [
        start(writers.post_feedback, where, barrier, writer, count, sender)
        for writer, (_, sender) in enumerate(pipes)
    ]
    conflicts = all_reports([receiver for receiver, _ in pipes])
    for process in processes:
        process.join()
        assert process.exitcode == 0
    with Store.open(where) as store:
        check_feedback(store, ("memo",), number * count)
        assert store.model("letter").version == 1
    assert sum(conflicts) > 0  # they did meet


def check_feedback(store: Store, names: tuple[str, ...], count: int) -> set[str]:
    """`count` feedbacks are there with all that came of each, and nothing else is; their keys."""
    rows = everything(store)
    assert store.health("memo").feedbacks == count == len(rows["layout_feedback"])
    told = sorted(store.feedbacks("memo", newest=count), key=lambda feedback: feedback.versions["memo"][1])
    samples = {sample.id: sample for sample in store.samples("memo")}
    assert {feedback.sample_id for feedback in told} == samples.keys()
    for name in names:
        assert store.model(name).version == count + 1
        versions = [version.version for version in store.model_versions(name)]
        assert versions == list(range(1, count + 2))
        assert [feedback.versions[name] for feedback in told] == [(n, n + 1) for n in range(1, count + 1)]
        for n, feedback in enumerate(told, start=1):
            document = store.model(name, n + 1).document
            assert document is not None
            sample = samples[str(feedback.sample_id)]
            assert document == {"count": n, "last": sample.document}
            assert sample.result_id == feedback.result_id
    assert len(rows["layout_feedback_models"]) == 2 * count  # a letter was found, a memo verified
    return {f"{sample.document['writer']}-{sample.document['step']}" for sample in samples.values()}


def test_processes_that_open_a_fresh_database_at_once(fresh: Callable[[], Path | str]) -> None:
    paths, number = [fresh() for _ in range(4)], 3
    barrier = CONTEXT.Barrier(number)
    pipes = [CONTEXT.Pipe(duplex=False) for _ in range(number)]
    processes = [start(writers.open_fresh, paths, barrier, sender) for _, sender in pipes]
    assert all_reports([receiver for receiver, _ in pipes]) == ["done"] * number
    for process in processes:
        process.join()
    for path in paths:
        with Store.open(path) as store:
            assert store.model("letter").version == number


ROUNDS = 4
FEEDBACK_ROUNDS = 2
Kept = dict[str, dict[Any, tuple[int, int]]]
"""What writers said is kept: by kind, then by version or id, which writer wrote it in which step."""


@dataclass
class Writer:
    """A process that writes until it is killed."""

    number: int
    process: BaseProcess
    reports: Connection


def test_killed_writers_leave_nothing_by_halves(tmp_path: Path) -> None:
    """SIGKILL at moments that the other writer's progress decides, again and again on the same file."""
    path, generator = make_file(tmp_path / "store.sqlite3"), random.Random(5)
    with Store.open(path) as store:
        store.add_version("letter", {}, "import")
    kept: Kept = {"version": {}, "sample": {}, "deleted": {}, "result": {}}
    for number in range(ROUNDS):
        first, second = (begin(writers.write_until_killed, path, 2 * number + which) for which in (0, 1))
        for _ in range(generator.randint(1, 12)):
            note(kept, second)
        kill(kept, first)
        for _ in range(generator.randint(1, 12)):
            note(kept, second)  # it gets on, whatever the other one held
        kill(kept, second)
        if number % 4 == 3:
            check(path, kept, kills=2 * (number + 1))


def test_killed_writers_leave_no_half_of_a_feedback(where: Path | str) -> None:
    """Two models, a sample and the feedback itself: whenever SIGKILL comes, all of them are there or none."""
    generator = random.Random(6)
    with Store.open(where) as store:
        for name in ("letter", "memo"):
            store.add_version(name, {"count": 0}, "import")
    kept: Kept = {"feedback": {}}
    for number in range(FEEDBACK_ROUNDS):
        first, second = (
            begin(writers.post_feedback_until_killed, where, 2 * number + which) for which in (0, 1)
        )
        for _ in range(generator.randint(1, 6)):
            note(kept, second)
        kill(kept, first)
        for _ in range(generator.randint(1, 6)):
            note(kept, second)
        kill(kept, second)
    with Store.open(where, busy_timeout_s=30) as store:
        assert store.add_sample("fax", {}).created  # a killed writer's lock is gone
        count = store.health("memo").feedbacks
        there = check_feedback(store, ("letter", "memo"), count)
    assert kept["feedback"].keys() <= there
    assert len(there) - len(kept["feedback"]) <= 2 * FEEDBACK_ROUNDS


def begin(work: Callable[..., None], where: Path | str, number: int) -> Writer:
    receiver, sender = CONTEXT.Pipe(duplex=False)
    process = start(work, where, number, sender)
    sender.close()
    return Writer(number, process, receiver)


def note(kept: Kept, writer: Writer) -> None:
    assert writer.reports.poll(60), "the writer does not get on"
    kind, what, step = writer.reports.recv()
    kept[kind][what] = writer.number, step


def kill(kept: Kept, writer: Writer) -> None:
    """Kill it, and take what it still had in its pipe."""
    writer.process.kill()
    writer.process.join()
    assert writer.process.exitcode == -signal.SIGKILL
    with suppress(EOFError):
        while True:
            note(kept, writer)


def check(path: Path, kept: Kept, kills: int) -> None:
    """All that was said to be kept is there and whole; of what was not said, a kill may have kept one thing."""
    connection = sqlite3.connect(path)
    assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    assert connection.execute("PRAGMA foreign_key_check").fetchall() == []
    results = {result for (result,) in connection.execute("SELECT id FROM layout_results")}
    connection.close()
    with Store.open(path) as store:
        history = [version.version for version in store.model_versions("letter")]
        assert history == list(range(1, len(history) + 1))
        assert store.model("letter").version == len(history)
        versions = {version: store.model("letter", version).document for version in history[1:]}
        samples = {sample.id: sample.document for sample in store.samples("letter")}
        found: dict[str, dict[Any, Any]] = {
            "version": versions,
            "sample": samples,
            "result": {result: store.result(result).document for result in results},
        }
    for documents in found.values():
        assert all(document["filling"] == writers.FILLING for document in documents.values())
    made = {
        kind: {what: (document["writer"], document["step"]) for what, document in documents.items()}
        for kind, documents in found.items()
    }
    gone = kept["sample"].keys() - samples.keys()
    unsaid = len(gone - kept["deleted"].keys())
    assert kept["deleted"].keys() <= gone
    for kind, theirs in made.items():
        said = {what: who for what, who in kept[kind].items() if kind != "sample" or what not in gone}
        assert said.items() <= theirs.items()
        unsaid += len(theirs) - len(said)
    assert unsaid <= kills
