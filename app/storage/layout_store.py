"""Access of the routes to the store: in a limited number of threads, never in the event loop."""

import asyncio
import json
import logging
import stat
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from contextvars import copy_context
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from app.review.decisions import EVIDENCE, decide, place_of_stored
from app.storage.backup_note import write_note
from app.storage.probe import PROBE_TIMEOUT_S, Probe
from models.errors import ModelNotFound, StoreError, StoreUnavailable
from models.records import ResultDraft, StoredModel, UnknownPageDraft
from models.repository import Store
from services.contract.answers.layout import Decision, LayoutResult
from services.contract.kept_pages import KeptPageJson
from services.contract.layout import MOST_MODEL_BYTES, ModelDocument
from services.contract.model_json import ModelJson
from services.contract.page_json import PageJson
from services.contract.result_json import StoredResultJson
from services.errors import InvalidOption
from services.heap import release_freed_memory

T = TypeVar("T")
log = logging.getLogger(__name__)

DATABASE = "layout.sqlite3"
MOST_THREADS = 4
"""SQLite allows parallel reads and one write at a time. More threads would only wait for each other."""
MOST_LISTS = 2
"""Lists of documents that are made at a time, so that they take neither all threads nor much memory."""
PURGE_EVERY_S = 60.0
"""Results live for hours, so a minute more is little."""
PURGE_EVERY_RESULTS = 100
"""Expired results are deleted after so many new ones, too."""


@dataclass(frozen=True, slots=True)
class ReadyModel:
    """The newest version of a model, as sent to workers, and its labels."""

    document: ModelDocument
    labels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ResultLimits:
    """How long, and how many, results and unknown pages are kept; `app.settings` documents each limit."""

    ttl_s: float
    max_results: int
    max_unknown_pages: int
    unknown_ttl_s: float


