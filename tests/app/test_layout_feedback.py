"""POST /layout/results/{id}/feedback: what a person says counts once, and nothing of it is lost."""

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.learning import feedback as feedback_learning
from app.storage.layout_store import DATABASE
from models.errors import VersionConflict
from models.records import ResultDraft
from models.repository import Store
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.serving import serving
from tests.app.test_layout_models import add_samples, labelled
from tests.app.test_problems import assert_problem

LETTER = model_document("letter", "sender", "date")
MEMO = model_document("memo", "title")
DEFAULT = "passive-aggressive"


@pytest.fixture
def client(empty_service: httpx.Client) -> httpx.Client:
    """A service that knows letters; it keeps what it learns in `data_dir`."""
    assert empty_service.put("/layout/models/letter", json=LETTER).status_code == 201
    return empty_service


def recognize(client: httpx.Client, models: str | None = None) -> str:
    """Id of the result of the scripted page; its first zone has the first label of the first model."""
    data = {"zones": json.dumps(PAGE)} | ({} if models is None else {"models": models})
    response = client.post("/layout", data=data)
    assert response.status_code == 200, response.text
    return str(response.json()["id"])


def give(client: httpx.Client, result: str, body: Any, key: str | None = None) -> httpx.Response:
    headers = {} if key is None else {"Idempotency-Key": key}
    return client.post(f"/layout/results/{result}/feedback", json=body, headers=headers)


def answer(response: httpx.Response) -> dict[str, Any]:
    assert response.status_code == 200, response.text
    told: dict[str, Any] = response.json()
    return told


def taught(client: httpx.Client, name: str = "letter") -> list[list[str | None]]:
    """What the scripted model has written down of its lessons."""
    lessons: list[list[str | None]] = client.get(f"/layout/models/{name}").json().get("taught", [])
    return lessons


def version(client: httpx.Client, name: str = "letter") -> int:
    return int(client.get(f"/layout/models/{name}").headers["etag"].strip('"'))


def unknown_pages(folder: Path) -> list[str]:
    with Store.open(folder / DATABASE) as store:
        return [page.result_id for page in store.each_unknown_page()]


def test_a_correction_makes_a_version_and_a_sample(client: httpx.Client) -> None:
    result = recognize(client)
    told = answer(give(client, result, {"class": "letter", "labels": {"z1": "date", "z2": None}}))
    assert told == {
        "id": told["id"],
        "result": result,
        "created": True,
        "class": {"found": "letter", "verified": "letter"},
        "zones": 2,
        "wrong": [{"zone": "z1", "found": "sender", "verified": "date"}],
        "texts": [],
        "models": [
            {
                "name": "letter",
                "old_version": 1,
                "new_version": 2,
                "cost_found": {"before": 1.0, "after": 2.0},
                "cost_verified": {"before": 1.5, "after": None},
            }
        ],
        "taken_back": [],
        "sample": told["sample"],
        "warnings": [],
    }
    assert taught(client) == [["date", None, DEFAULT]]
    sample = client.get(f"/layout/models/letter/samples/{told['sample']}").json()
    assert [zone["label"] for zone in sample["zones"]] == ["date", None]
    newest = client.get("/layout/models/letter/versions").json()["versions"][0]
    assert (newest["version"], newest["origin"], newest["note"]) == (2, "feedback", f"result {result}")


def test_what_is_left_out_was_right(client: httpx.Client) -> None:
    told = answer(give(client, recognize(client), {"labels": {}}))
    assert (told["class"], told["wrong"]) == ({"found": "letter", "verified": "letter"}, [])
    told = answer(give(client, recognize(client), {"class": "letter"}))
    assert (told["class"], told["wrong"]) == ({"found": "letter", "verified": "letter"}, [])
    told = answer(give(client, recognize(client), {"labels": {"z2": " date "}}))
    assert told["wrong"] == [{"zone": "z2", "found": None, "verified": "date"}]
    assert version(client) == 4


def test_the_same_key_and_the_same_body_count_once(client: httpx.Client) -> None:
    result = recognize(client)
    body = {"class": "letter", "labels": {"z1": "date", "z2": None}}
    first = answer(give(client, result, body, "key-1"))
    again = [
        give(client, result, body, "key-1"),
        give(client, result, {"labels": dict(reversed(body["labels"].items())), "class": "letter"}),  # type: ignore[attr-defined]
        give(client, result, body, "key-2"),
    ]
    assert all(answer(response) == {**first, "created": False} for response in again)
    problem = assert_problem(give(client, result, {"class": "letter"}, "key-1"), 409, "conflict")
    assert "Idempotency-Key" in str(problem["detail"])
    assert_problem(give(client, recognize(client), body, "key-1"), 409, "conflict")
    assert version(client) == 2
    assert answer(give(client, recognize(client), body))["created"]
    assert version(client) == 3


