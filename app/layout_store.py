"""The store, as routes reach it: away from the event loop, by a bounded number of threads."""

import asyncio
import json
import logging
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from models.errors import ModelNotFound, StoreError, StoreUnavailable
from models.records import ResultDraft, StoredModel, UnknownPageDraft
from models.repository import Store
from services.contract.layout import ModelDocument
from services.errors import InvalidOption

T = TypeVar("T")
log = logging.getLogger(__name__)

DATABASE = "layout.sqlite3"
MOST_THREADS = 4
"""Readers of SQLite run side by side, writers take turns: more threads would only wait for each other."""
MOST_COMPETING_BYTES = 80 * 2**20
"""Of the documents of models in one recognition: they are sent to a worker, which reads them (8 s) and keeps them. 200
models of 15 labels have 40 MB, one of 60 labels has 2.5 MB."""
PURGE_EVERY_S = 60.0
PURGE_EVERY_RESULTS = 100
"""Results that are no longer kept are deleted whenever so much time or so many new ones have gone by."""


@dataclass(frozen=True, slots=True)
class ReadyModel:
    """The newest version of a model, as workers take it, and its labels."""

    document: ModelDocument
    labels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ResultLimits:
    """For how long results and unknown pages are kept, and how many; `app.settings` documents each."""

    ttl_s: float
    max_results: int
    max_unknown_pages: int
    unknown_ttl_s: float


class LayoutStore:
    """Layout models, samples, feedback and results, in one folder or in the database of a URL.

    What it answers is only there inside of `opened`.
    """

    def __init__(self, data_dir: Path, results: ResultLimits, database_url: str = "") -> None:
        self._folder = data_dir
        self._database_url = database_url
        self._results = results
        self._store: Store | None = None
        self._threads: ThreadPoolExecutor | None = None
        self._loading = asyncio.Lock()
        self._revision: int | None = None
        self._ready: Mapping[str, ReadyModel] = {}
        self._last_purge_s = 0.0
        self._results_since_purge = 0

    @asynccontextmanager
    async def opened(self) -> AsyncIterator[None]:
        """Open the database, which is made if it is not there; it is closed with the block.

        Raises
        ------
        StoreError
            When it cannot be opened or written; a service that cannot remember shall not start.
        """
        if self._database_url:  # which is not told: it may hold a password
            where, place = "the database of DATABASE_URL", {"database": "DATABASE_URL"}
        else:
            folder = self._folder.resolve()
            where, place = f"{folder} (DATA_DIR)", {"data_dir": str(folder)}
        try:
            self._store = await asyncio.to_thread(self._open)
        except StoreError as error:
            log.error(
                "the store in %s could not be opened: %s",
                where,
                error.detail,
                extra={**place, "code": error.code},
            )
            raise error.with_traceback(None) from None  # the server writes the rest down, and it is long
        log.info("the store is open", extra=place)
        self._threads = ThreadPoolExecutor(MOST_THREADS, "store")
        try:
            yield
        finally:
            store, self._store = self._store, None
            await asyncio.to_thread(self._threads.shutdown)  # also what nobody waits for any more ends first
            await asyncio.to_thread(store.close)

    def _open(self) -> Store:
        if self._database_url:
            store, cannot = Store.open(self._database_url), "the database must be writable"
        else:
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise StoreUnavailable(f"the folder cannot be made: {error.strerror or error}") from error
            store, cannot = Store.open(self._folder / DATABASE), "the folder must be writable"
        try:
            store.purge_results(keep_newest=self._results.max_results)
        except StoreError as error:
            store.close()
            raise type(error)(f"{cannot}: {error.detail}") from error
        return store

    async def call(self, work: Callable[[Store], T]) -> T:
        """Answer of `work`, one short transaction.

        When the caller is cancelled, work that has begun goes on to its end, and holds its thread so long.

        Raises
        ------
        StoreError
            What the work raised, and StoreUnavailable when the store is not open.
        """
        store = self._store
        if store is None:
            raise StoreUnavailable("the store is closed")
        return await asyncio.get_running_loop().run_in_executor(self._threads, work, store)

    async def is_available(self) -> bool:
        """Whether the store can be read now."""
        try:
            await self.call(Store.revision)
        except StoreError:
            return False
        return True

    async def ready(self) -> Mapping[str, ReadyModel]:
        """Newest versions of all models that have one, by name; only those that have changed are read anew."""
        async with self._loading:
            revision = await self.call(Store.revision)
            if revision != self._revision:
                # Should a model change in between, the revision is the older one and they are read once more.
                known = self._ready
                self._ready = await self.call(lambda store: _read_ready(store, known))
                self._revision = revision
            return self._ready

    async def ready_models(self, names: Sequence[str] | None) -> list[ModelDocument]:
        """Newest versions of these models (None: of all), in the order of the names.

        Raises
        ------
        ModelNotFound
            When one of them does not exist.
        InvalidOption
            When one of them has no version yet, or they are too large to compete all at once.
        """
        ready = await self.ready()
        for name in names or ():
            if name not in ready:
                samples = await self.call(lambda store, name=name: store.sample_count(name))  # type: ignore[misc]
                raise InvalidOption(
                    f"models: {name} has {samples} samples and no version yet; "
                    f"POST /layout/models/{name}/initialize makes one.",
                    "models",
                )
        documents = [ready[name].document for name in (sorted(ready) if names is None else names)]
        size = sum(len(model.document) for model in documents)
        if size > MOST_COMPETING_BYTES:
            raise InvalidOption(
                f"models: the {len(documents)} models that compete have {size / 2**20:.0f} MiB together and may have "
                f"{MOST_COMPETING_BYTES / 2**20:.0f}; name fewer of them.",
                "models",
            )
        return documents

    async def keep_result(self, document: dict[str, Any]) -> str:
        """Keep what a recognition found, and its page also among the unknown ones if it fits no class; its id."""
        draft, ttl_s = self._draft(document), self._results.ttl_s
        result_id = await self.call(lambda store: store.add_result(draft.document, ttl_s, draft.unknown))
        await self._purge_when_due(1)
        return result_id

    async def keep_document(
        self, document: dict[str, Any], pages: Sequence[dict[str, Any]]
    ) -> tuple[str, list[str]]:
        """Keep what was found of a document and of each of its pages, all or nothing; its id, and theirs."""
        drafts = [self._draft(page) for page in pages]
        ids = await self.call(lambda store: store.add_document(document, drafts, self._results.ttl_s))
        await self._purge_when_due(1 + len(pages))
        return ids

    def _draft(self, document: dict[str, Any]) -> ResultDraft:
        return ResultDraft(document, self.unknown_page(document["page"]) if _is_unknown(document) else None)

    async def _purge_when_due(self, new: int) -> None:
        """Delete what is no longer kept, from time to time. When that fails, what was kept is there all the same."""
        now = time.monotonic()
        self._results_since_purge += new
        if now - self._last_purge_s <= PURGE_EVERY_S and self._results_since_purge <= PURGE_EVERY_RESULTS:
            return
        self._last_purge_s, self._results_since_purge = now, 0
        try:
            await self.call(lambda store: store.purge_results(keep_newest=self._results.max_results))
        except StoreError as error:
            log.error("results that are no longer kept could not be deleted: %s", error.detail)

    def unknown_page(self, page: dict[str, Any]) -> UnknownPageDraft:
        """A page that fits no class, as the store keeps it within the limits."""
        return UnknownPageDraft(page, self._results.max_unknown_pages, self._results.unknown_ttl_s)


