"""DELETE /layout/results/{id}/feedback with the real operations: the models are as if the feedback had never come."""

import json
import random
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from services.contract.operations import Operations
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

CLOSE = 1e-9
LEARNERS = ["passive-aggressive", "counting", "error-correction"]
KINDS = {
    "letter": {"sender": (100, 80, 700, 50), "date": (900, 330, 400, 40), "body": (100, 700, 1100, 800)},
    "memo": {"title": (400, 120, 500, 90), "subject": (100, 400, 800, 50), "body": (100, 560, 1100, 400)},
}
"""Where the zones of a class usually are: left, top, width, height on a page of 1300 x 1800 pixels."""


def page(kind: str, seed: int) -> dict[str, Any]:
    """A labelled page of a class; its zones vary."""
    chance = random.Random(f"{kind} {seed}")
    zones = []
    for number, (label, (left, top, width, height)) in enumerate(KINDS[kind].items(), 1):
        x, y = left + chance.uniform(-40, 40), top + chance.uniform(-40, 40)
        w, h = width * chance.uniform(0.7, 1.05), height * chance.uniform(0.8, 1.2)
        box = [round(x, 1), round(y, 1), round(x + w, 1), round(y + h, 1)]
        size = round(chance.uniform(20, 30), 1)
        zones.append({"id": f"z{number}", "box": box, "label": label, "font_size": size, "lines": 1 + number})
    return {"width": 1300, "height": 1800, "zones": zones}


@pytest.fixture(scope="module")
def service() -> Iterator[httpx.Client]:
    with serving(Operations(), workers=1, worker_memory_bytes=0, job_timeout_s=60.0) as client:
        client.timeout = httpx.Timeout(60.0)
        yield client


@pytest.fixture
def client(service: httpx.Client, request: pytest.FixtureRequest) -> httpx.Client:
    """Two classes that were initialized from three pages each, with the learner of the test."""
    for name in KINDS:
        service.delete(f"/layout/models/{name}")
        for seed in range(3):
            assert service.post(f"/layout/models/{name}/samples", json=page(name, seed)).status_code == 201
        assert service.post(f"/layout/models/{name}/initialize").status_code == 200
        settings = {"learner": getattr(request, "param", LEARNERS[0])}
        assert service.patch(f"/layout/models/{name}/settings", json=settings).status_code == 200
    return service


def recognize(client: httpx.Client, sent: dict[str, Any], only: str = "letter") -> str:
    bare = {**sent, "zones": [{**zone, "label": None} for zone in sent["zones"]]}
    response = client.post("/layout", data={"zones": json.dumps(bare), "models": only})
    assert response.status_code == 200, response.text
    return str(response.json()["id"])


def teach(client: httpx.Client, result: str, verified: str, labels: dict[str, str | None]) -> dict[str, Any]:
    body = {"class": verified, "labels": labels}
    response = client.post(f"/layout/results/{result}/feedback", json=body)
    assert response.status_code == 200, response.text
    told: dict[str, Any] = response.json()
    return told


def undo(client: httpx.Client, result: str) -> dict[str, Any]:
    response = client.delete(f"/layout/results/{result}/feedback")
    assert response.status_code == 200, response.text
    told: dict[str, Any] = response.json()
    return told


def models(client: httpx.Client) -> dict[str, Any]:
    return {name: client.get(f"/layout/models/{name}").json() for name in KINDS}


def samples(client: httpx.Client, name: str = "letter") -> int:
    return len(client.get(f"/layout/models/{name}/samples").json()["samples"])


def difference(first: Any, second: Any) -> float:
    """Largest difference of two documents in a number; infinite where they differ in anything else."""
    if isinstance(first, dict) and isinstance(second, dict) and first.keys() == second.keys():
        return max((difference(first[key], second[key]) for key in first), default=0.0)
    if isinstance(first, list) and isinstance(second, list) and len(first) == len(second):
        return max(map(difference, first, second), default=0.0)
    if isinstance(first, int | float) and isinstance(second, int | float):
        return abs(first - second)
    return 0.0 if first == second else float("inf")


SWAPPED: dict[str, str | None] = {"z1": "date", "z2": "sender", "z3": "body"}
USUAL: dict[str, str | None] = {"z1": "sender", "z2": "date", "z3": "body"}
NEW: dict[str, str | None] = {"z1": "letterhead", "z2": "date", "z3": None}


@pytest.mark.parametrize("client", LEARNERS, indirect=True)
def test_after_undo_every_learner_is_where_it_was(client: httpx.Client) -> None:
    before = models(client)
    first, second = (recognize(client, page("letter", seed)) for seed in (10, 11))
    teach(client, first, "letter", NEW)
    teach(client, second, "memo", {"z1": "title", "z2": "subject", "z3": "body"})
    assert min(difference(before[name], models(client)[name]) for name in KINDS) > 1e-3
    assert [told["name"] for told in undo(client, second)["models"]] == ["letter", "memo"]
    told = undo(client, first)
    assert (told["samples"], len(told["feedback"])) == (1, 1)
    assert difference(before, models(client)) <= CLOSE
    assert (samples(client), samples(client, "memo")) == (3, 3)


