"""The store behind the routes: what is read anew, what is purged, and what happens when it fails."""

import asyncio
import json
import threading
from operator import methodcaller
from pathlib import Path
from typing import Any

import pytest

from app.storage import layout_store
from app.storage.backup_note import NAME
from app.storage.layout_store import MOST_THREADS, LayoutStore, ResultLimits
from models.errors import ModelNotFound, ResultNotFound, StoreUnavailable
from models.repository import Store
from services.errors import InvalidOption
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

LIMITS = ResultLimits(ttl_s=1000, max_results=10, max_unknown_pages=2, unknown_ttl_s=1000)


def with_store(folder: Path, work: Any, limits: ResultLimits = LIMITS) -> Any:
    """Answer of the coroutine function `work`, given an open store."""

    async def run() -> Any:
        store = LayoutStore(folder / "data", limits)
        async with store.opened():
            return await work(store)

    return asyncio.run(run())


def add(store: LayoutStore, name: str) -> Any:
    return store.call(lambda inner: inner.add_version(name, model_document(name, "sender"), "import"))


def recognized(class_name: str | None, competed: int = 1, zones: int = 2) -> dict[str, Any]:
    """What is kept of a recognition."""
    page = {**PAGE, "zones": [{"id": str(index), "box": [0, 0, 1, 1]} for index in range(zones)]}
    chosen = None if class_name is None else {"name": class_name}
    return {"result": {"class": chosen, "classes": [{"name": "a"}] * competed}, "page": page}


def test_pages_of_no_class_are_kept_among_the_unknown_ones(tmp_path: Path) -> None:
    async def work(store: LayoutStore) -> None:
        for document in (recognized("a"), recognized(None, competed=0), recognized(None, zones=0)):
            await store.keep_result(document)
        assert await store.call(lambda inner: list(inner.each_unknown_page())) == []
        kept = [await store.keep_result(recognized(None)) for _ in range(3)]
        pages = await store.call(lambda inner: list(inner.each_unknown_page()))
        assert [page.result_id for page in pages] == kept[1:]
        assert all(page.page == recognized(None)["page"] for page in pages)

    with_store(tmp_path, work)


def test_the_folder_is_made(tmp_path: Path) -> None:
    async def work(store: LayoutStore) -> bool:
        return await store.is_available()

    assert with_store(tmp_path, work)
    assert {path.name for path in (tmp_path / "data").iterdir()} == {"layout.sqlite3", NAME}


def test_a_url_takes_the_place_of_the_folder(tmp_path: Path) -> None:
    async def run() -> bool:
        store = LayoutStore(tmp_path / "data", LIMITS, f"sqlite:///{tmp_path / 'elsewhere.sqlite3'}")
        async with store.opened():
            return await store.is_available()

    assert asyncio.run(run())
    assert [path.name for path in tmp_path.iterdir()] == ["elsewhere.sqlite3"]


def test_models_that_are_too_large_together_do_not_compete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work(store: LayoutStore) -> None:
        await add(store, "a")
        await add(store, "b")
        both = await store.ready_models(None)
        monkeypatch.setattr(layout_store, "MOST_MODEL_BYTES", sum(len(model.document) for model in both) - 1)
        with pytest.raises(InvalidOption, match="Name fewer") as caught:
            await store.ready_models(None)
        assert caught.value.field == "models"
        assert len(await store.ready_models(["b"])) == 1

    with_store(tmp_path, work)


def test_models_are_read_again_only_when_one_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []
    model = Store.model

    def noting(self: Store, name: str, version: int | None = None) -> Any:
        read.append(name)
        return model(self, name, version)

    monkeypatch.setattr(Store, "model", noting)

    async def work(store: LayoutStore) -> None:
        await add(store, "b")
        await add(store, "a")
        for _ in range(3):
            assert [model.name for model in await store.ready_models(None)] == ["a", "b"]
        await store.call(lambda inner: inner.add_sample("a", PAGE))
        await store.keep_result({})
        await asyncio.gather(*(store.ready_models(None) for _ in range(5)))
        assert read == ["a", "b"]
        await add(store, "a")
        assert [model.version for model in await store.ready_models(["b", "a"])] == [1, 2]
        assert read == ["a", "b", "a"]
        await store.call(lambda inner: inner.delete_model("a"))
        assert [model.name for model in await store.ready_models(None)] == ["b"]
        await add(store, "a")
        assert [model.version for model in await store.ready_models(None)] == [3, 1]
        assert read == ["a", "b", "a", "a"]

    with_store(tmp_path, work)


def test_a_genre_is_known_although_no_version_has_changed(tmp_path: Path) -> None:
    async def work(store: LayoutStore) -> None:
        await add(store, "a")
        assert [model.genre for model in await store.ready_models(None)] == [None]
        await store.call(lambda inner: inner.change_settings("a", genre="letters"))
        assert [model.genre for model in await store.ready_models(None)] == ["letters"]

    with_store(tmp_path, work)


def test_models_that_are_not_there(tmp_path: Path) -> None:
    async def work(store: LayoutStore) -> None:
        await store.call(lambda inner: inner.add_sample("fax", PAGE))
        with pytest.raises(ModelNotFound):
            await store.ready_models(["letter"])
        with pytest.raises(InvalidOption, match=r"no version yet, only samples \(1\)"):
            await store.ready_models(["fax"])
        assert await store.ready_models(None) == []

    with_store(tmp_path, work)


