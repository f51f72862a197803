"""Freed memory, kept for a while."""

import pytest

from services import heap


def test_memory_is_kept_within_a_block_only(monkeypatch: pytest.MonkeyPatch) -> None:
    trimmed: list[int] = []
    monkeypatch.setattr(heap, "_trim", trimmed.append)
    with heap.keeping_freed_memory():
        heap.release_freed_memory()
        with heap.keeping_freed_memory():
            pass
        assert not trimmed
    assert len(trimmed) == 1
    heap.release_freed_memory()
    assert len(trimmed) == 2


def test_memory_is_given_back_after_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    trimmed: list[int] = []
    monkeypatch.setattr(heap, "_trim", trimmed.append)
    with pytest.raises(KeyError), heap.keeping_freed_memory():
        raise KeyError
    assert len(trimmed) == 1
