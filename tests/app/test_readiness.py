"""What `/health/ready` says of a store that hangs, a disk that is full, and a file that is gone; it always answers."""

import asyncio
import errno
import json
import threading
import time
from pathlib import Path

import httpx
import pytest
from starlette.exceptions import HTTPException

from app.http.problems import refusal_of
from app.storage.layout_store import DATABASE, LayoutStore, ResultLimits
from app.storage.probe import Probe
from models.errors import StoreUnavailable
from tests.app.scripted_layout import PAGE
from tests.app.serving import serving

LIMITS = ResultLimits(60.0, 10, 10, 60.0)


def test_a_full_disk_is_told() -> None:
    with serving(min_free_disk_bytes=1 << 60) as client:
        assert client.get("/health/ready").json()["disk"] == "full"


def test_there_is_space(client: httpx.Client) -> None:
    assert client.get("/health/ready").json()["disk"] == "ready"


def test_a_database_file_that_is_gone_is_told(tmp_path: Path) -> None:
    with serving(data_dir=tmp_path) as client:
        assert client.get("/health/ready").json()["store"] == "ready"
        (tmp_path / DATABASE).unlink()
        assert client.get("/health/ready").json()["store"] == "unavailable"
        answer = client.post("/layout", data={"zones": json.dumps(PAGE)})
        assert (answer.status_code, answer.json()["code"]) == (503, "store-unavailable")


def test_a_store_that_hangs_is_unavailable_and_each_call_ends(tmp_path: Path) -> None:
    go = threading.Event()

    async def ask() -> list[float]:
        times = []
        async with store.opened():
            for _ in range(2):
                begin = time.monotonic()
                with pytest.raises(StoreUnavailable, match="STORE_TIMEOUT_S"):
                    await store.call(lambda opened: go.wait(20))
                times.append(time.monotonic() - begin)
            go.set()
            assert await store.is_available()
        return times

    store = LayoutStore(tmp_path, LIMITS, timeout_s=0.2)
    assert max(asyncio.run(ask())) < 5


def test_a_probe_asks_once_at_a_time() -> None:
    go, asked = threading.Event(), []

    def check() -> bool:
        asked.append(None)
        return go.wait(20)

    async def ask() -> None:
        probe = Probe(check, "test")
        assert await asyncio.gather(*(probe.result(0.05) for _ in range(5))) == [None] * 5
        assert await probe.result(0.05) is None
        assert len(asked) == 1
        go.set()
        assert await probe.result(5)
        probe.close()

    asyncio.run(ask())


def test_no_space_for_an_upload_is_told() -> None:
    error = HTTPException(400, "There was an error parsing the body")
    error.__cause__ = OSError(errno.ENOSPC, "No space left on device")
    refusal = refusal_of(error)
    assert (refusal.code, refusal.status) == ("store-unavailable", 503)
    assert "disk space" in refusal.detail