def test_a_repeated_feedback_outlives_its_result(client: httpx.Client, data_dir: Path) -> None:
    result = recognize(client)
    told = answer(give(client, result, {"class": "letter"}))
    with Store.open(data_dir / DATABASE) as store:
        store.purge_results(keep_newest=0)
    assert answer(give(client, result, {"class": "letter"})) == {**told, "created": False}
    assert_problem(give(client, result, {"labels": {}}), 404, "not-found")


def test_a_wrong_class_teaches_both_models(client: httpx.Client) -> None:
    client.put("/layout/models/memo", json=MEMO)
    client.patch("/layout/models/memo/settings", json={"learner": "counting"})
    told = answer(give(client, recognize(client, "letter"), {"class": "memo", "labels": {"z2": "title"}}))
    assert told["class"] == {"found": "letter", "verified": "memo"}
    assert [(m["name"], m["old_version"], m["new_version"]) for m in told["models"]] == [
        ("letter", 1, 2),
        ("memo", 1, 2),
    ]
    assert told["wrong"] == [
        {"zone": "z1", "found": "sender", "verified": None},
        {"zone": "z2", "found": None, "verified": "title"},
    ]
    assert taught(client) == [["title", DEFAULT]]
    assert taught(client, "memo") == [["title", "counting"]]
    assert client.get("/layout/models/letter/samples").json()["samples"] == []
    assert len(client.get("/layout/models/memo/samples").json()["samples"]) == 1


def test_a_class_with_samples_and_no_model_gets_its_first(client: httpx.Client) -> None:
    add_samples(client, labelled("subject"), name="fax")
    result = recognize(client)
    told = answer(give(client, result, {"class": "fax", "labels": {"z2": "body"}}))
    assert [(m["name"], m["old_version"], m["new_version"]) for m in told["models"]] == [
        ("fax", None, 1),
        ("letter", 1, 2),
    ]
    assert (told["models"][0]["cost_found"], told["models"][0]["cost_verified"]) == (None, None)
    assert client.get("/layout/models/fax").json() == model_document("fax", "subject", "body")
    assert len(client.get("/layout/models/fax/samples").json()["samples"]) == 2
    # Said otherwise, it is a lesson for the model that there is now, and the page is still one sample.
    told = answer(give(client, result, {"class": "fax", "labels": {"z2": "subject"}}))
    assert told["models"][0]["new_version"] == 2
    assert len(client.get("/layout/models/fax/samples").json()["samples"]) == 2


def test_a_page_of_no_class_is_refused_by_the_model_and_remembered(
    client: httpx.Client, data_dir: Path
) -> None:
    result = recognize(client)
    told = answer(give(client, result, {"class": None}))
    assert told["class"] == {"found": "letter", "verified": None}
    assert [(m["name"], m["new_version"]) for m in told["models"]] == [("letter", 2)]
    assert told["sample"] is None
    assert answer(give(client, result, {"class": None}))["created"] is False
    assert unknown_pages(data_dir) == [result]
    answer(give(client, result, {"class": "letter"}))  # after all
    assert unknown_pages(data_dir) == []


def test_a_page_without_zones_is_nothing_to_remember(client: httpx.Client, data_dir: Path) -> None:
    add_samples(client, labelled("title"), name="fax")
    [sample] = client.get("/layout/models/fax/samples").json()["samples"]
    client.delete(f"/layout/models/fax/samples/{sample['id']}")  # a class that nothing can be made of
    with Store.open(data_dir / DATABASE) as store:
        empty = {"page": {**PAGE, "zones": []}, "result": {"class": None, "zones": []}}
        result = store.add_result(empty, ttl_s=60.0)
    told = answer(give(client, result, {"class": None}))
    assert (told["zones"], unknown_pages(data_dir)) == (0, [])
    told = answer(give(client, result, {"class": "fax"}))
    assert (told["class"]["verified"], told["models"], told["sample"]) == ("fax", [], None)
    assert [each["code"] for each in told["warnings"]] == ["nothing-learned"]
    assert client.get("/layout/models/fax/samples").json()["samples"] == []


