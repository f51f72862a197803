"""Requests whose clients leave before the answer: what they change, and what others are told meanwhile."""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest

from models.repository import Store
from tests.app.test_layout_feedback import LETTER, answer, give, recognize


@pytest.fixture
def client(empty_service: httpx.Client) -> httpx.Client:
    """A service that knows letters."""
    assert empty_service.put("/layout/models/letter", json=LETTER).status_code == 201
    return empty_service


def test_an_undo_whose_answer_is_lost_is_done_all_the_same(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its client has left, and a repetition of the feedback is answered as the first time; then the undo commits.

    So accepted feedback may be missing, once an undo of it was sent and not answered.
    """
    result = recognize(client)
    told = answer(give(client, result, {"labels": {"z2": "date"}}, "key"))
    arrived, may_go_on, is_done = threading.Event(), threading.Event(), threading.Event()
    undo = Store.undo_feedback

    def held(*arguments: Any, **more: Any) -> Any:
        arrived.set()
        assert may_go_on.wait(20)
        try:
            return undo(*arguments, **more)
        finally:
            is_done.set()

    monkeypatch.setattr(Store, "undo_feedback", held)
    with ThreadPoolExecutor(1) as thread:
        path = f"/layout/results/{result}/feedback"
        lost = thread.submit(client.delete, path, timeout=1)
        assert arrived.wait(20)
        with pytest.raises(httpx.ReadTimeout):
            lost.result()
    again = answer(give(client, result, {"labels": {"z2": "date"}}, "key"))
    assert (again["id"], again["created"]) == (told["id"], False)
    may_go_on.set()
    assert is_done.wait(20)
    assert client.get("/layout/models/letter/feedback").json()["feedback"] == []
