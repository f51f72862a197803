"""A store on a real file, with a clock that only moves when it is told to."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import settings

from models.repository import Store

# The time of one example says nothing on a busy machine; the same examples run every time.
settings.register_profile("laws", deadline=None, derandomize=True)
settings.load_profile("laws")


class Clock:
    """Times in UTC, a second later with every look."""

    def __init__(self) -> None:
        self.now = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)

    def __call__(self) -> datetime:
        self.now += timedelta(seconds=1)
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def store(tmp_path: Path, clock: Clock) -> Iterator[Store]:
    with Store.open(tmp_path / "store.sqlite3", clock=clock) as store:
        yield store