class LayoutStore:
    """Layout models, samples, feedback and results, in a folder or in the database of a URL.

    Its methods work only inside the `opened` block.
    """

    def __init__(
        self, data_dir: Path, results: ResultLimits, database_url: str = "", timeout_s: float = 20.0
    ) -> None:
        self._folder = data_dir
        self._database_url = database_url
        self._results = results
        self._store: Store | None = None
        self._threads: ThreadPoolExecutor | None = None
        self._timeout_s = timeout_s
        self._probe = Probe(self._is_readable, "store-probe")
        self._loading = asyncio.Lock()
        self._lists = asyncio.Semaphore(MOST_LISTS)
        self._revision: int | None = None
        self._ready: Mapping[str, ReadyModel] = {}
        self._last_purge_s = 0.0
        self._results_since_purge = 0

    @asynccontextmanager
    async def opened(self) -> AsyncIterator[None]:
        """Open the database, and create it if it does not exist. It is closed at the end of the block.

        Raises
        ------
        StoreError
            When it cannot be opened or written: a service that cannot store anything must not start.
        """
        if self._database_url:  # the URL is not logged: it may contain a password
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
            raise error.with_traceback(None) from None  # the server logs the error; omit its traceback
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
                self._folder.mkdir(mode=stat.S_IRWXU, parents=True, exist_ok=True)  # for its owner only
            except OSError as error:
                raise StoreUnavailable(f"the folder cannot be made: {error.strerror or error}") from error
            store, cannot = Store.open(self._folder / DATABASE), "the folder must be writable"
            write_note(self._folder)
        try:
            self._purge(store)
            _catch_up(store)
        except StoreError as error:
            store.close()
            raise type(error)(f"{cannot}: {error.detail}") from error
        return store

    async def call(self, work: Callable[[Store], T]) -> T:
        """Result of `work`, one short transaction.

        If the caller is cancelled, work that has begun continues to its end and keeps its thread until then.

        Raises
        ------
        StoreError
            What `work` raised; StoreUnavailable when the store is not open or does not answer in time.
        """
        store = self._store
        if store is None:
            raise StoreUnavailable("the store is closed")
        async with self._in_time():
            in_context = copy_context().run  # the store lists changes with the author of this request
            return await asyncio.get_running_loop().run_in_executor(self._threads, in_context, work, store)

    async def read_list(self, work: Callable[[Store], T]) -> T:
        """As `call`, for work that reads many documents: `MOST_LISTS` at a time, the others wait."""

        def read(store: Store) -> T:
            try:
                return work(store)
            finally:
                release_freed_memory()

        async with self._in_time(), self._lists:
            return await self.call(read)

    @asynccontextmanager
    async def _in_time(self) -> AsyncIterator[None]:
        """Raise `StoreUnavailable` when the block takes too long. A call that has begun continues in its thread."""
        try:
            async with asyncio.timeout(self._timeout_s):
                yield
        except TimeoutError:
            raise StoreUnavailable(
                f"the database did not answer within {self._timeout_s:g} s (STORE_TIMEOUT_S)"
            ) from None

    async def is_available(self) -> bool:
        """Whether the store can be read now; False if it does not answer within `PROBE_TIMEOUT_S`."""
        return bool(await self._probe.result(PROBE_TIMEOUT_S))

    def _is_readable(self) -> bool:
        store = self._store
        try:
            return store is not None and store.revision() >= 0
        except StoreError:
            return False

    async def ready(self) -> Mapping[str, ReadyModel]:
        """Newest version of each model that has one, by name. Only changed models are read again."""
        async with self._in_time(), self._loading:
            revision = await self.call(Store.revision)
            if revision != self._revision:
                # A model may change between the two reads. Then the stored revision is too old, and the next call reads
                # the model again.
                known = self._ready
                self._ready = await self.call(lambda store: _read_ready(store, known))
                self._revision = revision
            return self._ready

    async def ready_models(self, names: Sequence[str] | None) -> list[ModelDocument]:
        """Newest versions of the named models (None: of all models), in the order of the names.

        Raises
        ------
        ModelNotFound
            When one of the models does not exist.
        InvalidOption
            When a model has no version yet, or the models are too large together.
        """
        ready = await self.ready()
        for name in names or ():
            if name not in ready:
                samples = await self.call(lambda store, name=name: store.sample_count(name))  # type: ignore[misc]
                raise InvalidOption(
                    f"models: {name} has no version yet, only samples ({samples}). "
                    f"Create one with POST /layout/models/{name}/initialize.",
                    "models",
                )
        documents = [ready[name].document for name in (sorted(ready) if names is None else names)]
        size = sum(len(model.document) for model in documents)
        if size > MOST_MODEL_BYTES:
            raise InvalidOption(
                f"models: the {len(documents)} competing models have {size / 2**20:.0f} MiB together; the limit is "
                f"{MOST_MODEL_BYTES / 2**20:.0f}. Name fewer models.",
                "models",
            )
        return documents

    async def decision(self, result: LayoutResult, tolerated: Mapping[str | None, float]) -> Decision:
        """Whether a recognized page may go through without a person, by the feedback on its class so far."""
        if result.class_ is None:
            return decide(result, (), tolerated)
        name = result.class_.name
        verdicts = await self.call(lambda store: store.verdicts(name, EVIDENCE))
        return await asyncio.to_thread(decide, result, verdicts, tolerated)

    async def keep_result(self, document: StoredResultJson, owner: str | None = None) -> str:
        """Store a recognition result of `owner` and return its id.

        A page that fits no class is also stored as an unknown page.
        """
        ttl_s = self._results.ttl_s

        def keep(store: Store) -> str:
            draft = self._draft(document, owner)
            return store.add_result(document, ttl_s, draft.unknown, owner, draft.review)

        result_id = await self.call(keep)
        await self._purge_when_due(1)
        return result_id

    async def keep_document(
        self, document: StoredResultJson, pages: Sequence[StoredResultJson], owner: str | None = None
    ) -> tuple[str, list[str]]:
        """Store a document's result and those of its pages in one transaction; their ids."""

        def keep(store: Store) -> tuple[str, list[str]]:
            drafts = [self._draft(page, owner) for page in pages]
            return store.add_document(document, drafts, self._results.ttl_s)

        ids = await self.call(keep)
        await self._purge_when_due(1 + len(pages))
        return ids

    def _draft(self, document: StoredResultJson, owner: str | None) -> ResultDraft:
        unknown = self.unknown_page(document["page"], owner) if _is_unknown(document) else None
        result = document.get("result")
        review = None if result is None or "zones" not in result else place_of_stored(result)
        return ResultDraft(document, unknown, owner, review)

    async def _purge_when_due(self, new: int) -> None:
        """Delete expired results at intervals. A failure is logged only, because nothing else depends on it."""
        now = time.monotonic()
        self._results_since_purge += new
        if now - self._last_purge_s <= PURGE_EVERY_S and self._results_since_purge <= PURGE_EVERY_RESULTS:
            return
        self._last_purge_s, self._results_since_purge = now, 0
        try:
            await self.purge()
        except StoreError as error:
            log.error("expired results could not be deleted: %s", error.detail)

    async def purge(self) -> None:
        """Delete what has expired, and the oldest results and kept pages over their limit. Raises `StoreError`."""
        await self.call(self._purge)

    def _purge(self, store: Store) -> None:
        store.purge_results(keep_newest=self._results.max_results)
        store.purge_kept_pages(keep_newest=self._results.max_results)
        store.purge_uploads()

    async def keep_pages(self, documents: Sequence[KeptPageJson], owner: str | None) -> list[str]:
        """Store what is known of photos of `owner` that are kept; the ids of their pages."""
        ids = await self.call(lambda store: store.add_kept_pages(documents, self._results.ttl_s, owner))
        await self._purge_when_due(len(ids))
        return ids

    def unknown_page(self, page: PageJson, owner: str | None) -> UnknownPageDraft:
        """A page that fits no class, with the store's limits for such pages."""
        return UnknownPageDraft(page, self._results.max_unknown_pages, self._results.unknown_ttl_s, owner)


