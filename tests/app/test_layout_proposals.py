"""Pages that fitted no class, and proposals about the set of classes."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.storage.layout_store import DATABASE
from models.records import UnknownPageDraft
from models.repository import Store
from services.contract.layout_models import MOST_COMPARED_SAMPLES
from services.contract.operations import Operations
from services.layout.exchange.page_json import page_to_document
from tests.app.scripted import OPERATIONS
from tests.app.serving import serving
from tests.app.test_layout_models import labelled
from tests.app.test_problems import assert_problem
from tests.services.layout.samples import labelled_page

PAGES, PROPOSALS = "/layout/unknown-pages", "/layout/proposals"
RESULT = "01J9ZZZZZZZZZZZZZZZZZZZZZ{}"


@pytest.fixture
def client(empty_service: httpx.Client) -> httpx.Client:
    """A service that remembers nothing yet; it keeps what it learns in `data_dir`."""
    return empty_service


def keep_unknown(folder: Path, *pages: dict[str, Any]) -> list[str]:
    """Have the store keep pages that fitted no class, as recognition does; their ids."""
    with Store.open(folder / DATABASE) as store:
        for page in pages:
            store.add_result({}, 1000, UnknownPageDraft(page, bound=100, ttl_s=1000))
        return [page.id for page in store.each_unknown_page()]


def page_document(name: str, seed: int) -> dict[str, Any]:
    return page_to_document(labelled_page(name, seed))


def test_unknown_pages_are_listed_newest_first(client: httpx.Client, data_dir: Path) -> None:
    assert client.get(PAGES).json() == {"pages": []}
    ids = keep_unknown(data_dir, labelled("a"), labelled("a", "b"))
    told = client.get(PAGES).json()["pages"]
    assert [page["id"] for page in told] == ids[::-1]
    assert [page["zones"] for page in told] == [2, 1]
    with Store.open(data_dir / DATABASE) as store:
        results = [page.result_id for page in store.each_unknown_page()]
    assert [page["result"] for page in told] == results[::-1]


def test_an_unknown_page_may_become_a_sample(client: httpx.Client, data_dir: Path) -> None:
    (page_id,) = keep_unknown(data_dir, labelled(None, None))
    page = client.get(f"{PAGES}/{page_id}").json()
    assert (page["id"], page["width"], len(page["zones"])) == (page_id, 10, 2)
    page["zones"][0]["label"] = "sender"
    assert client.post("/layout/models/new/samples", json=page).status_code == 201
    assert client.delete(f"{PAGES}/{page_id}").status_code == 204
    assert client.get(PAGES).json() == {"pages": []}


@pytest.mark.parametrize("page_id", ["nothing", RESULT.format(0)])
def test_what_is_not_kept_is_not_found(client: httpx.Client, page_id: str) -> None:
    assert_problem(client.get(f"{PAGES}/{page_id}"), 404, "not-found")
    assert_problem(client.delete(f"{PAGES}/{page_id}"), 404, "not-found")


def test_proposals_of_nothing(client: httpx.Client) -> None:
    assert client.post(PROPOSALS).json() == {
        "new_classes": [],
        "merges": [],
        "splits": [],
        "looked_at": {"unknown_pages": 0, "models": 0, "samples": 0},
    }


def test_proposals_say_what_to_do_next(client: httpx.Client, data_dir: Path) -> None:
    ids = keep_unknown(data_dir, labelled("a"), labelled("b"))
    for name in ("letter", "memo"):
        client.post(f"/layout/models/{name}/samples", json=labelled("sender"))
    told = client.post(PROPOSALS).json()
    (new,), (merge,), (split,) = told["new_classes"], told["merges"], told["splits"]
    assert new["pages"] == ids[::-1], "newest first"
    assert f"GET {PAGES}/{ids[-1]}" in new["next"][0]
    assert merge["models"] == ["letter", "memo"]
    assert "renamed" in merge["next"][0]
    assert merge["next"][-1] == "DELETE /layout/models/memo."
    assert "/layout/models/letter/samples" in split["next"][0]
    assert told["looked_at"] == {"unknown_pages": 2, "models": 2, "samples": 2}


def test_proposals_may_come_later(client: httpx.Client, data_dir: Path) -> None:
    (page_id,) = keep_unknown(data_dir, labelled("a"))
    accepted = client.post(PROPOSALS, headers={"Prefer": "respond-async"})
    assert accepted.status_code == 202
    result = f"{accepted.headers['location']}/result"
    deadline = time.monotonic() + 30
    while (later := client.get(result)).status_code != 200:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert later.json()["new_classes"][0]["pages"] == [page_id]


def test_the_newest_samples_are_looked_at(client: httpx.Client) -> None:
    ids = [
        client.post("/layout/models/letter/samples", json=labelled(*["a"] * count)).json()["id"]
        for count in range(1, MOST_COMPARED_SAMPLES + 3)
    ]
    (split,) = client.post(PROPOSALS).json()["splits"]
    assert split["parts"][0]["samples"] == ids[2:]


def test_a_new_class_a_merge_and_a_split_are_found(tmp_path: Path) -> None:
    operations = replace(OPERATIONS, propose_classes=Operations().propose_classes)
    with serving(operations, data_dir=tmp_path, worker_memory_bytes=4 << 30, job_timeout_s=60) as client:
        ids = keep_unknown(tmp_path, *(page_document("margin", seed) for seed in range(4)))
        samples = [
            *(("a", "two-column", seed) for seed in range(4)),
            *(("b", "two-column", seed) for seed in range(4, 8)),
            *(("both", name, seed) for seed in range(5) for name in ("fax", "plain")),
        ]
        for model, name, seed in samples:
            path = f"/layout/models/{model}/samples"
            assert client.post(path, json=page_document(name, seed)).status_code == 201
        response = client.post(PROPOSALS)
        assert response.status_code == 200
        told = response.json()
        (new,), (merge,), (split,) = told["new_classes"], told["merges"], told["splits"]
        assert new["pages"] == ids[::-1]
        zones = {
            page["id"]: client.get(f"{PAGES}/{page['id']}").json()
            for page in client.get(PAGES).json()["pages"]
        }
        assert len(new["recurring_zones"]) >= 4
        for zone in new["recurring_zones"]:
            for page_id, zone_id in zone.items():
                assert zone_id in {each["id"] for each in zones[page_id]["zones"]}
        assert merge["models"] == ["a", "b"]
        kept = [sample["id"] for sample in client.get("/layout/models/both/samples").json()["samples"]]
        assert split["model"] == "both"
        assert {tuple(part["samples"]) for part in split["parts"]} == {tuple(kept[::2]), tuple(kept[1::2])}
        assert told["looked_at"] == {"unknown_pages": 4, "models": 3, "samples": 18}
