"""The review queue over HTTP: what is listed, claimed and skipped, and how feedback changes it."""

import re
import time
from typing import Any

import httpx
import pytest

from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_layout_feedback import give, recognize
from tests.app.test_problems import assert_problem

LETTER = model_document("letter", "sender", "date")


@pytest.fixture
def client(empty_service: httpx.Client) -> httpx.Client:
    """A service that knows letters."""
    assert empty_service.put("/layout/models/letter", json=LETTER).status_code == 201
    return empty_service


def queue(client: httpx.Client, **options: Any) -> list[dict[str, Any]]:
    response = client.get("/layout/results", params={"state": "open", "order": "gain", **options})
    assert response.status_code == 200, response.text
    entries: list[dict[str, Any]] = response.json()["results"]
    return [{**entry, **entry["review"]} for entry in entries]


@pytest.mark.parametrize(("dropped", "state"), [(0, "confirmed"), (1, "corrected")])
def test_a_page_of_which_a_person_drops_a_zone_is_corrected(
    client: httpx.Client, dropped: int, state: str
) -> None:
    result = recognize(client)
    zones = client.get(f"/layout/results/{result}").json()["zones"]
    given = [{key: zone[key] for key in ("id", "box", "label")} for zone in zones]
    give(client, result, {"class": "letter", "zones": given[: len(given) - dropped]})
    [entry] = client.get("/layout/results").json()["results"]
    assert entry["state"] == state
    client.delete(f"/layout/results/{result}/feedback")
    [entry] = client.get("/layout/results").json()["results"]
    assert entry["state"] == "open"


def test_a_page_is_open_until_somebody_gives_feedback(client: httpx.Client) -> None:
    right, wrong, left = recognize(client), recognize(client), recognize(client)
    give(client, right, {"class": "letter"})
    give(client, wrong, {"labels": {"z2": "date"}})
    assert client.post(f"/layout/results/{left}/skip").status_code == 204
    for order in ("gain", "confidence", "newest"):
        listed = client.get("/layout/results", params={"order": order}).json()["results"]
        states = {entry["id"]: entry["state"] for entry in listed}
        assert states == {right: "confirmed", wrong: "corrected", left: "skipped"}
        for result, state in states.items():
            assert [entry["id"] for entry in queue(client, order=order, state=state)] == [result]
    assert queue(client) == []
    client.delete(f"/layout/results/{wrong}/feedback")
    assert [entry["id"] for entry in queue(client)] == [wrong]
    entry = queue(client)[0]
    assert (entry["class"], entry["zones"], entry["decision"]) == ("letter", 2, "review")
    assert entry["gain"] == pytest.approx(2 - 2 * 0.75 * 0.9)


@pytest.mark.parametrize("order", ["gain", "confidence", "newest"])
def test_a_list_goes_on_at_its_link(client: httpx.Client, order: str) -> None:
    added = {recognize(client) for _ in range(5)}
    path, seen = f"/layout/results?order={order}&limit=2", []
    for _ in range(3):
        response = client.get(path)
        seen += [entry["id"] for entry in response.json()["results"]]
        following = re.fullmatch(r'<([^>]+)>; rel="next"', response.headers.get("link", ""))
        path = following[1].removeprefix("/documents") if following else ""
    assert path == ""
    assert set(seen) == added
    assert len(seen) == 5
    other = seen[0] if order != "newest" else f"0.5_{seen[0]}"
    for cursor, status, code in (
        ("1", 422, "invalid-option"),
        (f"e_{seen[0]}", 422, "invalid-option"),
        (other, 409, "conflict"),
    ):
        response = client.get("/layout/results", params={"cursor": cursor, "order": order})
        assert_problem(response, status, code)


def test_a_claimed_page_is_for_one_person(client: httpx.Client) -> None:
    result = recognize(client)
    mine = client.post(f"/layout/results/{result}/claim").json()
    assert queue(client)[0]["claimed_until"] == mine["until"]
    assert_problem(client.post(f"/layout/results/{result}/claim"), 409, "conflict")
    assert_problem(client.post(f"/layout/results/{result}/skip", json={"claim": "guess"}), 409, "conflict")
    again = client.post(f"/layout/results/{result}/claim", json={"claim": mine["claim"]}).json()
    assert again["claim"] == mine["claim"]
    assert client.post(f"/layout/results/{result}/release", json={"claim": mine["claim"]}).status_code == 204
    assert client.post(f"/layout/results/{result}/claim").json()["claim"] != mine["claim"]
    assert_problem(client.post("/layout/results/01M7ZZQ4ZN38G37138FEXHE2T7/claim"), 404, "not-found")


def test_a_page_that_is_done_is_given_to_nobody_else(client: httpx.Client) -> None:
    skipped, verified = recognize(client), recognize(client)
    claims = {id: client.post(f"/layout/results/{id}/claim").json() for id in (skipped, verified)}
    mine = {"claim": claims[skipped]["claim"]}
    assert client.post(f"/layout/results/{skipped}/skip", json=mine).status_code == 204
    give(client, verified, {"class": "letter"})
    for id in (skipped, verified):
        path, ended = f"/layout/results/{id}", {"claim": claims[id]["claim"]}
        assert_problem(client.post(f"{path}/claim"), 409, "conflict")
        assert_problem(client.post(f"{path}/skip", json=ended), 409, "conflict")
        assert_problem(client.post(f"{path}/release", json=ended), 409, "conflict")
        assert client.post(f"{path}/claim", json={"reopen": True}).status_code == 200


