"""One learner at a time for each model, and nobody waits for ever."""

import asyncio

import pytest

from app.engine.base import Busy
from app.interprocess_lock import InterprocessLock
from app.learning.locks import ModelLocks


def test_models_are_held_one_at_a_time_whatever_the_order_of_their_names() -> None:
    held: list[str] = []

    async def learn(locks: ModelLocks, names: list[str]) -> None:
        async with locks.hold(names, 10, "SETTING"):
            assert not set(names) & set(held)
            held.extend(names)
            await asyncio.sleep(0)
            await asyncio.sleep(0)
            for name in names:
                held.remove(name)

    async def run() -> ModelLocks:
        locks = ModelLocks(InterprocessLock(None))
        wanted = [["a", "b"], ["b", "a"], ["a"], ["b", "c"], ["c", "a"]] * 5
        await asyncio.gather(*(learn(locks, names) for names in wanted))
        return locks

    locks = asyncio.run(run())
    assert not locks._locks
    assert not locks._users


def test_different_models_do_not_wait_for_each_other() -> None:
    async def run() -> None:
        locks = ModelLocks(InterprocessLock(None))
        async with locks.hold(["a"], 10, "SETTING"), locks.hold(["b"], 0, "SETTING"):
            pass

    asyncio.run(run())


def test_who_waits_too_long_is_sent_away_and_leaves_nothing_behind() -> None:
    async def run() -> None:
        locks = ModelLocks(InterprocessLock(None))
        async with locks.hold(["b"], 10, "SETTING"):
            with pytest.raises(Busy, match=r"a or b for longer than 0.01 s \(SETTING\)"):
                async with locks.hold(["b", "a"], 0.01, "SETTING"):
                    raise AssertionError("this model is held by another")
            async with locks.hold(["a"], 0, "SETTING"):  # was given back
                pass
        assert not locks._locks

    asyncio.run(run())
