"""Twenty clients of two services that share a database: no page twice, no write lost, no answer 500."""

from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from itertools import product
from pathlib import Path
from threading import Barrier
from typing import Any

import httpx
import pytest

from benchmarks.common.postgresql import Cluster, running_cluster
from tests.app.scripted_models import model_document
from tests.app.test_layout_feedback import give, recognize, taught
from tests.app.test_layout_models import add_samples, labelled
from tests.counts import repeats
from tests.end_to_end.processes import SCRIPTED, running
from tests.models.databases import KINDS

pytestmark = pytest.mark.long

CLIENTS = 20
ROUNDS = repeats(2, 200)
LABELS = ("sender", "date")


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    with running_cluster() as cluster:
        yield cluster


@pytest.fixture(scope="module", params=KINDS)
def clients(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[list[httpx.Client]]:
    """A client for each of two services on one database, which know letters and memos."""
    folder: Path = tmp_path_factory.mktemp("shared")
    settings: dict[str, object] = {"data_dir": folder, "workers": 1, "queue_length": 64}
    if request.param == "postgresql":
        settings["database_url"] = request.getfixturevalue("cluster").make_database()
    with ExitStack() as stack:
        services = [stack.enter_context(running(SCRIPTED, **settings)) for _ in range(2)]
        opened = [stack.enter_context(httpx.Client(base_url=service.url, timeout=60)) for service in services]
        for name in ("letter", "memo"):
            document = model_document(name, *LABELS)
            assert opened[0].put(f"/layout/models/{name}", json=document).status_code == 201
        yield opened


def all_at_once(
    clients: list[httpx.Client], send: Callable[[httpx.Client, int], httpx.Response]
) -> list[httpx.Response]:
    """The answers to twenty clients, half of them of each service."""
    barrier = Barrier(CLIENTS)

    def one(number: int) -> httpx.Response:
        barrier.wait(60)
        return send(clients[number % len(clients)], number)

    with ThreadPoolExecutor(CLIENTS) as threads:
        answers = list(threads.map(one, range(CLIENTS)))
    assert not [answer.text for answer in answers if answer.status_code >= 500]
    return answers


def test_a_page_is_claimed_by_one_person(clients: list[httpx.Client]) -> None:
    for _ in range(ROUNDS):
        path = f"/layout/results/{recognize(clients[0])}/claim"
        answers = all_at_once(clients, lambda client, _, path=path: client.post(path))  # type: ignore[misc]
        statuses = Counter(answer.status_code for answer in answers)
        assert statuses == {200: 1, 409: CLIENTS - 1}


def test_all_that_people_do_with_one_page(clients: list[httpx.Client]) -> None:
    """Whoever claims, skips, gives feedback or takes it back: what counts is the last feedback.

    The class that was found learns from every feedback, another one if it was named.
    """
    for _ in range(ROUNDS):
        result = recognize(clients[0], "letter")
        before = {name: len(taught(clients[0], name)) for name in ("letter", "memo")}
        bodies = [
            {"class": name, "labels": {"z1": label}} for name, label in product(("letter", "memo"), LABELS)
        ]

        def send(
            client: httpx.Client, number: int, result: str = result, bodies: Any = bodies
        ) -> httpx.Response:
            path = f"/layout/results/{result}"
            if number % 5 == 1:
                return client.post(f"{path}/claim", json={"recognize": True})
            if number % 5 == 2:
                return client.post(f"{path}/skip")
            if number % 5 == 3 and number > 10:
                return client.delete(f"{path}/feedback")
            return give(client, result, bodies[number % len(bodies)])

        all_at_once(clients, send)
        kept = {
            entry["id"]: name
            for name in ("letter", "memo")
            for entry in clients[1].get(f"/layout/models/{name}/feedback").json()["feedback"]
            if entry["result"] == result and entry["class"]["verified"] == name
        }
        learned = {name: len(taught(clients[0], name)) - count for name, count in before.items()}
        last = kept[max(kept)] if kept else None
        assert learned == {"letter": int(last is not None), "memo": int(last == "memo")}


def test_a_job_of_a_key_is_one_job(clients: list[httpx.Client]) -> None:
    path = "/layout/models/letter/initialize"
    add_samples(clients[0], labelled("sender"))
    for number in range(ROUNDS):
        headers = {"Prefer": "respond-async", "Idempotency-Key": f"key {number}"}
        answers = all_at_once(
            clients,
            lambda client, _, headers=headers: client.post(path, headers=headers),  # type: ignore[misc]
        )
        assert {answer.status_code for answer in answers} == {202}
        assert len({answer.headers["location"] for answer in answers}) == 1


PATHS = (
    ("GET", "/jobs/a%00b"),
    ("GET", "/jobs/a%00b/result"),
    ("DELETE", "/jobs/a%00b"),
    ("DELETE", "/cameras/a%00b"),
    ("GET", "/layout/models/a%00b"),
    ("GET", "/layout/models/a%00b/feedback"),
    ("POST", "/layout/models/a%00b/initialize"),
    ("GET", "/layout/results/a%00b"),
    ("POST", "/layout/results/a%00b/claim"),
    ("DELETE", "/layout/unknown-pages/a%00b"),
)


@pytest.mark.parametrize(("method", "path"), PATHS, ids=[" ".join(each) for each in PATHS])
def test_a_path_with_nul_names_nothing(clients: list[httpx.Client], method: str, path: str) -> None:
    answer = clients[0].request(method, path)
    assert (answer.status_code, answer.json()["code"]) == (404, "not-found")


def test_a_query_with_nul_is_invalid(clients: list[httpx.Client]) -> None:
    answer = clients[0].get("/audit?model=a%00b")
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid-option")
