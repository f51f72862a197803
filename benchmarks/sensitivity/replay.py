"""Functions whose results are used again when neither their arguments nor a field that they read has changed.

With one parameter changed most of a step computes what it computed before. So a study takes minutes and not hours.
"""

import cProfile
import functools
import hashlib
import inspect
import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.sensitivity.fields import Watch, modules_of
from services.errors import DocumentError

SLOW_S = 0.01
"""Functions that take less CPU time a call are run again: to compare their arguments takes a millisecond or two."""


@dataclass(frozen=True, slots=True, eq=False)
class _Answer:
    """What a call gave, under which change, and the fields that it read."""

    change: object
    reads: frozenset[str]
    result: Any
    error: DocumentError | None

    def holds(self, change: tuple[str, Any] | None) -> bool:
        """Whether the call would give the same under `change`: neither change was read, or both are the same."""
        if change == self.change:
            return True
        return not any(each and each[0] in self.reads for each in (change, self.change))


class Replay:
    """Answers of the slow functions of a step, by digests of their arguments."""

    def __init__(self, watch: Watch) -> None:
        self.watch = watch
        self.answers: dict[bytes, list[_Answer]] = {}
        self.excluded: set[str] = set()

    def forget_changes(self) -> None:
        """Keep the answers of the defaults alone."""
        kept = {key: [each for each in found if each.change is None] for key, found in self.answers.items()}
        self.answers = {key: found for key, found in kept.items() if found}

    def wrapped(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """`function`, whose answers are used again. Arrays are copied: a caller may draw on them."""
        name = f"{function.__module__}.{function.__qualname__}"

        @functools.wraps(function)
        def call(*args: Any, **options: Any) -> Any:
            key = None if name in self.excluded else self._digest(name, args, options)
            if key is None:
                return function(*args, **options)
            for each in self.answers.get(key, ()):
                if each.holds(self.watch.change):
                    self.watch.reads[-1] |= each.reads
                    return _handed_out(each)
            answer = self._run(function, args, options)
            if self.watch.change is None and self._digest(name, args, options) != key:
                self.excluded.add(name)  # It changes its arguments.
            elif answer.result is not None or answer.error is not None:
                self.answers.setdefault(key, []).append(answer)
            return _handed_out(answer)

        return call

    def _run(self, function: Callable[..., Any], args: Any, options: Any) -> _Answer:
        watch = self.watch
        result, error = None, None
        watch.reads.append(set())
        try:
            result = function(*args, **options)
        except DocumentError as raised:
            error = raised
        finally:
            reads = watch.reads.pop()
            watch.reads[-1] |= reads
        return _Answer(watch.change, frozenset(reads), result, error)

    def _digest(self, *values: object) -> bytes | None:
        with self.watch.pausing():
            return digest(*values)


def _handed_out(answer: _Answer) -> Any:
    if answer.error is not None:
        raise answer.error
    return answer.result.copy() if isinstance(answer.result, np.ndarray) else answer.result


def digest(*values: object) -> bytes | None:
    """Digest of all that the values hold; None where they cannot be pickled."""
    hashed = hashlib.blake2b(digest_size=16)

    def take(buffer: pickle.PickleBuffer) -> None:
        hashed.update(buffer.raw())

    try:
        hashed.update(pickle.dumps(values, protocol=5, buffer_callback=take))
    except (pickle.PicklingError, AttributeError, TypeError):
        return None
    return hashed.digest()


def find_slow(packages: Sequence[str], run: Callable[[], object]) -> list[Callable[..., Any]]:
    """Module functions of these packages that take `SLOW_S` of CPU time a call, or more, in `run`."""
    profile = cProfile.Profile(time.process_time)
    profile.runcall(run)
    slow = {
        entry.code
        for entry in profile.getstats()  # type: ignore[attr-defined]
        if entry.totaltime >= SLOW_S * entry.callcount
    }
    return [
        function
        for module in modules_of(packages)
        for function in vars(module).values()
        if inspect.isfunction(function)
        and function.__module__ == module.__name__
        and not inspect.isgeneratorfunction(function)
        and function.__code__ in slow
    ]


@contextmanager
def replaying(
    functions: Sequence[Callable[..., Any]], packages: Sequence[str], replay: Replay
) -> Iterator[None]:
    """Wherever modules of these packages name one of the functions, they get it wrapped, in the block."""
    wrapped = {function: replay.wrapped(function) for function in functions}
    places = [
        (module, name, value)
        for module in modules_of(packages)
        for name, value in vars(module).items()
        if inspect.isfunction(value) and value in wrapped
    ]
    for module, name, value in places:
        setattr(module, name, wrapped[value])
    try:
        yield
    finally:
        for module, name, value in places:
            setattr(module, name, value)
