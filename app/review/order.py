"""The review queue in the order of the newest models: pages are recognized again after their class has learned.

A page can teach less once a page like it was corrected, so the order of the first recognition grows old (measured by
`python -m benchmarks review`). Results change only for those who claim a page and ask for it (`routes.review`).
"""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from app.engine.base import Engine
from app.learning.labelled_pages import layout_settings
from app.review.decisions import place_of_stored, tolerated_errors_of
from app.schemas.layout import result_of, stored_form
from app.settings import Settings
from app.storage.layout_store import LayoutStore
from models.errors import StoreError
from models.records import RECOGNIZED
from services.contract.operations import Operations
from services.contract.result_json import StoredResultJson
from services.errors import DocumentError

log = logging.getLogger(__name__)

EVERY_S = 1.0
"""Pause between looks at the versions of the models; a look takes 1 ms."""
READ_AT_ONCE = 5
"""Pages that are read together; each one is a job of a worker of its own (60 ms), so that requests wait little."""


class ReviewOrder:
    """Recognizes pages of the queue again, by the newest versions of the models that competed for them."""

    def __init__(
        self, store: LayoutStore, engine: Engine, operations: Operations, settings: Settings
    ) -> None:
        self._store = store
        self._engine = engine
        self._operations = operations
        self._settings = settings
        self._ordered: dict[str, int] = {}
        """Versions of classes none of whose first pages is behind."""

    @asynccontextmanager
    async def kept(self) -> AsyncIterator[None]:
        """Keep the queue in order inside of the block, where this process has workers of its own."""
        if not (self._settings.workers and self._settings.review_ahead):
            yield
            return
        task = asyncio.create_task(self._order_regularly())
        try:
            yield
        finally:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task

    async def recognize_again(self, document: StoredResultJson) -> StoredResultJson | None:
        """The document of a result with another recognition of its page; None if no newer model competes for it.

        A page that a person has verified is not recognized again. A page of a document keeps the document's class.

        Raises
        ------
        DocumentError
            When no worker can do it now.
        """
        if not self._settings.workers or RECOGNIZED in document or "result" not in document:
            return None
        result = document["result"]
        if not result.get("classes"):
            return None
        ready = await self._store.ready()
        models = [
            (ready[match["name"]].document, match["model_version"])
            for match in result["classes"]
            if match["name"] in ready
        ]
        if all(model.version == version for model, version in models):
            return None
        words = any(zone.get("words") is not None for zone in result["zones"])
        whole = (
            (result["document_class"], result["part"])
            if document.get("in_document") and result["document_class"] is not None
            else None
        )
        found = await self._engine.submit(
            self._operations.recognize_again,
            document["page"],
            [model for model, _ in models],
            layout_settings(self._settings),
            words,
            whole,
        )
        again = result_of({**result, **found}, "")
        name = again.class_.name if again.class_ else "*"
        tolerated = tolerated_errors_of(name, self._settings.tolerated_errors)
        again.decision = await self._store.decision(again, tolerated)
        return {**document, "result": stored_form(again)}

    async def _order_regularly(self) -> None:
        while True:
            await asyncio.sleep(EVERY_S)
            try:
                ready = await self._store.ready()
                for name, model in ready.items():
                    await self._order_class(name, model.document.version)
            except (DocumentError, StoreError) as error:
                log.warning("the review queue could not be put in order: %s", error)
            except Exception:
                log.exception("the review queue could not be put in order")

    async def _order_class(self, name: str, version: int) -> None:
        """Recognize the first pages of a class again, as long as a worker is free."""
        ahead = self._settings.review_ahead
        while self._ordered.get(name) != version and self._is_worker_free():
            behind = await self._store.call(
                lambda store: store.reviews_behind(name, version, ahead, READ_AT_ONCE)
            )
            if not behind:
                self._ordered[name] = version
            places = {}
            for result_id, document in behind.items():
                again = await self.recognize_again(document)
                places[result_id] = place_of_stored((again or document)["result"])
            await self._store.call(lambda store, places=places: store.place_reviews(places, version))  # type: ignore[misc]

    def _is_worker_free(self) -> bool:
        status = self._engine.status()
        return status.ready and not status.waiting and status.running < status.live_workers