def test_a_result_without_a_class(client: httpx.Client, data_dir: Path) -> None:
    client.delete("/layout/models/letter")
    result = recognize(client)
    problem = assert_problem(give(client, result, {"labels": {"z1": "date"}}), 422, "invalid-option")
    assert problem["field"] == "class"
    told = answer(give(client, result, {"class": None}))
    assert (told["class"], told["models"]) == ({"found": None, "verified": None}, [])
    assert unknown_pages(data_dir) == [result]
    client.put("/layout/models/letter", json=LETTER)
    told = answer(give(client, result, {"class": "letter", "labels": {"z1": "date"}}))
    assert [(m["name"], m["old_version"], m["new_version"]) for m in told["models"]] == [("letter", 2, 3)]


def test_a_new_class_begins_with_the_page(client: httpx.Client) -> None:
    body = {"class": "circular", "new_class": True, "labels": {"z1": "title", "z2": None}}
    result = recognize(client)
    problem = assert_problem(give(client, result, {**body, "new_class": False}), 404, "not-found")
    assert "new_class" in str(problem["detail"])
    told = answer(give(client, result, body))
    assert told["class"] == {"found": "letter", "verified": "circular"}
    made = next(model for model in told["models"] if model["name"] == "circular")
    assert (made["old_version"], made["new_version"]) == (None, 1)
    [sample] = client.get("/layout/models/circular/samples").json()["samples"]
    assert sample["id"] == told["sample"]
    shown = client.get(f"/layout/results/{result}").json()
    assert (shown["class"]["name"], shown["found"]["class"]) == ("circular", "letter")
    [listed] = client.get("/layout/results", params={"state": "corrected"}).json()["results"]
    assert (listed["id"], listed["class"]) == (result, "circular")
    # There is such a class now: the next page teaches it.
    later = answer(give(client, recognize(client, "letter"), body))
    assert {model["name"]: model["new_version"] for model in later["models"]}["circular"] == 2
    undone = client.delete(f"/layout/results/{result}/feedback")
    assert undone.status_code == 200, undone.text
    for wrong, field in (
        ({"new_class": True, "labels": {"z1": "title"}}, "body"),
        ({"new_class": True, "class": None}, "body"),
        ({"new_class": True, "class": "other", "labels": {"z1": None, "z2": None}}, "labels"),
    ):
        problem = assert_problem(give(client, recognize(client), wrong), 422, "invalid-option")
        assert problem["field"] == field
    assert client.get("/layout/models/other").status_code == 404


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ({"lables": {}}, "did you mean `labels`?"),
        ({"klass": "letter"}, "did you mean `class`?"),
        ({"q": 1}, "The options are class, new_class, labels, texts, zones."),
        ({"zones": [{"box": [0, 0, 1, 1], "lable": "date"}]}, "did you mean `label`?"),
    ],
)
def test_names_that_are_nearly_right(shared: tuple[httpx.Client, str], body: Any, told: str) -> None:
    client, result = shared
    problem = assert_problem(give(client, result, body), 422, "invalid-option")
    assert str(problem["detail"]).endswith(told)


@pytest.mark.parametrize(
    ("body", "field"),
    [
        (b"", "body"),
        (b"{", "body"),
        (b"\xff", "body"),
        (b"[]", "body"),
        (b"null", "body"),
        (b"{}", "body"),
        (b"[" * 5000, "body"),
        (b'{"class": 1}', "class"),
        (b'{"class": ".hidden"}', "class"),
        (b'{"class": "a b"}', "class"),
        (b'{"labels": null}', "labels"),
        (b'{"labels": []}', "labels"),
        (b'{"labels": {"z1": 1}}', "labels.z1"),
        (b'{"labels": {"z1": ""}}', "labels.z1"),
        (b'{"labels": {"z1": "a\\u0000"}}', "labels.z1"),
        (b'{"labels": {"z1": "  "}}', "labels.z1"),
        (b'{"labels": {"z1": "' + b"x" * 61 + b'"}}', "labels.z1"),
        (b'{"labels": {"z9": "date"}}', "labels.z9"),
        (b'{"labels": {}, "klass": "letter"}', "klass"),
        (b'{"zones": [{"box": [0, 0, NaN, 9], "label": null}]}', "zones[0].box[2]"),
        (b'{"zones": [{"box": [0, 0, 9, 1e999], "label": null}]}', "zones[0].box[3]"),
    ],
)
def test_bad_bodies(shared: tuple[httpx.Client, str], body: bytes, field: str) -> None:
    client, result = shared
    response = client.post(f"/layout/results/{result}/feedback", content=body)
    assert assert_problem(response, 422, "invalid-option")["field"] == field
    assert version(client) == 1


@pytest.fixture(scope="module")
def shared() -> Iterator[tuple[httpx.Client, str]]:
    """A service and a result of it, for feedback that changes nothing."""
    with serving(max_zones_bytes=6000) as client:
        client.put("/layout/models/letter", json=LETTER)
        yield client, recognize(client)


