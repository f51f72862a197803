"""Training, rollback, comparison, settings and health of layout models."""

from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from app.learning import samples as model_samples
from models.errors import VersionConflict
from models.repository import Store
from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_layout_feedback import answer, give, recognize, version
from tests.app.test_layout_models import add_samples, labelled
from tests.app.test_problems import assert_problem

LETTER = model_document("letter", "sender", "date")
PATH = "/layout/models/letter"


@pytest.fixture
def client(empty_service: httpx.Client) -> httpx.Client:
    """A service with a model and a sample of it."""
    assert empty_service.put(PATH, json=LETTER).status_code == 201
    add_samples(empty_service, labelled("sender"))
    return empty_service


@pytest.fixture(scope="module")
def shared() -> Iterator[httpx.Client]:
    """The same, for requests that change nothing."""
    with serving() as client:
        client.put(PATH, json=LETTER)
        add_samples(client, labelled("subject"), name="fax")
        yield client


def origins(client: httpx.Client) -> list[tuple[str, str]]:
    versions = client.get(f"{PATH}/versions").json()["versions"]
    return [(each["origin"], each["note"]) for each in versions]


def test_training_makes_a_version(client: httpx.Client) -> None:
    response = client.post(f"{PATH}/train")
    assert (response.status_code, response.headers["etag"]) == (200, '"2"')
    assert response.json() == {
        "name": "letter",
        "version": 2,
        "changed": True,
        "samples": 1,
        "learner": "passive-aggressive",
        "rounds": [
            {"round": index, "error": round(1 / (index + 2), 4), "held_out_error": None} for index in range(4)
        ],
        "kept_round": 3,
        "stopped": "rounds",
    }
    client.patch(f"{PATH}/settings", json={"learner": "error-correction"})
    assert client.post(f"{PATH}/train", json={"rounds": 1.0}).json()["learner"] == "error-correction"
    assert client.get(PATH).json() == {**LETTER, "trained": [1, "error-correction"]}
    assert origins(client)[:2] == [
        ("train", "1 rounds, 1 samples, error-correction"),
        ("train", "3 rounds, 1 samples, passive-aggressive"),
    ]


def test_training_that_changes_nothing_makes_no_version(client: httpx.Client) -> None:
    add_samples(client, labelled("sender", text="do:learned"), name="letter")
    client.delete(f"{PATH}/samples/{client.get(f'{PATH}/samples').json()['samples'][0]['id']}")
    response = client.post(f"{PATH}/train", json={"rounds": 2})
    told = response.json()
    assert (told["version"], told["changed"], told["kept_round"]) == (1, False, 0)
    assert told["stopped"] == "held-out"
    assert response.headers["etag"] == '"1"'
    assert version(client) == 1


def test_what_cannot_be_trained(shared: httpx.Client) -> None:
    assert_problem(shared.post(f"{PATH}/train"), 422, "no-samples")
    assert_problem(shared.post("/layout/models/nothing/train"), 404, "not-found")
    problem = assert_problem(shared.post("/layout/models/fax/train"), 404, "not-found")
    assert "/layout/models/fax/initialize" in str(problem["detail"])


@pytest.mark.parametrize(
    ("path", "body", "field"),
    [
        ("train", b'{"rounds": 0}', "rounds"),
        ("train", b'{"rounds": 101}', "rounds"),
        ("train", b'{"rounds": "3"}', "rounds"),
        ("train", b'{"rounds": true}', "rounds"),
        ("train", b'{"rounds": 1.5}', "rounds"),
        ("train", b'{"rounds": null}', "rounds"),
        ("train", b'{"round": 3}', "round"),
        ("train", b"rounds=3", "body"),
        ("train", b"[3]", "body"),
        ("rollback", b"", "body"),
        ("rollback", b"{}", "version"),
        ("rollback", b'{"version": 0}', "version"),
        ("rollback", b'{"version": 2147483648}', "version"),
        ("rollback", b'{"version": "1"}', "version"),
    ],
)
def test_bad_bodies(shared: httpx.Client, path: str, body: bytes, field: str) -> None:
    problem = assert_problem(shared.post(f"{PATH}/{path}", content=body), 422, "invalid-option")
    assert problem["field"] == field
    assert version(shared) == 1


