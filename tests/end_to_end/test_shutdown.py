"""SIGTERM lets what is in flight finish, takes no new work, and leaves nothing behind."""

import signal
import socket
import threading
import time
from pathlib import Path

import httpx
import psutil
import pytest

from tests.app.scripts import upload
from tests.end_to_end.processes import SCRIPTED, Service, running


def wait_for(path: Path) -> None:
    deadline = time.monotonic() + 10
    while not path.exists():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def post_in_background(service: Service, script: str) -> tuple[threading.Thread, list[httpx.Response]]:
    answers: list[httpx.Response] = []

    def post() -> None:
        answers.append(httpx.post(service.url + "/rectify", files={"image": upload(script)}, timeout=20))

    thread = threading.Thread(target=post)
    thread.start()
    return thread, answers


def wait_until_refused(service: Service) -> None:
    """Return when new connections are refused."""
    deadline = time.monotonic() + 10
    while True:
        try:
            socket.create_connection(("127.0.0.1", service.port), timeout=5).close()
        except ConnectionRefusedError:
            return
        except ConnectionResetError:
            pass  # it was waiting at the socket as that was closed: the next one is refused
        assert time.monotonic() < deadline
        time.sleep(0.01)


def assert_nothing_is_left(processes: list[psutil.Process]) -> None:
    _, alive = psutil.wait_procs(processes, timeout=10)
    assert alive == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_what_is_in_flight_finishes_and_new_work_is_refused(number: signal.Signals, tmp_path: Path) -> None:
    fresh = (
        number == signal.SIGTERM
    )  # as an operator's; that the other signal does the same needs no start of Python
    with running(SCRIPTED, fresh=fresh, workers=1, shutdown_grace_s=20, tmpdir=tmp_path) as service:
        thread, answers = post_in_background(service, f"wait {tmp_path}")
        queued, queued_answers = post_in_background(service, "")
        wait_for(tmp_path / "running")
        processes = service.descendants()
        service.process.send_signal(number)
        wait_until_refused(service)
        assert not answers  # it is still at work
        (tmp_path / "go").touch()
        thread.join(20)
        queued.join(20)
        assert [answer.status_code for answer in answers + queued_answers] == [200, 200]
        assert service.process.wait(10) == 0
        assert_nothing_is_left(processes)
        assert not list(tmp_path.glob("pymp-*"))


def test_a_supervisor_that_signals_every_process_does_no_harm(tmp_path: Path) -> None:
    with running(SCRIPTED, workers=1, shutdown_grace_s=20) as service:
        thread, answers = post_in_background(service, f"wait {tmp_path}")
        wait_for(tmp_path / "running")
        for process in service.descendants():
            process.send_signal(signal.SIGTERM)
        service.terminate()
        wait_until_refused(service)
        (tmp_path / "go").touch()
        thread.join(20)
        assert [answer.status_code for answer in answers] == [200]


def test_what_outlives_the_grace_gets_an_answer_and_is_stopped() -> None:
    with running(SCRIPTED, workers=1, shutdown_grace_s=1, job_timeout_s=60) as service:
        thread, answers = post_in_background(service, "hang")
        deadline = time.monotonic() + 10
        while "engine_running 1.0" not in httpx.get(service.url + "/metrics").text:
            assert time.monotonic() < deadline
        processes = service.descendants()
        begin = time.monotonic()
        service.terminate()
        thread.join(20)
        assert service.process.wait(10) == 0
        assert time.monotonic() - begin < 5
        assert [(answer.status_code, answer.json()["code"]) for answer in answers] == [(503, "shutting-down")]
        assert_nothing_is_left(processes)


def test_workers_do_not_outlive_a_server_that_is_killed(tmp_path: Path) -> None:
    with running(SCRIPTED, fresh=True, workers=2, tmpdir=tmp_path) as service:
        processes = service.descendants()
        assert len(processes) >= 3
        service.process.kill()
        service.process.wait(10)
        assert_nothing_is_left(processes)