def test_a_body_has_its_limit(shared: tuple[httpx.Client, str]) -> None:
    client, result = shared
    body = {"labels": {"z1": "x"}, "class": "y" * 6000}
    problem = assert_problem(give(client, result, body), 413, "too-large")
    assert "MAX_ZONES_BYTES" in str(problem["detail"])


def test_what_is_not_there(shared: tuple[httpx.Client, str]) -> None:
    client, result = shared
    for id_ in ("nothing", "01M7ZZQ4ZN38G37138FEXHE2T7"):
        assert_problem(give(client, id_, {"class": "letter"}), 404, "not-found")
    problem = assert_problem(give(client, result, {"class": "fax"}), 404, "not-found")
    assert "/layout/models/fax/samples" in str(problem["detail"])
    assert_problem(client.get("/layout/models/fax/feedback"), 404, "not-found")
    assert version(client) == 1


def test_a_document_of_several_pages_is_corrected_page_by_page(client: httpx.Client, data_dir: Path) -> None:
    with Store.open(data_dir / DATABASE) as store:
        found = [store.result(recognize(client)).document for _ in range(2)]
        document, pages = store.add_document({"document": {}}, list(map(ResultDraft, found)), 1000)
    problem = assert_problem(give(client, document, {"labels": {}}), 422, "invalid-option")
    assert problem["field"] == "id"
    assert ", ".join(pages) in str(problem["detail"])
    assert answer(give(client, pages[1], {"labels": {}}))["created"]


def test_a_key_must_be_one(shared: tuple[httpx.Client, str]) -> None:
    client, result = shared
    problem = assert_problem(give(client, result, {"labels": {}}, "k" * 201), 422, "invalid-option")
    assert problem["field"] == "Idempotency-Key"


@pytest.mark.parametrize(
    ("script", "status", "code"), [("do:segfault", 500, "worker-died"), ("do:fail", 500, "internal")]
)
def test_what_fails_leaves_nothing_half_written(
    client: httpx.Client, script: str, status: int, code: str
) -> None:
    result = recognize(client)
    assert_problem(give(client, result, {"labels": {"z1": script}}), status, code)
    assert version(client) == 1
    assert client.get("/layout/models/letter/samples").json()["samples"] == []
    assert client.get("/layout/models/letter/feedback").json()["feedback"] == []
    assert answer(give(client, result, {"labels": {"z1": "date"}}))["created"]


def test_a_deleted_class_stops_no_feedback(client: httpx.Client) -> None:
    client.put("/layout/models/memo", json=MEMO)
    result = recognize(client, "letter")
    client.delete("/layout/models/letter")
    assert_problem(give(client, result, {"labels": {"z1": "date"}}), 404, "not-found")
    told = answer(give(client, result, {"class": "memo"}))
    assert [m["name"] for m in told["models"]] == ["memo"]
    add_samples(client, labelled("sender"))  # there again, without a version
    told = answer(give(client, result, {"class": None}))
    assert told["models"] == []


def test_of_many_feedbacks_at_once_none_is_lost(client: httpx.Client) -> None:
    client.put("/layout/models/memo", json=MEMO)
    results = [recognize(client, "letter") for _ in range(24)]

    def post(index: int) -> dict[str, Any]:
        body = {"class": ("letter", "memo")[index % 2], "labels": {"z1": f"label {index}"}}
        return answer(give(client, results[index], body))

    with ThreadPoolExecutor(8) as threads:
        told = list(threads.map(post, range(24)))
    assert all(each["created"] for each in told)
    # The one that was found learned of all of them, the other one of its own.
    assert version(client) == 25
    assert version(client, "memo") == 13
    assert sorted(lesson[0] for lesson in taught(client)) == sorted(f"label {i}" for i in range(24))  # type: ignore[type-var]
    news = sorted(m["new_version"] for each in told for m in each["models"] if m["name"] == "letter")
    assert news == list(range(2, 26))


