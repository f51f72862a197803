"""Every bad request gets a problem with a code, the field, and a sentence that says what to do."""

from collections.abc import Iterator

import httpx
import pytest

from tests.app.bad_requests import LATER, LAYOUT, MOSAIC, PHOTO, RECTIFY, Bad, other
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

MODEL = "/layout/models/letter"
RESULT = "/layout/results/{result}"
JSON = {"Content-Type": "application/json"}

MODELS = [
    other("an unknown model", "GET /layout/models/nobody", None, "nobody", 404),
    other("no name of a model", "GET /layout/models/.hidden", "name", "letters, digits"),
    other("no cursor", "GET /layout/models?cursor=a/b", "cursor", "expected the cursor of the header `Link`"),
    other("version 0", f"GET {MODEL}?version=0", "version", "greater than or equal to 1"),
    other("a version that does not exist", f"GET {MODEL}?version=99", None, "99", 404),
    other("a version twice", f"GET {MODEL}?version=1&version=2", "version", "sent 2 times; send it once"),
    other("an unknown query option", f"GET {MODEL}?revision=1", "revision",
        "query options of this path are: version"),
    other("a query option where there is none", "GET /layout/models?name=letter", "name", "query option"),
    other("a model that is no JSON", f"PUT {MODEL}", None, "JSON", 422, "invalid-model", content=b"{"),
    other("a model that is none", f"PUT {MODEL}", "format", "not a layout model", 422, "invalid-model", json={}),
    other("an old version", f"PUT {MODEL}", None, 'If-Match: "3"', 412, json=model_document("letter"),
        headers={"If-Match": '"1"'}),
    other("a tag without meaning", f"PUT {MODEL}", None, "send its ETag", 412, json=model_document("letter"),
        headers={"If-Match": "newest"}),
    other("a version as If-None-Match", f"PUT {MODEL}", "If-None-Match", "send * or omit",
        json=model_document("letter"), headers={"If-None-Match": '"1"'}),
    other("deletion of an unknown model", "DELETE /layout/models/nobody", None, "nobody", 404),
    other("deletion of an old version", f"DELETE {MODEL}", None, "Read the model again", 412,
        headers={"If-Match": '"1"'}),
    other("initialization with options", f"POST {MODEL}/initialize", "body", "without a body",
        content=b'{"rounds": 3}'),
    other("initialization of an unknown model", "POST /layout/models/nobody/initialize", None, "nobody", 404),
    other("initialization without samples", "POST /layout/models/empty/initialize", None, "Add one with POST",
        422, "no-samples"),
    other("initialization of an old version", f"POST {MODEL}/initialize", None, "send its ETag", 412,
        headers={"If-Match": "7"}),
    other("a key too long for a job", f"POST {MODEL}/initialize", "Idempotency-Key", "1 to 200 characters",
        headers={"Idempotency-Key": "k" * 201, "If-Match": "7"}),
    other("no round", f"POST {MODEL}/train", "rounds", "greater than or equal to 1", json={"rounds": 0}),
    other("too many rounds", f"POST {MODEL}/train", "rounds", "less than or equal to 100", json={"rounds": 101}),
    other("rounds as text", f"POST {MODEL}/train", "rounds", "integer", json={"rounds": "3"}),
    other("an unknown option of training", f"POST {MODEL}/train", "epochs", "no such option", json={"epochs": 3}),
    other("rounds twice", f"POST {MODEL}/train", "rounds", "twice in one object; send it once",
        content=b'{"rounds": 3, "rounds": 5}'),
    other("training of an unknown model", "POST /layout/models/nobody/train", None, "nobody", 404),
    other("rollback to nothing", f"POST {MODEL}/rollback", "version", "missing", json={}),
    other("rollback to a version in words", f"POST {MODEL}/rollback", "version", "integer", json={"version": "1"}),
    other("rollback to a version that does not exist", f"POST {MODEL}/rollback", None, "99", 404,
        json={"version": 99}),
    other("rollback without a body", f"POST {MODEL}/rollback", "body", "not valid JSON"),
    other("difference of version 0", f"GET {MODEL}/versions/0/diff", "version", "greater than or equal to 1"),
    other("difference against nothing", f"GET {MODEL}/versions/2/diff?against=x", "against", "integer"),
    other("too many changes", f"GET {MODEL}/versions/2/diff?limit=1001", "limit", "less than or equal to 1000"),
    other("difference of the first version", f"GET {MODEL}/versions/1/diff", None, "`against`", 404),
    other("an unknown learner", f"PATCH {MODEL}/settings", "learner", "'counting'", json={"learner": "best"}),
    other("an unknown setting", f"PATCH {MODEL}/settings", "speed", "no such option", json={"speed": 3}),
    other("settings that are a list", f"PATCH {MODEL}/settings", "body", "object", json=[1]),
    other("a class that continues itself", f"PATCH {MODEL}/settings", "continues", "continue itself", 409,
        json={"continues": "letter"}),
    other("too many feedbacks", f"GET {MODEL}/feedback?limit=1001", "limit", "less than or equal to 1000"),
]  # fmt: skip
SAMPLES = [
    other("neither JSON nor a form", f"POST {MODEL}/samples", None, "application/json", 400, content=b"x"),
    other("an unknown part", f"POST {MODEL}/samples", "photo", "send the page as `image`", files={"photo": PHOTO}),
    other("no zones", f"POST {MODEL}/samples", "zones", "labelled zones as JSON", 400, files={"image": PHOTO}),
    other("zones twice", f"POST {MODEL}/samples", "zones", "send it once", files={"image": PHOTO},
        data={"zones": ["{}", "{}"]}),
    other("zones that are no JSON", f"POST {MODEL}/samples", "zones", "not JSON", content=b"{", headers=JSON),
    other("a page without zones", f"POST {MODEL}/samples", "zones", "at least 1 item",
        json={"width": 1, "height": 1, "zones": []}),
    other("a bad image of a sample", f"POST {MODEL}/samples", "image", "scripted", 422, "undecodable-image",
        files={"image": ("a.jpg", upload("undecodable-image")), "zones": ("z.json", b"{}")}),
    other("an empty key", f"POST {MODEL}/samples", "Idempotency-Key", "at least 1 character", json=PAGE,
        headers={"Idempotency-Key": ""}),
    other("an unknown sample", f"GET {MODEL}/samples/1", None, "1", 404),
    other("deletion of an unknown sample", f"DELETE {MODEL}/samples/1", None, "1", 404),
]  # fmt: skip
RESULTS = [
    other("an unknown result", "GET /layout/results/1", None, "1", 404),
    other("a result as TIFF", f"GET {RESULT}", None, "application/json", 406, headers={"Accept": "image/tiff"}),
    other("a result in another format", f"GET {RESULT}?format=gif", "format", "'pagexml'"),
    other("a result changed", f"PUT {RESULT}", None, "`Allow`", 405, json={}),
    other("feedback that is no JSON", f"POST {RESULT}/feedback", "body", "not valid JSON", content=b"{"),
    other("feedback that is a list", f"POST {RESULT}/feedback", "body", "object", json=[]),
    other("feedback of an unknown field", f"POST {RESULT}/feedback", "label", "no such option", json={"label": {}}),
    other("feedback with a class twice", f"POST {RESULT}/feedback", "class", "send it once",
        content=b'{"class": "letter", "class": "memo"}'),
    other("labels in a list", f"POST {RESULT}/feedback", "labels", "object", json={"labels": ["sender"]}),
    other("a label of an unknown zone", f"POST {RESULT}/feedback", "labels.z9", "ids in `zones`",
        json={"labels": {"z9": "sender"}}),
    other("a label that cannot be printed", f"POST {RESULT}/feedback", "labels.z1", "printable",
        json={"labels": {"z1": "\u0007"}}),
    other("a class that does not exist", f"POST {RESULT}/feedback", None, "first sample", 404,
        json={"class": "nobody"}),
    other("feedback on an unknown result", "POST /layout/results/1/feedback", None, "1", 404,
        json={"class": "letter"}),
    other("an unknown page", "GET /layout/unknown-pages/1", None, "1", 404),
    other("deletion of an unknown page", "DELETE /layout/unknown-pages/1", None, "1", 404),
    other("proposals with options", "POST /layout/proposals", "body", "without a body", json={"limit": 3}),
    other("an unknown job", "GET /jobs/1", None, "JOB_TTL_S", 404),
    other("events of an unknown job", "GET /jobs/1/events", None, "no job", 404),
    other("the result of an unknown job", "GET /jobs/1/result", None, "no job", 404),
    other("cancelling an unknown job", "DELETE /jobs/1", None, "no job", 404),
    other("a token without keys", "POST /tokens", None, "links need no token", 404),
    other("a path that does not exist", "GET /rectify/1", None, "no such resource", 404),
    other("a slash too many", "POST /rectify/", None, "no such resource", 404),
    other("a metric", "GET /metrics?name=jobs", "name", "no query options"),
]  # fmt: skip
ALL = [
    *(("rectify", bad) for bad in RECTIFY),
    *(("mosaic", bad) for bad in MOSAIC),
    *(("layout", bad) for bad in LAYOUT),
    *(("models", bad) for bad in MODELS),
    *(("samples", bad) for bad in SAMPLES),
    *(("results", bad) for bad in RESULTS),
]


