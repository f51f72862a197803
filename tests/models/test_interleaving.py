"""Two calls of the store on PostgreSQL, one of them within the other: as if they had come one after the other."""

import random
import re
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import Any

import psycopg
import pytest
from sqlalchemy import event

from benchmarks.common.postgresql import Cluster
from models.repository import Store
from models.tables import Table
from tests.counts import IS_LONG
from tests.models.databases import KINDS
from tests.models.writing_calls import (
    JOB_CALLS,
    PAGE_CALLS,
    Call,
    World,
    make_jobs,
    make_pages,
    masked_rows,
    outcome,
)

pytestmark = pytest.mark.skipif("postgresql" not in KINDS, reason="SQLite has one writer at a time by itself")

SAMPLE = 15
"""Pairs of each kind that `make test` tries; `make test-long` tries all."""
PATIENCE_S = 30.0
_WRITE = re.compile(r"\s*(INSERT|UPDATE|DELETE)\b", re.IGNORECASE)
_IS_BLOCKED = "SELECT count(*) FROM pg_locks WHERE NOT granted"

Pair = tuple[str, str, int]
Seen = tuple[object, object, list[tuple[Any, ...]]]


def _pairs(calls: dict[str, Call], pauses: Sequence[int]) -> list[Pair]:
    pairs = [(first, second, pause) for first, second in product(calls, calls) for pause in pauses]
    return pairs if IS_LONG else random.Random(7).sample(pairs, SAMPLE)


class Turnstile:
    """Holds the thread that enters it before its write of a number, until it is opened."""

    def __init__(self, store: Store) -> None:
        self._held = threading.Event()
        self._open = threading.Event()
        self._thread = 0
        self._writes = 0
        event.listen(store._readers, "before_cursor_execute", self._on_statement)

    def run(self, pause: int, call: Call, store: Store, world: World) -> object:
        """The outcome of a call that is held before its write of number `pause`."""
        self._held.clear()
        self._open.clear()
        self._thread, self._writes = threading.get_ident(), pause
        try:
            return outcome(call, store, world)
        finally:
            self._thread = 0
            self._held.set()

    def wait(self) -> None:
        """Return when the thread is held, or has ended."""
        assert self._held.wait(PATIENCE_S)

    def open(self) -> None:
        """Let it go on."""
        self._open.set()

    def _on_statement(self, _: object, __: object, statement: str, *___: object) -> None:
        if threading.get_ident() != self._thread or not _WRITE.match(statement):
            return
        self._writes -= 1
        if self._writes == 0:
            self._held.set()
            assert self._open.wait(PATIENCE_S)


class Stage:
    """Two stores on one database, as two processes have them."""

    def __init__(self, url: str, watcher: psycopg.Connection[Any], stores: tuple[Store, Store]) -> None:
        self._url, self._watcher = url, watcher
        self.first, self.second = stores
        self._turnstile = Turnstile(self.first)
        self._threads = ThreadPoolExecutor(2)
        self._in_turn: dict[tuple[str, str], Seen] = {}

    def fresh_world(self, calls: dict[str, Call]) -> World:
        """The world again, in an empty database."""
        for table in reversed(Table.metadata.sorted_tables):
            if table.name != "store_state":
                self._watcher.execute(f"DELETE FROM {table.name}")  # type: ignore[arg-type]
        return make_pages(self.first) if calls is PAGE_CALLS else make_jobs(self.first)

    def in_turn(self, calls: dict[str, Call], first: str, second: str) -> Seen:
        """Outcomes of the two calls, one after the other, and all rows."""
        if (first, second) not in self._in_turn:
            world = self.fresh_world(calls)
            outcomes = [outcome(calls[each], self.first, world) for each in (first, second)]
            self._in_turn[first, second] = (*outcomes, masked_rows(self.first))
        return self._in_turn[first, second]

    def one_in_the_other(self, calls: dict[str, Call], first: str, second: str, pause: int) -> Seen:
        """The same, where the second comes between what the first reads and what it writes."""
        world = self.fresh_world(calls)
        outer = self._threads.submit(self._turnstile.run, pause, calls[first], self.first, world)
        self._turnstile.wait()
        inner = self._threads.submit(outcome, calls[second], self.second, world)
        deadline = time.monotonic() + PATIENCE_S
        while not (inner.done() or self._is_blocked()):
            assert time.monotonic() < deadline
        self._turnstile.open()
        found = (outer.result(PATIENCE_S), inner.result(PATIENCE_S))
        return (*found, masked_rows(self.first))

    def _is_blocked(self) -> bool:
        row = self._watcher.execute(_IS_BLOCKED).fetchone()
        return row is not None and row[0] > 0


@pytest.fixture(scope="module")
def stage(cluster: Cluster) -> Iterator[Stage]:
    url = cluster.make_database()
    name = url.partition("@/")[2].partition("?")[0]
    with Store.open(url) as first, Store.open(url) as second, cluster.connect(name) as watcher:
        yield Stage(url, watcher, (first, second))


# A pause before the first write finds what a call has read too early. Jobs have locks of rows, not one lock for all, so
# that two calls could also wait for each other after a write.
@pytest.mark.parametrize(
    ("calls", "pauses"), [(PAGE_CALLS, (1,)), (JOB_CALLS, (1, 2))], ids=["pages and models", "jobs"]
)
@pytest.mark.long
def test_nothing_comes_between_what_a_call_reads_and_what_it_writes(
    stage: Stage, calls: dict[str, Call], pauses: Sequence[int]
) -> None:
    wrong = []
    for first, second, pause in _pairs(calls, pauses):
        try:
            found = stage.one_in_the_other(calls, first, second, pause)
        except Exception as error:
            wrong.append((first, second, pause, repr(error)))
            continue
        if found == stage.in_turn(calls, first, second):
            continue
        other = stage.in_turn(calls, second, first)
        if found != (other[1], other[0], other[2]):
            wrong.append((first, second, pause, str(found[:2])))
    assert not wrong, wrong