def test_training_has_the_time_limit_of_models() -> None:
    with serving(job_timeout_s=20, model_timeout_s=0.5) as client:
        client.put(PATH, json=LETTER)
        add_samples(client, labelled("sender", text="do:hang"))
        problem = assert_problem(client.post(f"{PATH}/train"), 504, "timed-out")
        assert "MODEL_TIMEOUT_S" in str(problem["detail"])
        assert version(client) == 1


def test_who_writes_may_say_what_they_saw(client: httpx.Client) -> None:
    for path, body in (("train", {"rounds": 1}), ("rollback", {"version": 1})):
        url = f"{PATH}/{path}"
        assert_problem(client.post(url, json=body, headers={"If-Match": '"9"'}), 412, "conflict")
    assert client.post(f"{PATH}/train", headers={"If-Match": '"1"'}).headers["etag"] == '"2"'
    response = client.post(f"{PATH}/rollback", json={"version": 1}, headers={"If-Match": '"2"'})
    assert response.headers["etag"] == '"3"'


def test_training_overwrites_no_feedback(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """A model that changes while it is trained is trained again, with what it has learned meanwhile."""
    add_version = Store.add_version
    news = ["news"]

    def slower(self: Store, *arguments: Any, **options: Any) -> Any:
        if news:
            add_version(self, "letter", {**LETTER, "news": news.pop()}, "import")
        return add_version(self, *arguments, **options)

    monkeypatch.setattr(Store, "add_version", slower)
    assert client.post(f"{PATH}/train").json()["version"] == 3
    assert client.get(PATH).json() == {**LETTER, "news": "news", "trained": [3, "passive-aggressive"]}
    news.append("stale")
    response = client.post(f"{PATH}/train", json={"rounds": 2}, headers={"If-Match": '"3"'})
    assert "version 4" in str(assert_problem(response, 412, "conflict")["detail"])

    def never(self: Store, *arguments: Any, **options: Any) -> Any:
        raise VersionConflict("scripted", 5)

    monkeypatch.setattr(Store, "add_version", never)
    assert_problem(client.post(f"{PATH}/train"), 409, "conflict")


def test_training_takes_as_many_samples_as_initialization(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_samples(client, labelled("date"))
    assert client.post(f"{PATH}/train").json()["samples"] == 2
    monkeypatch.setattr(model_samples, "MOST_ZONES", 1)
    assert client.post(f"{PATH}/train").json()["samples"] == 1


def test_the_way_back(client: httpx.Client) -> None:
    client.put(PATH, json=model_document("letter", "other"))
    response = client.post(f"{PATH}/rollback", json={"version": 1})
    assert (response.status_code, response.headers["etag"]) == (200, '"3"')
    [sample] = client.get(f"{PATH}/samples").json()["samples"]
    assert response.json() == {
        "name": "letter",
        "version": 3,
        "restored": 1,
        "labels": ["sender", "date"],
        "samples": 1,
        "later_samples": [sample["id"]],
        "dropped_samples": 0,
    }
    assert client.get(PATH).json() == LETTER
    assert origins(client)[0] == ("rollback", "version 1")
    assert_problem(client.post(f"{PATH}/rollback", json={"version": 4}), 404, "not-found")
    assert_problem(client.post("/layout/models/fax/rollback", json={"version": 1}), 404, "not-found")


def test_what_changed(client: httpx.Client) -> None:
    client.put(PATH, json={**LETTER, "a": 1})
    client.put(PATH, json={**LETTER, "a": 1, "b": 22})
    told = client.get(f"{PATH}/versions/3/diff").json()
    assert told == {
        "name": "letter",
        "version": 3,
        "against": 2,
        "total": 1,
        "changes": [{"part": "model", "labels": [None], "attribute": "b", "old": None, "new": 2.0}],
    }
    told = client.get(f"{PATH}/versions/3/diff?against=1&limit=1").json()
    assert (told["against"], told["total"], len(told["changes"])) == (1, 2, 1)
    told = client.get(f"{PATH}/versions/1/diff?against=3&limit=0").json()
    assert (told["against"], told["total"], told["changes"]) == (3, 2, [])
    assert client.get(f"{PATH}/versions/2/diff?against=2").json()["total"] == 0


def test_what_cannot_be_compared(shared: httpx.Client) -> None:
    problem = assert_problem(shared.get(f"{PATH}/versions/1/diff"), 404, "not-found")
    assert "against" in str(problem["detail"])
    for path in (f"{PATH}/versions/2/diff", f"{PATH}/versions/1/diff?against=7"):
        assert_problem(shared.get(path), 404, "not-found")
    for path, field in (
        ("versions/0/diff", "version"),
        ("versions/x/diff", "version"),
        ("versions/1/diff?against=0", "against"),
        ("versions/1/diff?limit=1001", "limit"),
    ):
        assert assert_problem(shared.get(f"{PATH}/{path}"), 422, "invalid-option")["field"] == field


def test_settings(client: httpx.Client) -> None:
    usual = {
        "learner": "passive-aggressive",
        "genre": None,
        "continues": None,
        "fields": {},
        "elements": {},
        "items": [],
    }
    assert client.get(f"{PATH}/settings").json() == usual
    add_samples(client, labelled("body"), name="fax")
    changed = client.patch(f"{PATH}/settings", json={"genre": "business", "continues": "fax"})
    assert changed.json() == {**usual, "genre": "business", "continues": "fax"}
    changed = client.patch(f"{PATH}/settings", json={"learner": "counting", "genre": None})
    assert changed.json() == {**usual, "learner": "counting", "continues": "fax"}
    assert client.get(f"{PATH}/settings").json() == changed.json()
    changed = client.patch(f"{PATH}/settings", json={"learner": None, "continues": None})
    assert changed.json() == usual
    assert client.patch(f"{PATH}/settings", json={}).json() == usual
    assert version(client) == 1


def test_columns_of_items(client: httpx.Client) -> None:
    """They are replaced as a whole; the worker gets them when the model is initialized."""
    for items in (["description", "amount"], ["amount", "price"]):
        assert client.patch(f"{PATH}/settings", json={"items": items}).json()["items"] == items
        assert client.get(f"{PATH}/settings").json()["items"] == items
    for wrong in (["amount", "amount"], [""], ["x" * 61], [f"c{k}" for k in range(21)], "amount", [7]):
        answer = client.patch(f"{PATH}/settings", json={"items": wrong})
        assert str(assert_problem(answer, 422, "invalid-option")["field"]).startswith("items")
    assert client.patch(f"{PATH}/settings", json={"genre": "x"}).json()["items"] == ["amount", "price"]
    client.post(f"{PATH}/initialize").raise_for_status()
    labels = [node["label"] for node in client.get(PATH).json()["nodes"]]
    assert {"column amount", "column price"} <= set(labels)
    for none in (None, []):
        assert client.patch(f"{PATH}/settings", json={"items": none}).json()["items"] == []


def test_types_of_fields_change_label_by_label(client: httpx.Client) -> None:
    def change(fields: Any) -> Any:
        return client.patch(f"{PATH}/settings", json={"fields": fields}).json()["fields"]

    absent = {
        "pattern": None,
        "order": None,
        "languages": [],
        "region": None,
        "currency": None,
        "decimal": None,
    }
    date = {**absent, "type": "date", "order": "DMY", "languages": ["de"]}
    assert change({"date": {"type": "date", "order": "DMY", "languages": ["de"]}}) == {"date": date}
    number = {"type": "pattern", "pattern": "INV-([0-9]{4})"}
    assert change({"number": number}) == {"date": date, "number": {**absent, **number}}
    assert change({"date": None, "nothing": None}) == {"number": {**absent, **number}}
    assert client.get(f"{PATH}/settings").json()["fields"] == {"number": {**absent, **number}}
    assert change(None) == {}


@pytest.mark.parametrize(
    ("body", "status", "code", "field"),
    [
        ({"fields": {"a": {"type": "colour"}}}, 422, "invalid-option", "fields.a.type"),
        ({"fields": {"a": {"type": "date", "region": "US"}}}, 422, "invalid-option", "fields.a"),
        ({"fields": {"a": {"type": "postal-code"}}}, 422, "invalid-option", "fields.a"),
        ({"fields": {"a": {"type": "phone", "region": "us"}}}, 422, "invalid-option", "fields.a.region"),
        ({"fields": {"a": {"type": "pattern"}}}, 422, "invalid-option", "fields.a"),
        ({"fields": {"a": {"type": "pattern", "pattern": "(a*)*b"}}}, 422, "invalid-option", "fields.a"),
        ({"fields": {"": {"type": "date"}}}, 422, "invalid-option", "fields..[key]"),
        ({"learner": "magic"}, 422, "invalid-option", "learner"),
        ({"genre": "a b"}, 422, "invalid-option", "genre"),
        ({"genre": 1}, 422, "invalid-option", "genre"),
        ({"continues": "letter"}, 409, "conflict", "continues"),
        ({"continues": "nothing"}, 404, "not-found", None),
        ({"colour": "red"}, 422, "invalid-option", "colour"),
        ([], 422, "invalid-option", "body"),
        ({"genre": "x" * 70_000}, 413, "too-large", None),
    ],
)
def test_bad_settings(shared: httpx.Client, body: Any, status: int, code: str, field: str | None) -> None:
    before = shared.get(f"{PATH}/settings").json()
    problem = assert_problem(shared.patch(f"{PATH}/settings", json=body), status, code)
    assert problem.get("field") == field
    assert shared.get(f"{PATH}/settings").json() == before


def test_a_class_that_is_continued_continues_none(client: httpx.Client) -> None:
    for name in ("second", "third"):
        client.put(f"/layout/models/{name}", json=model_document(name))
    assert client.patch("/layout/models/second/settings", json={"continues": "letter"}).status_code == 200
    for name, first in (("third", "second"), ("letter", "third")):
        response = client.patch(f"/layout/models/{name}/settings", json={"continues": first})
        assert_problem(response, 409, "conflict")


def test_health_tells_of_feedback(client: httpx.Client) -> None:
    nothing = {
        "feedbacks": 0,
        "recent": 0,
        "recent_zone_error": None,
        "recent_class_error": None,
        "recent_text_error": None,
        "earlier_zone_error": None,
        "last_feedback": None,
    }
    assert client.get(f"{PATH}/health").json() == {**nothing, "name": "letter"}
    assert client.get("/layout/models").json()["models"][0]["health"] == nothing
    answer(give(client, recognize(client), {"labels": {"z1": "date"}}))
    answer(give(client, recognize(client), {"labels": {}}))
    health = client.get("/layout/models").json()["models"][0]["health"]
    assert (health["feedbacks"], health["recent"], health["recent_zone_error"]) == (2, 2, 0.25)
    assert (health["recent_class_error"], health["earlier_zone_error"]) == (0.0, None)
    assert health["last_feedback"] > "2020"
    assert client.get(f"{PATH}/health").json() == {**health, "name": "letter"}


def test_no_such_model_and_no_such_name(shared: httpx.Client) -> None:
    for name, status, code in (("nothing", 404, "not-found"), (".x", 422, "invalid-option")):
        path = f"/layout/models/{name}"
        for response in (
            shared.get(f"{path}/health"),
            shared.get(f"{path}/settings"),
            shared.get(f"{path}/feedback"),
            shared.get(f"{path}/versions/1/diff"),
            shared.patch(f"{path}/settings", json={"genre": "a"}),
            shared.post(f"{path}/train", json={"rounds": 1}),
            shared.post(f"{path}/rollback", json={"version": 1}),
        ):
            assert_problem(response, status, code)


def test_an_undo_trains_by_the_learner_of_that_time(client: httpx.Client) -> None:
    result = client.post("/layout", files={"image": upload("")}).json()["id"]
    client.post(f"/layout/results/{result}/feedback", json={"class": "letter"}).raise_for_status()
    client.patch(f"{PATH}/settings", json={"learner": "counting"}).raise_for_status()
    client.post(f"{PATH}/train", json={"rounds": 2}).raise_for_status()
    client.patch(f"{PATH}/settings", json={"learner": "error-correction"}).raise_for_status()
    client.delete(f"/layout/results/{result}/feedback").raise_for_status()
    document = client.get(PATH).json()
    assert "taught" not in document
    assert document["trained"] == [2, "counting"]