def _is_unknown(document: StoredResultJson) -> bool:
    """Whether models competed for this page, and none was likely enough."""
    result, page = document.get("result"), document.get("page")
    if result is None or page is None:
        return False
    return bool(result.get("classes")) and result.get("class") is None and bool(page.get("zones"))


def _catch_up(store: Store) -> None:
    """After an update: queue what an older release kept without a queue, and say what cannot be taken back."""
    if store.upgraded_from is None:
        return
    log.info("the database of an older release is up to date", extra={"schema_before": store.upgraded_from})
    queued = store.queue_results(place_of_stored)
    if queued:
        log.info("results of an older release are in the review queue now", extra={"results": queued})
    lessons = store.count_feedback_without_lessons()
    if lessons:
        log.warning(
            "an older release stored %d feedbacks without the pages that they taught: feedback that came before one of "
            "these cannot be taken back from the same model any more. Initialize the model from its samples instead: "
            "POST /layout/models/{name}/initialize",
            lessons,
        )


def _read_ready(store: Store, known: Mapping[str, ReadyModel]) -> dict[str, ReadyModel]:
    """Newest version of each model. Versions in `known` are not read again, because a version never changes."""
    ready = {}
    for summary in store.models():
        if summary.version is None:
            continue
        newest = known.get(summary.name)
        if newest is None or newest.document.version != summary.version:
            try:
                model = store.model(summary.name, summary.version)
            except ModelNotFound:  # deleted since the names were read
                continue
            assert model.document is not None
            # The sufficient statistics are used by learning only. They are half of the document.
            recognizing = replace(model, document={**model.document, "memory": None})
            newest = ReadyModel(document_of(recognizing), labels_of(model.document))
        # Settings belong to the model, not to the version: they may have changed.
        settings = summary.settings
        document = replace(
            newest.document,
            genre=settings.genre,
            continues=settings.continues,
            fields=settings.fields,
            elements=settings.elements,
        )
        ready[summary.name] = replace(newest, document=document)
    return ready


def document_of(model: StoredModel) -> ModelDocument:
    """A version of a model, as sent to workers."""
    assert model.version is not None
    assert model.document is not None
    settings = model.settings
    return ModelDocument(
        model.name,
        model.version,
        packed_model(model.document),
        genre=settings.genre,
        continues=settings.continues,
        learner=settings.learner,
        fields=settings.fields,
        elements=settings.elements,
    )


def packed_model(document: ModelJson) -> bytes:
    """The JSON of a model's document."""
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()


def labels_of(document: ModelJson) -> tuple[str, ...]:
    """The labels of a layout model, in the model's order; the null node has none."""
    return tuple(str(node["label"]) for node in document["nodes"] if node["label"] is not None)
