"""Turns among processes: one at a time for a name, never longer waited for than is said, and free after a kill."""

import asyncio
import multiprocessing
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from app.interprocess_lock import InterprocessLock


def hold(file: Path, name: str, said: Connection) -> None:
    """Take the turn, say so, and keep it until a word comes."""

    async def run() -> None:
        async with InterprocessLock(file).take(name, 60.0):
            said.send("taken")
            said.recv()

    asyncio.run(run())


@pytest.fixture
def other(tmp_path: Path):
    """Another process that holds the turn of "letter", and the pipe to it."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=hold, args=(tmp_path / "turns", "letter", there), daemon=True)
    process.start()
    assert here.recv() == "taken"
    yield process, here
    process.kill()
    process.join()


async def is_free(turns: InterprocessLock, name: str) -> bool:
    """Whether the turn comes at once."""
    async with turns.take(name, 0.0):
        return turns.holds(name)


def test_a_turn_is_one_processs_until_it_gives_it_back(tmp_path: Path, other) -> None:
    process, pipe = other
    turns = InterprocessLock(tmp_path / "turns")
    assert not asyncio.run(is_free(turns, "letter"))
    assert asyncio.run(is_free(turns, "memo"))
    pipe.send("go on")
    process.join()
    assert asyncio.run(is_free(turns, "letter"))
    turns.close()


def test_a_kill_ends_a_turn(tmp_path: Path, other) -> None:
    process, _ = other
    process.kill()
    process.join()
    turns = InterprocessLock(tmp_path / "turns")
    assert asyncio.run(is_free(turns, "letter"))
    turns.close()


@pytest.mark.parametrize("file", [None, Path("/proc/no-such-folder/turns")])
def test_where_there_are_no_turns_nobody_waits(file: Path | None) -> None:
    turns = InterprocessLock(file)

    async def run() -> str:
        async with turns.take("letter", 60.0):
            return "done"

    assert asyncio.run(run()) == "done"
    turns.close()
