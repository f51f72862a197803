"""A row of the attack table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from benchmarks.attack.clients import Answer


@dataclass(frozen=True, slots=True)
class Attack:
    """One row: `send` takes the service's address. One of `codes` must be answered.

    `is_quick` rows take less than a second and run in the suite. A row with an `environment` is sent to a service of
    its own, started with these variables.
    """

    name: str
    send: Callable[[str], Answer]
    codes: tuple[str, ...]
    is_quick: bool = True
    environment: Mapping[str, str] = field(default_factory=dict)
