"""Twenty clients that want the same thing at once, and names that a database cannot hold."""

from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Barrier
from typing import Any

import httpx
import numpy as np

from benchmarks.attack.clients import Answer, answer_of
from benchmarks.attack.row import Attack
from benchmarks.common.postgresql import IS_INSTALLED, running_cluster
from benchmarks.learning.server_processes import Server
from simulation.labelled_pages import letter_page

CLIENTS = 20
ROUNDS = 3
_TIMEOUT_S = 60.0
_WITH_NUL = ("/jobs/a%00b", "/layout/models/a%00b", "/layout/results/a%00b", "/jobs/a%00b/result")
_names = count(1)

Send = Callable[[httpx.Client, int], httpx.Response]


def _all_at_once(url: str, send: Send) -> list[httpx.Response]:
    barrier = Barrier(CLIENTS)

    def one(number: int) -> httpx.Response:
        with httpx.Client(base_url=url, timeout=_TIMEOUT_S) as client:
            barrier.wait(_TIMEOUT_S)
            return send(client, number)

    with ThreadPoolExecutor(CLIENTS) as threads:
        return list(threads.map(one, range(CLIENTS)))


def _worst(answers: list[httpx.Response], is_right: bool, fault: str) -> Answer:
    """Status 200 and "ok", or what was wrong: the answer of a defect, or this fault. The queue may be full."""
    for answer in answers:
        if answer.status_code >= 500 and answer_of(answer).code != "busy":
            return answer_of(answer)
    return Answer(200, "ok" if is_right else fault)


def _recognize(url: str, page: dict[str, Any], name: str | None = None) -> str:
    zones = [{key: value for key, value in zone.items() if key != "label"} for zone in page["zones"]]
    form = {"zones": httpx.Request("POST", url, json={**page, "zones": zones}).content.decode()}
    answer = httpx.post(
        f"{url}/layout", data=form | ({} if name is None else {"models": name}), timeout=_TIMEOUT_S
    )
    return str(answer.raise_for_status().json()["id"])


def _page(number: int) -> dict[str, Any]:
    return letter_page(np.random.default_rng(number), draw=False).document()


def claim_one_page(url: str) -> Answer:
    """Twenty people claim a page of the queue: one has it."""
    page = _page(1)
    for _ in range(ROUNDS):
        path = f"/layout/results/{_recognize(url, page)}/claim"
        answers = _all_at_once(url, lambda client, _, path=path: client.post(path))  # type: ignore[misc]
        statuses = Counter(answer.status_code for answer in answers)
        if statuses != {200: 1, 409: CLIENTS - 1}:
            return _worst(answers, is_right=False, fault=f"{statuses[200]} claims")
    return Answer(200, "ok")


def teach_one_page(url: str) -> Answer:
    """Twenty people give feedback on a page and take it back: its class has learned from it once, or not at all."""
    name, page = f"race-{next(_names)}", _page(2)
    for number in range(3):
        httpx.post(f"{url}/layout/models/{name}/samples", json=_page(3 + number)).raise_for_status()
    httpx.post(f"{url}/layout/models/{name}/initialize", timeout=_TIMEOUT_S).raise_for_status()
    result = _recognize(url, page, name)
    labels = {str(zone["id"]): zone["label"] for zone in page["zones"]}
    path = f"/layout/results/{result}/feedback"

    def send(client: httpx.Client, number: int) -> httpx.Response:
        if number % 4 == 3:
            return client.delete(path)
        left = dict(list(labels.items())[number % 3 :])
        return client.post(path, json={"class": name, "labels": left})

    answers = _all_at_once(url, send)
    samples = httpx.get(f"{url}/layout/models/{name}/samples", timeout=_TIMEOUT_S).json()["samples"]
    feedback = httpx.get(f"{url}/layout/models/{name}/feedback", timeout=_TIMEOUT_S).json()["feedback"]
    is_right = len(samples) == 3 + bool(feedback)
    return _worst(answers, is_right, f"{len(samples) - 3} samples of a page")


def repeat_one_key(url: str) -> Answer:
    """Twenty requests with one Idempotency-Key: one job."""
    headers = {"Prefer": "respond-async", "Idempotency-Key": f"race-{next(_names)}"}
    form = {"zones": httpx.Request("POST", url, json=_page(1)).content.decode()}
    answers = _all_at_once(url, lambda client, _: client.post("/layout", data=form, headers=headers))
    jobs = {answer.headers.get("location") for answer in answers}
    return _worst(answers, len(jobs) == 1, f"{len(jobs)} jobs")


def name_with_nul(url: str) -> Answer:
    """Paths with NUL, which no text of PostgreSQL has: the answer that is not 404, or the last one."""
    answers = [httpx.get(url + path, timeout=_TIMEOUT_S) for path in _WITH_NUL]
    return answer_of(max(answers, key=lambda answer: answer.status_code))


def _on_postgresql(send: Callable[[str], Answer]) -> Callable[[str], Answer]:
    """The same, sent to a service of its own that keeps what it knows in PostgreSQL."""

    def send_there(_: str) -> Answer:
        with TemporaryDirectory() as folder, running_cluster() as cluster:
            server = Server(Path(folder), workers=1, database_url=cluster.make_database())
            server.start()
            try:
                return send(server.url)
            finally:
                server.stop()

    return send_there


_RACES = (
    ("20 claims of a page", claim_one_page, ("ok",)),
    ("20 feedbacks and undos on a page", teach_one_page, ("ok",)),
    ("20 requests of a key", repeat_one_key, ("ok",)),
    ("names with NUL", name_with_nul, ("not-found",)),
)
ATTACKS = (
    *(Attack(name, send, codes, is_quick=False) for name, send, codes in _RACES),
    *(
        Attack(f"{name}, on PostgreSQL", _on_postgresql(send), codes, is_quick=False)
        for name, send, codes in _RACES
        if IS_INSTALLED
    ),
)
