"""What the benchmark of jobs reads in logs, and the service that does nothing."""

import json
import threading
import time

import pytest

from benchmarks.jobs import supervisor
from benchmarks.jobs.idle_service import IDLE, answer
from benchmarks.jobs.processes import Deployment, NotStarted, Process
from services.contract.operations import Operation


def line(message: str, job: str, state: str = "") -> str:
    return json.dumps({"message": message, "job": job, "state": state})


def test_a_job_of_a_killed_process_is_followed_until_it_runs_elsewhere() -> None:
    deployment = Deployment()
    first, second = (Process(deployment, "app", "worker", workers=1) for _ in range(2))
    deployment.note(line("job started", "a"), first)
    deployment.note(line("job ended", "a", "succeeded"), first)
    deployment.note(line("job started", "b"), first)
    deployment.note_kill(first)
    assert deployment.recoveries_s == []
    deployment.note(line("job started", "b"), second)
    assert len(deployment.recoveries_s) == 1
    deployment.note(line("job ended", "b", "succeeded"), second)
    assert deployment.ends == {"a": 1, "b": 1}
    assert len(deployment.starts_s) == len(deployment.ended_s) == 2


def test_a_second_answer_is_seen() -> None:
    deployment = Deployment()
    process = Process(deployment, workers=1)
    for state in ("handed back", "lost", "succeeded", "failed"):
        deployment.note(line("job ended", "a", state), process)
    deployment.note("no JSON", process)
    assert deployment.ends["a"] == 2


class Unreliable:
    """A process whose starts fail twice, and that ends by itself once."""

    def __init__(self) -> None:
        self.is_up = False
        self.starts = 0
        self.end = threading.Event()

    def start(self) -> None:
        self.starts += 1
        if self.starts <= 2:
            raise NotStarted
        self.is_up = True

    def wait(self) -> None:
        self.end.wait(30)
        self.end.clear()
        self.is_up = False

    stop = kill = lambda self: self.end.set()


def test_a_process_is_kept_running(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervisor, "RESTART_PAUSE_S", 0.0)
    process = Unreliable()
    with supervisor.Supervisor([process]) as keeper:  # type: ignore[list-item]
        assert (process.is_up, process.starts, keeper.failed_starts) == (True, 3, 2)
        process.end.set()
        deadline = time.monotonic() + 30
        while process.starts < 4:
            assert time.monotonic() < deadline
            time.sleep(0.001)
        keeper.await_up(process)  # type: ignore[arg-type]
    assert (process.is_up, process.starts) == (False, 4)


def test_the_idle_operation_is_one() -> None:
    assert Operation(IDLE).module == answer.__module__
    assert answer(b"an upload").media_type == "image/png"
