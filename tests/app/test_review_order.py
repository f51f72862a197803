"""The order of the review queue goes on whatever happens to the store."""

import asyncio
from typing import Any, cast

import pytest

from app.engine.base import Engine
from app.review import order as review_order
from app.review.order import ReviewOrder
from app.settings import Settings
from app.storage.layout_store import LayoutStore
from models.errors import StoreUnavailable
from services.contract.operations import Operations


class StoreThatWasAway:
    """No models, but two failures first."""

    def __init__(self) -> None:
        self.failures: list[Exception] = [StoreUnavailable("the database is away"), KeyError("a defect")]
        self.is_back = asyncio.Event()

    async def ready(self) -> dict[str, Any]:
        if self.failures:
            raise self.failures.pop(0)
        self.is_back.set()
        return {}


def test_failures_do_not_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(review_order, "EVERY_S", 0.001)

    async def keep() -> None:
        store = StoreThatWasAway()
        order = ReviewOrder(
            cast(LayoutStore, store), cast(Engine, None), Operations(), Settings(workers=1, review_ahead=5)
        )
        async with order.kept(), asyncio.timeout(10):
            await store.is_back.wait()

    asyncio.run(keep())
