"""When freed memory is given back."""

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
