"""Warnings of an answer."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Notice:
    """A warning of the contract: a stable `code`, and a `detail` that a person can act on."""

    code: str
    detail: str
