"""A worker of the running service that is killed costs one request."""

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx

from tests.app.scripts import upload
from tests.end_to_end.processes import Service, running


def post(service: Service, script: str) -> httpx.Response:
    return httpx.post(service.url + "/rectify", files={"image": upload(script)}, timeout=20)


def test_kill_9_costs_one_request(tmp_path: Path) -> None:
    with running(workers=2) as service, ThreadPoolExecutor(8) as clients:
        victim = clients.submit(post, service, f"wait {tmp_path}")
        deadline = time.monotonic() + 10
        while not (tmp_path / "running").exists():
            assert time.monotonic() < deadline
            time.sleep(0.01)
        others = [clients.submit(post, service, "sleep 0.05") for _ in range(6)]
        os.kill(int((tmp_path / "running").read_text(encoding="ascii")), signal.SIGKILL)
        answer = victim.result()
        assert (answer.status_code, answer.json()["code"]) == (500, "worker-died")
        assert answer.json()["request_id"] == answer.headers["x-request-id"]
        assert [other.result().status_code for other in others] == [200] * 6
        ready = httpx.get(service.url + "/health/ready")
        assert ready.status_code == 200


def test_the_killer_of_every_process_but_the_server() -> None:
    with running(fresh=True, workers=2) as service:
        for process in service.descendants():
            process.kill()
        deadline = time.monotonic() + 20
        while (answer := post(service, "")).status_code != 200:
            assert answer.json()["code"] == "worker-died"
            assert time.monotonic() < deadline
        assert httpx.get(service.url + "/health/live").status_code == 200
