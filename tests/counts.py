"""How often a test repeats: few times in `make test`, the full count in `make test-long`."""

import os
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")

IS_LONG = os.environ.get("LONG_TESTS") == "1"


def repeats(few: int, many: int) -> int:
    """`few`, or `many` where LONG_TESTS=1 is set."""
    return many if IS_LONG else few


def some(few: int, cases: Sequence[T]) -> Sequence[T]:
    """The first `few` of the cases, or all of them where LONG_TESTS=1 is set; their test is marked `long`."""
    return cases if IS_LONG else cases[:few]