def _is_unknown(document: Mapping[str, Any]) -> bool:
    """Whether models competed for this page, and none was likely enough."""
    result, page = document.get("result", {}), document.get("page", {})
    return bool(result.get("classes")) and result.get("class") is None and bool(page.get("zones"))


def _read_ready(store: Store, known: Mapping[str, ReadyModel]) -> dict[str, ReadyModel]:
    """Newest versions of all models; what is `known` is not read again, for no version ever changes."""
    ready = {}
    for summary in store.models():
        if summary.version is None:
            continue
        newest = known.get(summary.name)
        if newest is None or newest.document.version != summary.version:
            try:
                model = store.model(summary.name, summary.version)
            except ModelNotFound:  # deleted just now
                continue
            assert model.document is not None
            # What it has seen is for learning alone, and half of it.
            recognizing = replace(model, document=model.document | {"memory": None})
            newest = ReadyModel(document_of(recognizing), labels_of(model.document))
        # Settings are not the version's: they change under it.
        settings = summary.settings
        document = replace(newest.document, genre=settings.genre, continues=settings.continues)
        ready[summary.name] = replace(newest, document=document)
    return ready


def document_of(model: StoredModel) -> ModelDocument:
    """A version of a model, as workers take it."""
    assert model.version is not None
    assert model.document is not None
    document = json.dumps(model.document, ensure_ascii=False, separators=(",", ":")).encode()
    settings = model.settings
    return ModelDocument(
        model.name,
        model.version,
        document,
        genre=settings.genre,
        continues=settings.continues,
        learner=settings.learner,
    )


def labels_of(document: Mapping[str, Any]) -> tuple[str, ...]:
    """The labels of a layout model, in its own order; its node null has none."""
    return tuple(str(node["label"]) for node in document["nodes"] if node["label"] is not None)