def test_decisions_follow_the_feedback(client: httpx.Client) -> None:
    """After 700 zones that were right, pages as sure as those go through; a wrong one more and they do not."""
    first = client.get(f"/layout/results/{recognize(client)}").json()["decision"]
    assert (first["action"], first["reasons"][0]["code"]) == ("review", "no-evidence")
    assert first["tolerated_error"] == 0.01
    page = {
        "width": 20,
        "height": 400,
        "zones": [{"id": f"z{n}", "box": [1, n, 9, n + 1]} for n in range(350)],
    }
    for _ in range(2):
        result = client.post("/layout", json=None, data={"zones": httpx.Response(200, json=page).text}).json()
        assert give(client, result["id"], {"class": "letter"}).status_code == 200
    sure = client.get(f"/layout/results/{recognize(client)}").json()["decision"]
    assert (sure["action"], sure["reasons"]) == ("accept", [])
    bad = recognize(client)
    give(client, bad, {"labels": {"z1": "date", "z2": "sender"}})
    assert client.get(f"/layout/results/{recognize(client)}").json()["decision"]["action"] == "review"
    client.delete(f"/layout/results/{bad}/feedback")
    assert client.get(f"/layout/results/{recognize(client)}").json()["decision"]["action"] == "accept"


def test_a_key_sees_its_own_pages() -> None:
    with serving(api_keys="anna:a, ben:b, admin:c") as client:
        client.put("/layout/models/letter", json=LETTER, headers={"X-API-Key": "c"}).raise_for_status()
        client.headers["X-API-Key"] = "a"
        result = recognize(client)
        claim = client.post(f"/layout/results/{result}/claim").json()
        assert queue(client)[0]["claimed_by"] == "anna"
        client.headers["X-API-Key"] = "b"
        assert queue(client) == []
        assert_problem(
            client.post(f"/layout/results/{result}/claim", json={"claim": claim["claim"]}), 404, "not-found"
        )
        client.headers["X-API-Key"] = "c"
        assert [entry["id"] for entry in queue(client)] == [result]


def test_a_claimed_page_is_recognized_again_by_what_its_class_has_learned(client: httpx.Client) -> None:
    teaching, other = recognize(client), recognize(client)
    before = client.get(f"/layout/results/{other}").json()
    claim = client.post(f"/layout/results/{other}/claim", json={"recognize": True}).json()
    assert claim["recognized_again"] is False  # no model has learned
    give(client, teaching, {"class": "letter"})
    renewed = {"claim": claim["claim"]}
    assert client.post(f"/layout/results/{other}/claim", json=renewed).json()["recognized_again"] is False
    assert client.get(f"/layout/results/{other}").json() == before
    asked = {**renewed, "recognize": True}
    assert client.post(f"/layout/results/{other}/claim", json=asked).json()["recognized_again"] is True
    after = client.get(f"/layout/results/{other}").json()
    assert [before["class"]["model_version"], after["class"]["model_version"]] == [1, 2]
    assert [zone["confidence"] for zone in after["zones"]] == pytest.approx([0.91, 0.91])
    assert queue(client)[0]["gain"] == pytest.approx(2 - 2 * 0.75 * 0.91)
    give(client, other, {"class": "letter"})
    assert_problem(client.post(f"/layout/results/{other}/claim", json=asked), 409, "conflict")
    reopened = {"recognize": True, "reopen": True}
    assert client.post(f"/layout/results/{other}/claim", json=reopened).json()["recognized_again"] is False


def test_a_page_of_a_document_is_recognized_again_as_one_of_its_document(client: httpx.Client) -> None:
    whole = client.post("/layout", files={"image": upload("pages-2")}).json()
    page = whole["pages"][1]
    assert page["document_class"] is not None
    give(client, recognize(client), {"class": "letter"})
    asked = {"recognize": True}
    assert client.post(f"/layout/results/{page['id']}/claim", json=asked).json()["recognized_again"] is True
    after = client.get(f"/layout/results/{page['id']}").json()
    for name in ("document_class", "part", "file_name"):
        assert after[name] == page[name] is not None
    assert after["unknown_probability"] == 0.0625


def test_the_queue_is_put_in_order_when_a_class_has_learned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.review.order.EVERY_S", 0.02)
    with serving(review_ahead=2) as client:
        client.put("/layout/models/letter", json=LETTER).raise_for_status()
        pages = [recognize(client) for _ in range(4)]
        shown = client.get(f"/layout/results/{pages[1]}").json()
        give(client, pages[0], {"class": "letter"})
        sure = round(2 - 2 * 0.75 * 0.91, 4)
        deadline = time.monotonic() + 20
        while {entry["gain"] for entry in queue(client)} != {sure} and time.monotonic() < deadline:
            time.sleep(0.02)
        # The first two were followed by the third, whose gain was the largest then.
        assert [entry["gain"] for entry in queue(client)] == [sure] * 3
        assert client.get(f"/layout/results/{pages[1]}").json() == shown
