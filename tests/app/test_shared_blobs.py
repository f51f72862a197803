"""Processes that share a database notice that they do not share their blobs."""

import asyncio
import logging
from pathlib import Path

import pytest

from app.jobs.shared_blobs import SharedBlobs
from app.storage.blobs import FOLDER, BlobAccess
from app.storage.layout_store import DATABASE, LayoutStore, ResultLimits
from models.repository import Store
from tests.app.serving import serving
from tests.models.databases import make_file


def test_other_blobs_are_noticed_on_both_sides_and_until_they_are_the_same(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    make_file(tmp_path / DATABASE)
    caplog.set_level(logging.INFO)

    async def check() -> None:
        store = LayoutStore(tmp_path, ResultLimits(60, 10, 10, 60))
        places = [BlobAccess("", tmp_path / name) for name in ("api", "api", "worker")]
        async with store.opened():
            for place in places:
                await place.open()
            api, same, worker = (SharedBlobs(store, place) for place in places)
            for process in (api, same, api):
                await process.look()
                assert process.are_shared
            for process in (worker, api, worker):
                await process.look()
                assert not process.are_shared
            await worker.leave()
            for process in (api, same):
                await process.look()
                assert process.are_shared
            moved = SharedBlobs(store, places[0])  # the worker again, with the setting that it should have
            for process in (moved, api):
                await process.look()
                assert process.are_shared
            for process in (api, same, moved):
                await process.leave()
            for place in places:
                await place.close()

    asyncio.run(check())
    errors = [record for record in caplog.records if record.levelno >= logging.ERROR]
    assert ["BLOB_URL" in record.getMessage() for record in errors] == [True, True]  # once on each side
    assert not list((tmp_path / "api" / FOLDER).rglob("*"))
    with Store.open(tmp_path / DATABASE) as stored:
        assert stored.show_presence("process", "x", 60) == []


def test_a_process_that_was_killed_counts_as_gone_after_a_while(tmp_path: Path) -> None:
    with Store.open(make_file(tmp_path / DATABASE)) as store:
        assert store.show_presence("process", "a", 60) == []
        assert store.show_presence("process", "b", 60) == ["a"]
        assert store.show_presence("process", "b", 0) == []
        assert store.show_presence("process", "c", 60) == ["b"]
        assert store.show_presence("other", "d", 60) == []


def test_readiness_tells_it() -> None:
    with serving() as client:
        assert client.get("/health/ready").json()["blobs"] == "ready"