def test_another_process_may_be_faster(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    add_feedback = Store.add_feedback
    lessons = ["one", "two"]

    def slower(self: Store, *arguments: Any, **options: Any) -> Any:
        if lessons:
            self.add_version("letter", model_document("letter", lessons.pop()), "import")
        return add_feedback(self, *arguments, **options)

    monkeypatch.setattr(Store, "add_feedback", slower)
    told = answer(give(client, recognize(client), {"labels": {"z1": "date"}}))
    assert (told["models"][0]["old_version"], told["models"][0]["new_version"]) == (3, 4)
    model = client.get("/layout/models/letter").json()
    assert (model["nodes"][1]["label"], model["taught"]) == ("one", [["date", DEFAULT]])


def test_who_is_never_fast_enough_is_sent_away(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(self: Store, *arguments: Any, **options: Any) -> Any:
        raise VersionConflict("scripted", 1)

    monkeypatch.setattr(feedback_learning, "MOST_TRIES", 3)
    monkeypatch.setattr(Store, "add_feedback", never)
    response = give(client, recognize(client), {"labels": {"z1": "date"}})
    assert_problem(response, 503, "busy")
    assert int(response.headers["retry-after"]) >= 1


def test_the_wrong_class_may_be_deleted_while_it_learns(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    client.put("/layout/models/memo", json=MEMO)
    result = recognize(client, "letter")
    add_feedback = Store.add_feedback
    doomed = ["letter"]

    def meanwhile(self: Store, *arguments: Any, **options: Any) -> Any:
        if doomed:
            self.delete_model(doomed.pop())
        return add_feedback(self, *arguments, **options)

    monkeypatch.setattr(Store, "add_feedback", meanwhile)
    assert [m["name"] for m in answer(give(client, result, {"class": "memo"}))["models"]] == ["memo"]
    doomed.append("memo")
    late = give(client, result, {"class": "memo", "labels": {"z1": "title"}})
    assert "memo" in str(assert_problem(late, 404, "not-found")["detail"])


def test_a_drawn_zone_is_wrong_where_the_label_under_it_was(client: httpx.Client) -> None:
    result = recognize(client)
    first, second = client.get(f"/layout/results/{result}").json()["zones"]
    left, top, right, bottom = first["box"]
    halves = [[left, top, right, top + 3], [left, top + 3, right, bottom]]
    zones = [
        {"box": box, "label": label} for box, label in zip(halves, (first["label"], "date"), strict=True)
    ]
    told = answer(give(client, result, {"zones": [*zones, {"box": second["box"], "label": second["label"]}]}))
    assert [(each["found"], each["verified"]) for each in told["wrong"]] == [(first["label"], "date")]
    health = client.get("/layout/models/letter/health").json()
    assert health["recent_zone_error"] == pytest.approx(1 / 3, abs=1e-4)
    again = answer(give(client, result, {"class": "letter"}))  # what the result shows now
    assert [each["zone"] for each in again["wrong"]] == [each["zone"] for each in told["wrong"]]


def test_a_labelled_zone_that_is_left_out_was_wrong(client: httpx.Client) -> None:
    result = recognize(client)
    first, second = client.get(f"/layout/results/{result}").json()["zones"]
    told = answer(give(client, result, {"zones": [{"box": second["box"], "label": second["label"]}]}))
    assert second["label"] is None
    assert told["wrong"] == [{"zone": first["id"], "found": first["label"], "verified": None}]
    health = client.get("/layout/models/letter/health").json()
    assert health["recent_zone_error"] == pytest.approx(1 / 2)
    one = [min(first["box"][0], second["box"][0]), min(first["box"][1], second["box"][1])]
    one += [max(first["box"][2], second["box"][2]), max(first["box"][3], second["box"][3])]
    told = answer(give(client, result, {"zones": [{"box": one, "label": first["label"]}]}))
    assert told["wrong"] == []  # joined with another zone: nothing lies there without a label


def test_the_history_of_a_model(client: httpx.Client) -> None:
    client.put("/layout/models/memo", json=MEMO)
    results = [recognize(client, "letter") for _ in range(3)]
    give(client, results[0], {"labels": {"z1": "date"}})
    give(client, results[1], {"class": "memo"})
    give(client, results[2], {"class": "letter"})
    told = client.get("/layout/models/letter/feedback").json()
    assert told["model"] == "letter"
    assert [(entry["result"], entry["class"]["verified"], entry["wrong"]) for entry in told["feedback"]] == [
        (results[2], "letter", 0),
        (results[1], "memo", 1),
        (results[0], "letter", 1),
    ]
    assert told["feedback"][1]["models"] == [
        {"name": "letter", "old_version": 2, "new_version": 3, "without_effect": None},
        {"name": "memo", "old_version": 1, "new_version": 2, "without_effect": None},
    ]
    assert list(told["feedback"][0]) == [
        "id", "result", "class", "zones", "wrong", "models", "sample", "created",
    ]  # fmt: skip
    assert len(client.get("/layout/models/letter/feedback?limit=2").json()["feedback"]) == 2
    assert len(client.get("/layout/models/memo/feedback").json()["feedback"]) == 1
    for limit in (0, 1001):
        assert_problem(client.get(f"/layout/models/letter/feedback?limit={limit}"), 422, "invalid-option")