@pytest.mark.parametrize("client", LEARNERS, indirect=True)
def without_effect(client: httpx.Client) -> list[tuple[str, str | None]]:
    """Of the feedback on letters, newest first: the result, and why the model does not contain it."""
    listed = client.get("/layout/models/letter/feedback").json()["feedback"]
    return [
        (each["result"], model["without_effect"])
        for each in listed
        for model in each["models"]
        if model["name"] == "letter"
    ]


def test_the_list_says_which_feedback_a_later_one_replaced(client: httpx.Client) -> None:
    result, other = (recognize(client, page("letter", seed)) for seed in (10, 11))
    teach(client, result, "letter", NEW)
    teach(client, other, "letter", USUAL)
    assert without_effect(client) == [(other, None), (result, None)]
    teach(client, result, "letter", USUAL)
    assert without_effect(client) == [(result, None), (other, None), (result, "replaced")]


def test_feedback_in_between_keeps_its_lessons(client: httpx.Client) -> None:
    """The outcome equals that of the other feedback alone, of both classes and in the same order."""
    lessons = [
        (12, "letter", USUAL),
        (13, "memo", {"z1": "title", "z2": None, "z3": "body"}),
        (14, "letter", NEW),
    ]
    wrong = recognize(client, page("letter", 10))
    teach(client, wrong, "memo", {"z1": "title", "z2": "subject", "z3": None})
    results = []
    for seed, verified, labels in lessons:
        results.append(recognize(client, page("letter", seed)))
        teach(client, results[-1], verified, labels)
    undo(client, wrong)
    without = models(client)
    for result in results:  # in the order of teaching: each leaves others behind it
        undo(client, result)
    for seed, verified, labels in lessons:
        teach(client, recognize(client, page("letter", seed)), verified, labels)
    assert difference(models(client), without) <= CLOSE


def test_undo_in_any_order_leaves_nothing(client: httpx.Client) -> None:
    before = models(client)
    results = [recognize(client, page("letter", seed)) for seed in range(20, 24)]
    for result, labels in zip(results, (USUAL, SWAPPED, NEW, USUAL), strict=True):
        teach(client, result, "letter", labels)
    for place in (1, 3, 0, 2):
        undo(client, results[place])
    assert difference(before, models(client)) <= CLOSE
    assert samples(client) == 3


def test_undo_goes_through_training_and_initialization(client: httpx.Client) -> None:
    before = models(client)["letter"]
    result = recognize(client, page("letter", 10))
    teach(client, result, "letter", SWAPPED)
    assert client.post("/layout/models/letter/initialize").json()["samples"] == 4
    undo(client, result)
    assert difference(before, models(client)["letter"]) <= CLOSE
    assert client.post("/layout/models/letter/train", json={"rounds": 2}).json()["samples"] == 3
    trained = models(client)["letter"]
    client.post("/layout/models/letter/rollback", json={"version": 1})
    teach(client, result, "letter", SWAPPED)
    client.post("/layout/models/letter/train", json={"rounds": 2})
    undo(client, result)
    assert difference(trained, models(client)["letter"]) <= CLOSE


def test_a_class_corrected_again_takes_the_other_lesson_back(client: httpx.Client) -> None:
    before = models(client)
    result, direct = (recognize(client, page("letter", 10)) for _ in range(2))
    teach(client, result, "memo", {"z1": "title", "z2": "subject", "z3": "body"})
    told = teach(client, result, "letter", USUAL)
    assert {each["name"] for each in told["taken_back"]} == {"letter", "memo"}
    after = models(client)
    assert difference(before["memo"], after["memo"]) <= CLOSE
    undo(client, result)
    teach(client, direct, "letter", USUAL)
    assert difference(after, models(client)) <= CLOSE


def test_a_first_version_goes_with_its_only_page(client: httpx.Client) -> None:
    client.delete("/layout/models/memo")
    sample = client.post("/layout/models/memo/samples", json=page("memo", 0)).json()["id"]
    result = recognize(client, page("memo", 10))
    labels = {"z1": "title", "z2": "subject", "z3": "body"}
    told = teach(client, result, "memo", labels)
    assert next(each for each in told["models"] if each["name"] == "memo")["old_version"] is None
    client.delete(f"/layout/models/memo/samples/{sample}")
    undone = {each["name"]: each["new_version"] for each in undo(client, result)["models"]}
    assert undone["memo"] is None
    assert client.get("/layout/models/memo").status_code == 404
    assert samples(client, "memo") == 0