def test_more_results_than_are_kept(tmp_path: Path) -> None:
    async def work(store: LayoutStore) -> None:
        ids = [await store.keep_result({"number": number}) for number in range(103)]
        # The first was followed by a purge, and so was the 102nd: ten were left of 102, and one came after.
        for number, result_id in enumerate(ids):
            if number < 92:
                with pytest.raises(ResultNotFound):
                    await store.call(methodcaller("result", result_id))
            else:
                assert (await store.call(methodcaller("result", result_id))).document == {"number": number}

    with_store(tmp_path, work)


def test_what_cannot_be_purged_stops_no_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> int:
        raise StoreUnavailable("the database is locked")

    async def work(store: LayoutStore) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(Store, "purge_results", fail)
            result_id = await store.keep_result({"number": 1})  # the first one is followed by a purge
        assert (await store.call(lambda inner: inner.result(result_id))).document == {"number": 1}

    with_store(tmp_path, work)


def test_few_threads_wait_for_the_database(tmp_path: Path) -> None:
    running, most, lock = 0, 0, threading.Lock()
    full = threading.Event()

    def work_of_one(_: Store) -> None:
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
            if running == MOST_THREADS:
                full.set()
        assert full.wait(10)  # until as many as may run do
        with lock:
            running -= 1

    async def work(store: LayoutStore) -> None:
        await asyncio.gather(*(store.call(work_of_one) for _ in range(3 * MOST_THREADS)))

    with_store(tmp_path, work)
    assert most == MOST_THREADS


def test_cancelled_calls_hold_their_threads_until_they_end(tmp_path: Path) -> None:
    started, end = threading.Semaphore(0), threading.Event()
    ended: list[int] = []

    def slow(_: Store) -> None:
        started.release()
        assert end.wait(10)
        ended.append(1)

    async def work(store: LayoutStore) -> asyncio.Task[int]:
        calls = [asyncio.create_task(store.call(slow)) for _ in range(MOST_THREADS)]
        for _ in calls:
            await asyncio.to_thread(started.acquire)
        for call in calls:
            call.cancel()
        await asyncio.wait(calls)
        assert all(call.cancelled() for call in calls)
        waiting = asyncio.create_task(store.call(Store.revision))
        await asyncio.wait([waiting], timeout=0.3)
        assert not waiting.done()  # all threads are taken, although nobody waits for what they do
        end.set()
        assert await waiting == 0
        return waiting

    with_store(tmp_path, work)
    assert len(ended) == MOST_THREADS


def test_the_store_is_closed_when_its_last_call_has_ended(tmp_path: Path) -> None:
    started, end = threading.Event(), threading.Event()
    answers: list[object] = []

    def slow(store: Store) -> None:
        started.set()
        assert end.wait(10)
        answers.append(store.revision())

    async def work(store: LayoutStore) -> None:
        call = asyncio.create_task(store.call(slow))
        await asyncio.to_thread(started.wait)
        call.cancel()
        asyncio.get_running_loop().call_later(0.1, end.set)

    with_store(tmp_path, work)
    assert answers == [0]


def test_a_store_that_is_closed(tmp_path: Path) -> None:
    async def work(store: LayoutStore) -> LayoutStore:
        return store

    store: LayoutStore = with_store(tmp_path, work)
    with pytest.raises(StoreUnavailable):
        asyncio.run(store.call(Store.revision))
    assert not asyncio.run(store.is_available())


async def unavailable(*_: object) -> Any:
    raise StoreUnavailable("the database is locked")


def test_a_result_that_cannot_be_kept_is_not_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    with serving() as client:
        with monkeypatch.context() as patch:
            patch.setattr(LayoutStore, "keep_result", unavailable)
            response = client.post("/layout", data={"zones": json.dumps(PAGE)})
            problem = assert_problem(response, 503, "store-unavailable")
            assert problem["detail"] == "The database is locked."
        assert client.post("/layout", data={"zones": json.dumps(PAGE)}).status_code == 200


def unreadable(store: Store) -> int:
    raise StoreUnavailable("the database is locked")


def test_without_the_store_the_rest_of_the_service_works(monkeypatch: pytest.MonkeyPatch) -> None:
    with serving() as client:
        monkeypatch.setattr(LayoutStore, "call", unavailable)
        monkeypatch.setattr(Store, "revision", unreadable)
        assert client.get("/health/ready").json()["store"] == "unavailable"
        assert client.post("/rectify", files={"image": b"photo"}).status_code == 200
        for response in (
            client.post("/layout", data={"zones": json.dumps(PAGE)}),
            client.get("/layout/models"),
            client.get("/layout/models/letter"),
            client.put("/layout/models/letter", json=model_document("letter")),
            client.delete("/layout/models/letter"),
            client.get("/layout/models/letter/versions"),
            client.post("/layout/models/letter/initialize"),
            client.post("/layout/models/letter/samples", json=PAGE),
            client.get("/layout/models/letter/samples"),
            client.get("/layout/models/letter/samples/1"),
            client.delete("/layout/models/letter/samples/1"),
            client.get("/layout/results/1"),
        ):
            assert_problem(response, 503, "store-unavailable")


def test_what_a_model_continues_reaches_recognition(tmp_path: Path) -> None:
    async def work(store: LayoutStore) -> list[tuple[str, str | None]]:
        for name in ("letter", "letter-2"):
            await add(store, name)
        await store.ready_models(None)
        await store.call(lambda inner: inner.change_settings("letter-2", continues="letter"))
        return [(model.name, model.continues) for model in await store.ready_models(None)]

    assert with_store(tmp_path, work) == [("letter", None), ("letter-2", "letter")]