@pytest.fixture(scope="module")
def service() -> Iterator[httpx.Client]:
    """A service with a model of two versions, a class without samples, and a result."""
    with serving(workers=2) as client:
        for _ in range(2):
            client.put(MODEL, json=model_document("letter", "sender")).raise_for_status()
        client.put("/layout/models/empty", json=model_document("empty", "sender")).raise_for_status()
        yield client


@pytest.fixture(scope="module")
def result(service: httpx.Client) -> str:
    """Id of a result."""
    response = service.post("/layout", files={"image": PHOTO}, data={"models": "letter"})
    return str(response.json()["id"])


@pytest.mark.parametrize("bad", [bad for _, bad in ALL], ids=[f"{where}: {bad.name}" for where, bad in ALL])
def test_a_bad_request_says_what_to_do(service: httpx.Client, result: str, bad: Bad) -> None:
    response = service.request(bad.method, bad.path.replace("{result}", result), **bad.send)
    problem = assert_problem(response, bad.status, bad.code)
    assert problem.get("field") == bad.field
    detail = str(problem["detail"])
    assert bad.words in detail
    assert detail.endswith((".", "?"))
    assert len(detail) < 400


def test_there_are_more_than_a_hundred() -> None:
    assert len({(where, bad.name) for where, bad in ALL}) == len(ALL) >= 63 + 40


def test_a_key_that_came_with_another_photo(service: httpx.Client) -> None:
    headers = {**LATER, "Idempotency-Key": "one"}
    first = service.post("/rectify", files={"image": PHOTO}, headers=headers)
    assert first.status_code == 202
    other_photo = {"image": ("other.jpg", upload("") + b"other")}
    problem = assert_problem(service.post("/rectify", files=other_photo, headers=headers), 409, "conflict")
    assert "Send a new key" in str(problem["detail"])
