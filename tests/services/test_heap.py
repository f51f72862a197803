"""When freed memory is given back, and when it is kept."""

import pytest

from services import heap


def test_only_what_a_large_image_leaves_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    given_back: list[int] = []

    def trim(pad: int) -> int:
        given_back.append(pad)
        return 1

    monkeypatch.setattr(heap, "_trim", trim)
    heap.release_if_large(3_000_000 * 3)
    assert not given_back
    heap.release_if_large(12_000_000 * 3)
    assert given_back == [0]


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
