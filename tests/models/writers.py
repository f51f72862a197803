"""What processes of these tests do with a store; started from a server that has the imports already."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Barrier
from pathlib import Path
from typing import Any

from models.errors import VersionConflict
from models.feedback_records import FeedbackDraft, ModelChange
from models.repository import Store, utc_now
from models.ulid import UlidFactory
from tests.fork_server import CONTEXT

FILLING = "0123456789abcdef" * 1000
"""So that one write is of several pages."""


def start(work: Callable[..., None], *arguments: Any) -> multiprocessing.process.BaseProcess:
    process = CONTEXT.Process(target=work, args=arguments, daemon=True)
    process.start()
    return process


def write_versions(path: Path, barrier: Barrier, writer: int, count: int, reports: Connection) -> None:
    """Raise a counter in the model's document `count` times; report the conflicts on the way."""
    conflicts = 0
    with Store.open(path, busy_timeout_s=30) as store:
        barrier.wait()
        for _ in range(count):
            while True:
                current = store.model("letter")
                assert current.document is not None
                counted = {**current.document, "count": current.document["count"] + 1}
                counted[str(writer)] = counted.get(str(writer), 0) + 1
                try:
                    store.add_version("letter", counted, "feedback", expected_version=current.version)
                    break
                except VersionConflict:
                    conflicts += 1
    reports.send(conflicts)


def write_samples(path: Path, barrier: Barrier, writer: int, count: int, reports: Connection) -> None:
    """Add samples of a class that all writers make: half of them the same for all."""
    with Store.open(path, busy_timeout_s=30) as store:
        barrier.wait()
        created = [store.add_sample("memo", {"n": n, "by": n % 2 and writer}).created for n in range(count)]
    reports.send(sum(created))


def open_fresh(paths: list[Path | str], barrier: Barrier, reports: Connection) -> None:
    """Open databases that are not there yet, at the same moment as the others do."""
    for path in paths:
        barrier.wait()
        with Store.open(path) as store:
            store.add_version("letter", {}, "import")
    reports.send("done")


def write_until_killed(path: Path, writer: int, reports: Connection) -> None:
    """Write all that can be written, and tell of each thing once it is said to be kept."""
    with Store.open(path, busy_timeout_s=30) as store:
        step = 0
        while True:
            step += 1
            document = {"writer": writer, "step": step, "filling": FILLING}
            model = store.add_version("letter", document, "feedback")
            reports.send(("version", model.version, step))
            sample = store.add_sample("letter", document)
            reports.send(("sample", sample.id, step))
            if step % 5 == 0:
                store.delete_sample("letter", sample.id)
                reports.send(("deleted", sample.id, step))
            reports.send(("result", store.add_result(document, ttl_s=3600), step))


def feedback_of(writer: int, step: int, key: str) -> FeedbackDraft:
    """A feedback on a page of a memo that was found to be a letter; its result is no longer kept."""
    told = {"writer": writer, "step": step, "filling": FILLING}
    return FeedbackDraft(
        result_id=UlidFactory().make(utc_now()),
        key=key,
        request=told,
        report=told,
        found_class="letter",
        verified_class="memo",
        zones=10,
        wrong_zones=1,
        class_wrong=True,
        sample=told,
    )


def learn(store: Store, feedback: FeedbackDraft, names: tuple[str, ...]) -> int:
    """Count one up in the documents of these models by one feedback, as often as others are faster; how often."""
    conflicts = 0
    while True:
        changes = []
        for name in names:
            model = store.model(name)
            assert model.document is not None
            counted = {"count": model.document["count"] + 1, "last": dict(feedback.request)}
            changes.append(ModelChange(name, counted, model.version))
        try:
            assert store.add_feedback(feedback, changes).created
            return conflicts
        except VersionConflict:
            conflicts += 1


def post_feedback(where: Path | str, barrier: Barrier, writer: int, count: int, reports: Connection) -> None:
    """Have a model learn from `count` feedbacks, each of them posted twice; report the conflicts on the way."""
    conflicts = 0
    with Store.open(where, busy_timeout_s=30) as store:
        barrier.wait()
        for step in range(count):
            feedback = feedback_of(writer, step, f"{writer}-{step}")
            conflicts += learn(store, feedback, ("memo",))
            assert not store.add_feedback(feedback, [ModelChange("memo", {}, None)]).created
    reports.send(conflicts)


def post_feedback_until_killed(where: Path | str, writer: int, reports: Connection) -> None:
    """Have two models learn from feedback, and tell of each once it is said to be kept."""
    with Store.open(where, busy_timeout_s=30) as store:
        step = 0
        while True:
            step += 1
            learn(store, feedback_of(writer, step, f"{writer}-{step}"), ("letter", "memo"))
            reports.send(("feedback", f"{writer}-{step}", step))