def test_new_labels_rollback_and_what_cannot_be_undone(client: httpx.Client) -> None:
    result, later = (recognize(client, page("letter", seed)) for seed in (10, 11))
    told = teach(client, result, "letter", {**USUAL, "z1": "sendr"})
    [warning] = told["warnings"]
    assert (warning["code"], "'sender'" in warning["detail"]) == ("new-label", True)
    assert teach(client, result, "letter", {**USUAL, "z1": "sendr"})["warnings"] == [warning]
    teach(client, later, "letter", USUAL)
    assert client.get("/layout/models/letter").status_code == 200
    first = min(each["new_version"] for each in told["models"]) - 1
    rolled = client.post("/layout/models/letter/rollback", json={"version": first}).json()
    assert (rolled["samples"], len(rolled["later_samples"]), rolled["dropped_samples"]) == (5, 2, 0)
    again = teach(client, later, "letter", USUAL)
    assert (again["created"], [each["code"] for each in again["warnings"]]) == (False, ["rolled-back"])
    assert [effect for _, effect in without_effect(client)] == ["rolled-back"] * 2
    assert undo(client, later)["models"] == []
    teach(client, later, "letter", USUAL)
    dropped = {"version": first, "drop_later_samples": True}
    assert client.post("/layout/models/letter/rollback", json=dropped).json()["dropped_samples"] == 2
    assert samples(client) == 3
    # The page of a later feedback is deleted: the earlier one cannot be taken back exactly.
    early, late = (recognize(client, page("letter", seed)) for seed in (30, 31))
    teach(client, early, "letter", USUAL)
    sample = teach(client, late, "letter", USUAL)["sample"]
    client.delete(f"/layout/models/letter/samples/{sample}")
    problem = assert_problem(client.delete(f"/layout/results/{early}/feedback"), 409, "conflict")
    assert "rollback" in str(problem["detail"])
    assert undo(client, late)["models"][0]["name"] == "letter"
    assert undo(client, early)["samples"] == 1
    assert_problem(client.delete(f"/layout/results/{early}/feedback"), 404, "not-found")


def test_zones_of_a_person_replace_the_found_ones_and_teach(client: httpx.Client) -> None:
    sent = page("letter", 10)
    sent["zones"][2]["text"] = "one\ntwo\nthree\nfour"
    result = recognize(client, sent)
    found = client.get(f"/layout/results/{result}").json()
    left, top, right, bottom = sent["zones"][2]["box"]
    middle = (top + bottom) / 2
    body = {
        "class": "letter",
        "zones": [
            {"id": "z1", "box": sent["zones"][0]["box"], "label": "sender"},
            {"box": [left, top, right, middle], "label": "body"},
            {"box": [left, middle, right, bottom], "label": "body"},
        ],
    }
    response = client.post(f"/layout/results/{result}/feedback", json=body)
    assert response.status_code == 200, response.text
    assert response.json()["zones"] == 4, "these, and one with a label that was left out"
    shown = client.get(f"/layout/results/{result}").json()["zones"]
    assert [(each["id"], each["label"], each["text"]) for each in shown] == [
        ("z1", "sender", ""),
        ("n1", "body", "one\ntwo"),
        ("n2", "body", "three\nfour"),
    ]
    assert shown[1]["font_size"] == pytest.approx(sent["zones"][2]["font_size"])
    sample = client.get(f"/layout/models/letter/samples/{response.json()['sample']}").json()
    assert [zone["box"] for zone in sample["zones"]] == [each["box"] for each in shown]
    undo(client, result)
    assert client.get(f"/layout/results/{result}").json() == found
    bad = {"zones": [{"box": [0, 0, 0, 5], "label": "body"}]}
    problem = assert_problem(
        client.post(f"/layout/results/{result}/feedback", json=bad), 422, "invalid-option"
    )
    assert problem["field"] == "zones[0].box"


def test_texts_of_a_person_are_kept_and_measured(client: httpx.Client) -> None:
    sent = page("letter", 10)
    sent["zones"][0]["text"] = "Marcb 3, 199B"
    result = recognize(client, sent)
    client.patch("/layout/models/letter/settings", json={"fields": {"sender": {"type": "date"}}})
    found = client.get(f"/layout/results/{result}").json()
    body = {"class": "letter", "labels": {"z1": "sender"}, "texts": {"z1": "March 3, 1998"}}
    response = client.post(f"/layout/results/{result}/feedback", json=body)
    assert response.status_code == 200, response.text
    assert response.json()["texts"] == [
        {"zone": "z1", "found": "Marcb 3, 199B", "verified": "March 3, 1998", "edits": 2}
    ]
    shown = client.get(f"/layout/results/{result}").json()
    assert shown["zones"][0]["text"] == "March 3, 1998"
    [field] = [field for field in shown["fields"] if field["label"] == "sender"]
    assert (field["value"], field["confidence"]) == ("1998-03-03", 1.0)
    sample = client.get(f"/layout/models/letter/samples/{response.json()['sample']}").json()
    assert sample["zones"][0]["text"] == "March 3, 1998"
    health = client.get("/layout/models/letter/health").json()
    assert health["recent_text_error"] == pytest.approx(2 / 13, abs=1e-4)
    undo(client, result)
    assert client.get(f"/layout/results/{result}").json() == found
    assert client.get("/layout/models/letter/health").json()["recent_text_error"] is None
    for wrong, field_name in (({"texts": {"z99": "a"}}, "texts.z99"), ({"texts": {"z1": ""}}, "texts.z1")):
        response = client.post(f"/layout/results/{result}/feedback", json={"class": "letter", **wrong})
        assert assert_problem(response, 422, "invalid-option")["field"] == field_name
