"""How often a test repeats: few times in `make test`, the full count in `make test-long`."""

import os

IS_LONG = os.environ.get("LONG_TESTS") == "1"


def repeats(few: int, many: int) -> int:
    """`few`, or `many` where LONG_TESTS=1 is set."""
    return many if IS_LONG else few
