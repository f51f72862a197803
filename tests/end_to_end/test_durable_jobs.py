"""Accepted jobs outlive the service: killed or stopped, they are done by the next one."""

import os
import signal
import time
from pathlib import Path
from typing import Any

import httpx

from tests.app.scripts import upload
from tests.end_to_end.processes import Service, running

LEASE_S = 4


def accept(service: Service, script: str, key: str = "") -> str:
    headers = {"Prefer": "respond-async", **({"Idempotency-Key": key} if key else {})}
    answer = httpx.post(f"{service.url}/rectify", files={"image": upload(script)}, headers=headers)
    assert answer.status_code == 202, answer.text
    return answer.headers["location"]


def until(service: Service, path: str, *states: str, seconds: float = 60) -> dict[str, Any]:
    deadline = time.monotonic() + seconds
    while True:
        job: dict[str, Any] = httpx.get(service.url + path).json()
        if job["state"] in (states or {"succeeded", "failed", "cancelled"}):
            return job
        assert time.monotonic() < deadline, job
        time.sleep(0.05)


def settings(folder: Path) -> dict[str, object]:
    return {"data_dir": folder, "workers": 1, "job_lease_s": LEASE_S, "shutdown_grace_s": 1}


def inputs(folder: Path) -> list[Path]:
    return [path for path in (folder / "blobs").rglob("input") if path.is_file()]


def until_inputs_are_gone(folder: Path, seconds: float = 60) -> None:
    """A job shows its end before its input is deleted."""
    deadline = time.monotonic() + seconds
    while inputs(folder):
        assert time.monotonic() < deadline, inputs(folder)
        time.sleep(0.05)


def test_jobs_outlive_a_killed_service(tmp_path: Path) -> None:
    """The running one is tried again, the queued one goes on; a repeated request still finds its job."""
    gate, data = tmp_path / "gate", tmp_path / "data"
    gate.mkdir()
    with running(**settings(data)) as service:
        first, second = accept(service, f"wait {gate}", "one"), accept(service, "")
        until(service, first, "running")
        assert len(inputs(data)) == 2
        for process in service.descendants():
            process.kill()
        os.kill(service.process.pid, signal.SIGKILL)
        service.process.wait(10)
    (gate / "go").touch()
    with running(**settings(data)) as service:
        assert accept(service, f"wait {gate}", "one") == first
        jobs = [until(service, path) for path in (first, second)]
        assert [(job["state"], job["attempts"]) for job in jobs] == [("succeeded", 2), ("succeeded", 1)]
        for path in (first, second):
            assert httpx.get(f"{service.url}{path}/result").content == b"flat as jpeg"
        until_inputs_are_gone(data)


def test_jobs_wait_for_a_store_of_blobs_that_is_away(tmp_path: Path) -> None:
    gate, data = tmp_path / "gate", tmp_path / "data"
    gate.mkdir()
    with running(**settings(data)) as service:
        first, second = accept(service, f"wait {gate}"), accept(service, "")
        until(service, first, "running")
        (data / "blobs").rename(tmp_path / "away")
        refused = httpx.post(
            f"{service.url}/rectify", files={"image": upload("")}, headers={"Prefer": "respond-async"}
        )
        assert (refused.status_code, refused.json()["code"]) == (503, "store-unavailable")
        assert httpx.get(f"{service.url}/health/ready").json()["blobs"] == "unavailable"
        (gate / "go").touch()  # the first job has an answer that cannot be written
        time.sleep(1.5)
        assert httpx.get(service.url + first).json()["state"] == "running"
        (tmp_path / "away").rename(data / "blobs")
        jobs = [until(service, path) for path in (first, second)]
        assert [(job["state"], job["attempts"]) for job in jobs] == [("succeeded", 1)] * 2
        assert httpx.get(f"{service.url}{first}/result").content == b"flat as jpeg"


def test_a_stopped_service_hands_its_job_to_the_next_one(tmp_path: Path) -> None:
    gate, data = tmp_path / "gate", tmp_path / "data"
    gate.mkdir()
    with running(**settings(data)) as service:
        path = accept(service, f"wait {gate}")
        until(service, path, "running")
        service.terminate()
        service.process.wait(20)
    (gate / "go").touch()
    with running(**settings(data)) as service:
        job = until(service, path)
        assert (job["state"], job["attempts"]) == ("succeeded", 1)


def test_an_upload_that_kills_its_worker_ends_after_two_attempts(tmp_path: Path) -> None:
    with running(**settings(tmp_path)) as service:
        poison, other = accept(service, "kill"), accept(service, "")
        job = until(service, poison)
        assert (job["state"], job["attempts"], job["problem"]["code"]) == ("failed", 2, "worker-died")
        assert until(service, other)["state"] == "succeeded"
        refused = accept(service, "no-text")
        assert until(service, refused)["attempts"] == 1
        until_inputs_are_gone(tmp_path)


def test_log_lines_of_a_job_name_the_trace_of_its_request(tmp_path: Path) -> None:
    trace = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"
    with running(**settings(tmp_path)) as service:
        headers = {"Prefer": "respond-async", "traceparent": trace, "X-Request-ID": "mine"}
        answer = httpx.post(f"{service.url}/rectify", files={"image": upload("")}, headers=headers)
        until(service, answer.headers["location"])
        job = answer.headers["location"].rpartition("/")[2]
    lines = [line for line in service.lines if line.get("job") == job or line.get("path") == "/rectify"]
    assert {"request", "job started", "job ended"} <= {line["message"] for line in lines}
    assert {(line["traceparent"], line["request_id"]) for line in lines} == {(trace, "mine")}
