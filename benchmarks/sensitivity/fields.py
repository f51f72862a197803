"""Numeric fields of parameter dataclasses, found by introspection, and a change of one of them at a time."""

import pkgutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from types import ModuleType
from typing import Any

Value = int | float | tuple["Value", ...]
UNITS = ("px", "deg", "rad", "ms", "s", "percent")
"""Suffixes of names that are units; a field without one is a ratio, a count or a share."""


@dataclass(frozen=True, slots=True)
class Field:
    """A numeric field of a parameter dataclass, with its default."""

    key: str
    """Module below `services`, class and field."""
    owner: type
    name: str
    value: Value

    @property
    def unit(self) -> str:
        """Unit by the name's suffix; "1" for a ratio, "count" for a whole number."""
        suffix = self.name.rsplit("_", 1)[-1]
        if suffix in UNITS:
            return suffix
        return "count" if isinstance(self.value, int) else "1"

    def changed(self, factor: float) -> Value | None:
        """The default times `factor`; whole numbers move by 1 at least and stay positive. None where nothing moves.

        Of a ratio of neighbours a little above 1 (`..._step`) the excess over 1 is multiplied, and of a percentile
        above 50 the distance from 100: 0.9 times another size, or the percentile 102, mean nothing.
        """
        origin = self._origin
        if origin and isinstance(self.value, float):
            moved: Value = origin + (self.value - origin) * factor
        else:
            moved = _moved(self.value, factor)
        return None if moved == self.value else moved

    @property
    def _origin(self) -> float:
        """From where the value is measured."""
        if isinstance(self.value, float):
            if self.name.endswith("step") and 1.0 < self.value < 1.5:
                return 1.0
            if self.name.endswith("percentile") and 50.0 < self.value < 100.0:
                return 100.0
        return 0.0


def _moved(value: Value, factor: float) -> Value:
    if isinstance(value, tuple):
        return tuple(_moved(each, factor) for each in value)
    if not isinstance(value, int):
        return value * factor
    step = round(value * factor)
    if step == value:
        step += 1 if factor > 1 else -1
    return max(step, 1) if value > 0 else value


def modules_of(packages: Sequence[str]) -> Iterator[ModuleType]:
    """All modules of these packages, imported."""
    for name in packages:
        package = import_module(name)
        yield package
        for found in pkgutil.walk_packages(getattr(package, "__path__", ()), f"{name}."):
            yield import_module(found.name)


def find_fields(packages: Sequence[str]) -> list[Field]:
    """Fields with a number, or a tuple of numbers, as default, of all dataclasses named `...Parameters`."""
    found = {}
    for module in modules_of(packages):
        for owner in vars(module).values():
            if not (isinstance(owner, type) and is_dataclass(owner) and owner.__module__ == module.__name__):
                continue
            if owner.__name__.endswith("Parameters"):
                for each in fields(owner):
                    # What is inherited is a field of the base class.
                    if each.name in vars(owner) and _is_numeric(each.default):
                        key = f"{owner.__module__.removeprefix('services.')}.{owner.__name__}.{each.name}"
                        found[key] = Field(key, owner, each.name, each.default)
    return [found[key] for key in sorted(found)]


def _is_numeric(value: object) -> bool:
    if isinstance(value, tuple):
        return bool(value) and all(_is_numeric(each) for each in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


class Watch:
    """Records which fields are read, and changes the value of at most one of them.

    `watching` replaces the slots of the dataclasses by descriptors, so that instances which exist already
    (defaults of arguments, constants of modules) are changed too. A value that differs from the default was chosen
    by the code and is left as it is.
    """

    def __init__(self) -> None:
        self.active: Field | None = None
        self.value: Value | None = None
        self.reads: list[set[str]] = [set()]
        self.paused = False

    @property
    def change(self) -> tuple[str, Value | None] | None:
        """Key and value of the field that is changed now."""
        return None if self.active is None else (self.active.key, self.value)

    @contextmanager
    def changing(self, field: Field, value: Value) -> Iterator[None]:
        """`field` has `value` in the block."""
        self.active, self.value = field, value
        try:
            yield
        finally:
            self.active = self.value = None

    @contextmanager
    def pausing(self) -> Iterator[None]:
        """Reads are neither recorded nor changed in the block."""
        before, self.paused = self.paused, True
        try:
            yield
        finally:
            self.paused = before

    def read(self, key: str, stored: Any) -> Any:
        """What the code gets for a field whose instance holds `stored`."""
        if self.paused:
            return stored
        self.reads[-1].add(key)
        active = self.active
        return self.value if active is not None and active.key == key and stored == active.value else stored


class _WatchedSlot:
    """A slot whose reads go through a `Watch`."""

    def __init__(self, key: str, slot: Any, watch: Watch) -> None:
        self.key, self.slot, self.watch = key, slot, watch

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        if instance is None:
            return self
        return self.watch.read(self.key, self.slot.__get__(instance, owner))

    def __set__(self, instance: object, value: Any) -> None:
        self.slot.__set__(instance, value)


@contextmanager
def watching(found: Sequence[Field], watch: Watch) -> Iterator[None]:
    """All reads of these fields go through `watch` in the block."""
    slots = [vars(field.owner)[field.name] for field in found]
    for field, slot in zip(found, slots, strict=True):
        setattr(field.owner, field.name, _WatchedSlot(field.key, slot, watch))
    try:
        yield
    finally:
        for field, slot in zip(found, slots, strict=True):
            setattr(field.owner, field.name, slot)
