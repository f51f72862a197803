"""Request ids, and the line that each request leaves."""

import json
import logging
import subprocess
import sys

import httpx
import pytest

from app.logs import JsonFormatter
from tests.app.scripts import upload


@pytest.mark.parametrize("request_id", ["a", "01J-abc_DEF.~+/=:@9", "x" * 128])
def test_a_good_request_id_is_echoed(client: httpx.Client, request_id: str) -> None:
    response = client.get("/health/live", headers={"X-Request-ID": request_id})
    assert response.headers["x-request-id"] == request_id
    problem = client.get("/nowhere", headers={"X-Request-ID": request_id}).json()
    assert problem["request_id"] == request_id


@pytest.mark.parametrize("request_id", ["", "x" * 129, "a b", '"}{"', "ä".encode()])
def test_any_other_is_replaced(client: httpx.Client, request_id: str | bytes) -> None:
    given = client.get("/health/live", headers={"X-Request-ID": request_id}).headers["x-request-id"]  # type: ignore[dict-item]
    assert len(given) == 32
    assert given.isalnum()


def test_one_line_a_request(client: httpx.Client, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "app.requests"):
        client.post("/rectify", files={"image": upload("no-text")}, headers={"X-Request-ID": "mine"})
        client.get("/health/live", headers={"X-Request-ID": "next"})  # the line above is written by now
    lines = [
        json.loads(JsonFormatter().format(r)) for r in caplog.records if vars(r).get("request_id") == "mine"
    ]
    assert len(lines) == 1
    line = lines[0]
    assert (line["method"], line["path"], line["status"], line["code"]) == (
        "POST",
        "/rectify",
        422,
        "no-text",
    )
    assert line["level"] == "info"
    assert line["duration_ms"] > 0
    assert line["sent_bytes"] > 100
    assert line["client"] == "127.0.0.1"


def test_a_defect_goes_to_the_log_with_its_cause(
    client: httpx.Client, caplog: pytest.LogCaptureFixture
) -> None:
    response = client.post("/rectify", files={"image": upload("fail")}, headers={"X-Request-ID": "broken"})
    assert response.status_code == 500
    lines = [json.loads(JsonFormatter().format(r)) for r in caplog.records if r.levelno == logging.ERROR]
    assert len(lines) == 1
    assert lines[0]["request_id"] == "broken"
    assert "ZeroDivisionError: secret of the house" in lines[0]["traceback"]


def test_a_record_with_an_exception_is_one_line() -> None:
    try:
        raise ValueError("line one\nline two")
    except ValueError as error:
        record = logging.LogRecord(
            "x", logging.ERROR, __file__, 1, "%s", ("fehlt ä",), (ValueError, error, None)
        )
    line = JsonFormatter().format(record)
    assert "\n" not in line
    assert json.loads(line)["message"] == "fehlt ä"
    assert "ValueError: line one" in json.loads(line)["traceback"]


def test_the_log_is_standard_output() -> None:
    """In a locale that is not UTF-8 and with a half of a surrogate pair, which no encoding can write."""
    code = "import logging; from app.logs import configure_logs; configure_logs('INFO'); logging.info('ä \\udc80')"
    ended = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONIOENCODING": "ascii", "PYTHONPATH": ":".join(sys.path)},
        capture_output=True,
        check=True,
    )
    assert json.loads(ended.stdout)["message"] == "ä \udc80"
    assert ended.stderr == b""
