"""Keys that would leave the service open stop its start; SIGHUP has the file of keys read again."""

import os
import signal
import time
from pathlib import Path

import httpx
import pytest

from app.roles import digest_of_key
from tests.end_to_end.forked import template
from tests.end_to_end.processes import PRODUCT, SCRIPTED, Service, running

RITA = f"rita reader {digest_of_key(b'key-of-rita')}\n"


@pytest.mark.parametrize(
    ("setting", "content", "sentence"),
    [
        ("API_KEYS", ",", "API_KEYS: it is set and holds no key"),
        ("API_KEYS", "", "API_KEYS: it is set and holds no key"),
        ("API_KEYS", "admin:", "entry 1 of API_KEYS has nothing behind its colon"),
        ("API_KEYS_FILE", "# nobody yet\n", "API_KEYS_FILE holds no key"),
        (
            "API_KEYS_FILE",
            RITA + RITA,
            "line 2 of API_KEYS_FILE: this digest is in the file already, as rita",
        ),
        ("API_KEYS_FILE", "rita\n", "line 1 of API_KEYS_FILE: expected NAME ROLE DIGEST"),
    ],
)
@pytest.mark.parametrize("arguments", [[], ["worker"]])
def test_keys_that_hold_none_are_refused(
    tmp_path: Path, setting: str, content: str, sentence: str, arguments: list[str]
) -> None:
    path = tmp_path / "keys"
    path.write_text(content)
    value = content if setting == "API_KEYS" else str(path)
    environment = {**os.environ, "PORT": "0", "DATA_DIR": str(tmp_path / "data"), setting: value}
    process = template().fork([PRODUCT, *arguments], environment)
    with process.stdout:
        told = process.stdout.read()
    assert process.wait(60) != 0
    assert told.startswith(sentence)
    assert "Traceback" not in told
    assert not (tmp_path / "data").exists()


def until_told(service: Service, message: str, count: int) -> None:
    deadline = time.monotonic() + 20
    while sum(message in line["message"] for line in list(service.lines)) < count:
        assert time.monotonic() < deadline
        assert service.process.poll() is None
        time.sleep(0.01)


@pytest.mark.parametrize("arguments", [[], ["worker"]], ids=["service", "worker"])
def test_sighup_reads_the_keys_again(tmp_path: Path, arguments: list[str]) -> None:
    path = tmp_path / "keys"
    path.write_text(RITA)
    with running(SCRIPTED, *arguments, workers=1, api_keys_file=path) as service:
        service.process.send_signal(signal.SIGHUP)  # nothing has changed
        until_told(service, "the API keys were read again", 1)
        if not arguments:
            anna = {"X-API-Key": "key-of-anna"}
            path.write_text(f"anna admin {digest_of_key(b'key-of-anna')}\n")
            service.process.send_signal(signal.SIGHUP)
            until_told(service, "the API keys were read again", 2)
            assert httpx.get(f"{service.url}/layout/models", headers=anna).status_code == 200
            rita = httpx.get(f"{service.url}/layout/models", headers={"X-API-Key": "key-of-rita"})
            assert rita.status_code == 403
