"""Probes, metrics and documentation."""

import httpx
import pytest

from app.routes.health import NotReady, ready
from app.state import AppState
from tests.app.scripts import upload
from tests.app.serving import serving


def test_live(client: httpx.Client) -> None:
    response = client.get("/health/live")
    assert (response.status_code, response.json()) == (200, {"status": "alive"})


def test_ready(client: httpx.Client) -> None:
    response = client.get("/health/ready")
    assert response.status_code == 200
    assert response.json()["status"] == "ready"
    assert (response.json()["workers"], response.json()["ocr"]) == (2, "scripted")
    assert response.json()["store"] == "ready"


def test_docs(client: httpx.Client) -> None:
    assert "swagger" in client.get("/docs").text
    assert "/rectify" in client.get("/openapi.json").json()["paths"]


def sample(exposition: str, name: str) -> float:
    lines = [line for line in exposition.splitlines() if line.startswith(name + " ")]
    assert len(lines) == 1, f"{name} is there {len(lines)} times"
    return float(lines[0].rpartition(" ")[2])


def test_metrics_tell_what_happened() -> None:
    with serving(job_timeout_s=0.5, queue_length=3) as client:
        for script in ("", "", "no-text", "kill", "hang"):
            client.post("/rectify", files={"image": upload(script)})
        client.get("/nowhere/1")
        client.get("/nowhere/2")
        response = client.get("/metrics")
    assert response.headers["content-type"].startswith("text/plain; version=0.0.4")
    text = response.text
    requests = 'http_requests_total{method="%s",path="%s",status="%d"}'
    assert sample(text, requests % ("POST", "/rectify", 200)) == 2
    assert sample(text, requests % ("POST", "/rectify", 422)) == 1
    assert sample(text, requests % ("POST", "/rectify", 500)) == 1
    assert sample(text, requests % ("POST", "/rectify", 504)) == 1
    assert sample(text, requests % ("GET", "other", 404)) == 2
    for outcome, count in (("done", 2), ("no-text", 1), ("worker-died", 1), ("timed-out", 1)):
        assert sample(text, f'jobs_total{{outcome="{outcome}"}}') == count
    assert sample(text, 'http_request_duration_seconds_count{method="POST",path="/rectify"}') == 5
    assert sample(text, "job_work_seconds_count") == 5
    assert sample(text, "engine_worker_deaths_total") == 1
    assert sample(text, "engine_capacity") == 4
    assert sample(text, "engine_admitted") == 0
    assert sample(text, "engine_queue_depth") == 0


def test_not_ready_before_workers_are_up() -> None:
    import asyncio

    from app.main import create_app
    from app.settings import Settings
    from tests.app.scripted import OPERATIONS

    state = create_app(Settings(workers=1), OPERATIONS).state.document_rectification
    assert isinstance(state, AppState)
    with pytest.raises(NotReady):
        asyncio.run(ready(state))
