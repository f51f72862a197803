"""Clients that list many large results at once."""

import json
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx

from benchmarks.attack.clients import Answer, answer_of
from benchmarks.attack.row import Attack

CLIENTS = 8
RESULTS = 8
ZONES = 50
LETTERS = 34_000
"""Of a zone: a page is as large as MAX_ZONES_BYTES allows."""
MOST_LISTED = 4
"""Results of this size in one answer."""
_NAME = "large-results"
_TIMEOUT_S = 60.0


def _page(number: int) -> dict[str, Any]:
    zones = [
        {
            "id": f"z{at}",
            "box": [10 + at % 10 * 110, 10 + at // 10 * 300, 100 + at % 10 * 110, 300 + at // 10 * 300],
            "label": f"l{at}",
            "text": f"w{number} ord ".ljust(8) * (LETTERS // 8),
        }
        for at in range(ZONES)
    ]
    return {"width": 1275, "height": 1650, "zones": zones}


def _lists(url: str, query: str) -> Iterable[httpx.Response]:
    """The answers of one client that follows the links to the end."""
    with httpx.Client(base_url=url, timeout=_TIMEOUT_S) as client:
        path = f"/layout/results?{query}"
        while path:
            response = client.get(path)
            yield response
            path = response.links.get("next", {}).get("url", "")


def list_large_results(url: str) -> Answer:
    """Eight clients read the whole list of large results: each of them sees every result, few at a time."""
    model = f"{url}/layout/models/{_NAME}"
    httpx.post(f"{model}/samples", json=_page(0), timeout=_TIMEOUT_S).raise_for_status()
    httpx.post(f"{model}/initialize", timeout=_TIMEOUT_S).raise_for_status()
    made = set()
    for number in range(RESULTS):
        form = {"zones": json.dumps(_page(number)), "models": _NAME}
        answer = httpx.post(f"{url}/layout", data=form, timeout=_TIMEOUT_S).raise_for_status()
        made.add(answer.json()["id"])

    def read(client: int) -> Answer:
        query = ("limit=200", "limit=200&state=open&order=gain")[client % 2]
        seen: list[str] = []
        for response in _lists(url, query):
            if response.status_code != 200:
                return answer_of(response)
            large = [each["id"] for each in response.json()["results"] if each["id"] in made]
            if len(large) > MOST_LISTED:
                return Answer(200, f"{len(large)} results at once")
            seen += large
        is_right = len(seen) == RESULTS and set(seen) == made
        return Answer(200, "ok" if is_right else f"{len(seen)} of {RESULTS} results")

    with ThreadPoolExecutor(CLIENTS) as threads:
        answers = list(threads.map(read, range(CLIENTS)))
    return next((answer for answer in answers if answer.code != "ok"), answers[0])


ATTACKS = (Attack("8 clients that list large results", list_large_results, ("ok",), is_quick=False),)
