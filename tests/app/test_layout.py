"""POST /layout and what is kept of it: parts and options in, representations out."""

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import httpx
import pytest

from app.schemas.layout import parse_names
from services.contract.answers.layout import LayoutResult
from services.contract.layout import LayoutReply
from tests.app.pools import named
from tests.app.raw import connect, form, head, read_answer
from tests.app.scripted import OPERATIONS
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_health import sample
from tests.app.test_jobs import until
from tests.app.test_problems import assert_problem
from tests.app.test_uploads import code, until_sample

ZONES = json.dumps(PAGE)


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    """A service with two models, and a class that has a sample only."""
    with serving(workers=2) as client:
        for name, label in (("letter", "sender"), ("memo", "subject")):
            client.put(f"/layout/models/{name}", json=model_document(name, label)).raise_for_status()
        client.post("/layout/models/fax/samples", json=PAGE).raise_for_status()
        yield client


def post(
    client: httpx.Client, data: dict[str, str] | None = None, accept: str = "*/*", **files: bytes
) -> httpx.Response:
    parts = {name: ("page.png", content) for name, content in files.items()}
    return client.post("/layout", files=parts or None, data=data, headers={"Accept": accept})


def notices(response: httpx.Response) -> dict[str, str]:
    assert response.status_code == 200, response.text
    return {notice["code"]: notice["detail"] for notice in response.json()["warnings"]}


def test_the_answer_is_the_contracts(client: httpx.Client) -> None:
    response = post(client, image=upload(""))
    assert response.headers["content-type"] == "application/json"
    answer: dict[str, Any] = response.json()
    assert list(answer) == [
        "id", "file_name", "width", "height", "class", "classes", "unknown_probability", "zones", "fields", "tables",
        "match", "part", "document_class", "language", "page", "orientation", "image", "decision", "warnings",
        "timings_ms",
    ]  # fmt: skip
    LayoutResult.model_validate(answer)
    assert answer["file_name"] == "page.png"
    assert answer["class"] == {"name": "letter", "model_version": 1, "cost": 1.5, "probability": 0.375}
    assert [match["name"] for match in answer["classes"]] == ["letter", "memo"]
    assert [zone["label"] for zone in answer["zones"]] == ["sender", None]


def test_the_headers_tell_the_essential_facts(client: httpx.Client) -> None:
    for name, media_type in (
        ("json", "application/json"),
        ("pagexml", "application/xml"),
        ("alto", "application/xml"),
        ("png", "image/png"),
        ("html", "text/html; charset=utf-8"),
    ):
        response = post(client, {"format": name}, image=upload(""))
        assert response.headers["content-type"] == media_type
        assert response.headers["document-class"] == "letter"
        assert response.headers["server-timing"] == "decode;dur=1.2, match;dur=2.0"
        assert response.headers["vary"] == "Accept"
        kept = client.get(response.headers["document-result"]).json()
        assert response.headers["document-result"] == f"/layout/results/{kept['id']}"
        assert kept["class"]["name"] == "letter"
        if name != "json":
            assert response.text == f"page as {name}"


def test_the_result_is_kept(client: httpx.Client) -> None:
    first, second = (post(client, image=upload("")).json() for _ in range(2))
    assert first["id"] != second["id"]
    for answer in (first, second):
        assert client.get(f"/layout/results/{answer['id']}").json() == answer


@pytest.mark.parametrize("result_id", ["01M7ZZQ4ZN38G37138FEXHE2T7", "x", "%00", "é", "1" * 300])
def test_no_such_result(client: httpx.Client, result_id: str) -> None:
    assert_problem(client.get(f"/layout/results/{result_id}"), 404, "not-found")


def test_without_any_model_class_is_null() -> None:
    with serving() as client:
        response = post(client, {"zones": ZONES})
        assert (response.json()["class"], response.json()["classes"], response.json()["match"]) == (
            None,
            [],
            None,
        )
        assert "document-class" not in response.headers


@pytest.mark.parametrize(
    ("data", "files", "parts"),
    [
        ({}, ["image"], [True, False, False]),
        ({"zones": ZONES}, [], [False, True, False]),
        ({"zones": ZONES}, ["image"], [True, True, False]),
        ({}, ["zones"], [False, True, False]),
        ({}, ["zones_file"], [False, False, True]),
        ({}, ["image", "zones_file"], [True, False, True]),
        ({"zones": ""}, ["image"], [True, False, False]),
    ],
)
def test_what_may_be_sent(
    client: httpx.Client, data: dict[str, str], files: list[str], parts: list[bool]
) -> None:
    contents = {name: ZONES.encode() if name == "zones" else upload("") for name in files}
    assert notices(post(client, data, **contents))["parts"] == str(parts)


def test_the_language_reaches_the_operation(client: httpx.Client) -> None:
    told = notices(post(client, {"language": "eng+fra"}, image=upload("")))["options"]
    assert "language='eng+fra'" in told
    assert "language=None" in notices(post(client, {"language": ""}, image=upload("")))["options"]
    for wrong in ("../eng", "eng+", "e", "eng fra"):
        problem = assert_problem(post(client, {"language": wrong}, image=upload("")), 422, "invalid-option")
        assert problem["field"] == "language"


def test_a_job_reads_in_its_language(client: httpx.Client) -> None:
    accepted = client.post(
        "/layout",
        files={"image": ("page.png", upload(""))},
        data={"language": "fra"},
        headers={"Prefer": "respond-async"},
    )
    assert accepted.status_code == 202
    assert until(client, accepted.headers["location"])["state"] == "succeeded"
    told = notices(client.get(f"{accepted.headers['location']}/result"))
    assert "language='fra'" in told["options"]


def test_an_operator_chooses_languages() -> None:
    with serving(ocr_languages="deu, eng") as client:
        told = notices(post(client, image=upload("")))
        assert "language='deu'" in told["options"]
        assert "language='deu'" in told["settings"], "samples are read as pages are"
        refused = assert_problem(
            post(client, {"language": "eng+fra"}, image=upload("")), 422, "invalid-option"
        )
        assert refused["detail"] == "language: fra is not read by this server; OCR_LANGUAGES has deu, eng."


def test_nothing_to_work_on(client: httpx.Client) -> None:
    for response in (
        client.post("/layout"),
        client.post("/layout", json=PAGE),
        post(client, {"ocr": "off"}),
        post(client, {"zones": "", "ocr": "off"}),
    ):
        assert assert_problem(response, 400, "bad-request")["field"] == "image"
    problem = assert_problem(client.post("/layout", data={"image": "no file"}), 400, "bad-request")
    assert problem["field"] == "image"
    problem = assert_problem(client.post("/layout", data={"zones_file": "no file"}), 400, "bad-request")
    assert problem["field"] == "zones_file"


@pytest.mark.parametrize(
    ("data", "files", "field"),
    [
        ({"zones": ZONES}, ["zones_file"], "zones_file"),
        ({"zones": ZONES, "rectify": "true"}, ["image"], "rectify"),
        ({"rectify": "true"}, ["zones_file"], "rectify"),
        ({"rectify": "perhaps"}, ["image"], "rectify"),
        ({"ocr": "on"}, ["image"], "ocr"),
        ({"format": "pdf"}, ["image"], "format"),
        ({"explain": "1"}, ["image"], "explain"),
        ({"models": ","}, ["image"], "models"),
        ({"models": "letter,,memo"}, ["image"], "models"),
        ({"models": "../letter"}, ["image"], "models"),
        ({"models": "fax"}, ["image"], "models"),
        ({"models": ",".join(["a"] * 201)}, ["image"], "models"),
        ({"quality": "90"}, ["image"], "quality"),
    ],
)
def test_a_bad_option_is_named(
    client: httpx.Client, data: dict[str, str], files: list[str], field: str
) -> None:
    problem = assert_problem(
        post(client, data, **{name: upload("") for name in files}), 422, "invalid-option"
    )
    assert problem["field"] == field
    assert str(problem["detail"]).startswith(f"{field}: ")


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({}, "rectify=False, ocr=True, format='json', explain=False, words=False, image_name='page.png'"),
        ({"rectify": "true"}, "rectify=True"),
        ({"ocr": "off"}, "ocr=False"),
        ({"explain": "true"}, "explain=True"),
        ({"words": "true"}, "words=True"),
    ],
)
def test_options_reach_the_operation(client: httpx.Client, data: dict[str, str], expected: str) -> None:
    assert expected in notices(post(client, data, image=upload("")))["options"]


@pytest.mark.parametrize(
    ("sent", "name"),
    [
        ("C:\\\\Scans\\\\Übung 1.PNG", "Übung 1.PNG"),
        ("/etc/passwd", "passwd"),
        ("a\u202eb\u202f1.png", "ab 1.png"),
        ("=1+1.png", "=1+1.png"),
        ("n" * 300, "n" * 200),
        ("folder/", None),
        ("\u200b", None),
    ],
)
def test_the_name_of_the_upload_is_kept(client: httpx.Client, sent: str, name: str | None) -> None:
    quoted = sent.replace("\\", "\\\\").encode()
    body = b'--edge\r\nContent-Disposition: form-data; name="image"; filename="' + quoted + b'"\r\n\r\n'
    headers = {"Content-Type": "multipart/form-data; boundary=edge"}
    response = client.post("/layout", content=body + upload("") + b"\r\n--edge--\r\n", headers=headers)
    assert response.status_code == 200, response.text
    answer = response.json()
    assert answer["file_name"] == name
    assert client.get(f"/layout/results/{answer['id']}").json()["file_name"] == name
    assert client.get("/layout/results?limit=1").json()["results"][0]["file_name"] == name
    assert f"image_name={(name or 'page')!r}" in notices(response)["options"]


def test_zones_have_no_file_name(client: httpx.Client) -> None:
    zones = json.dumps({"width": 100, "height": 100, "zones": [{"id": "a", "box": [10, 10, 20, 20]}]})
    assert post(client, {"zones": zones}).json()["file_name"] is None


@pytest.mark.parametrize(
    ("names", "competing"),
    [
        (None, [("letter", 1), ("memo", 1)]),
        ("memo", [("memo", 1)]),
        ("memo, letter,memo", [("memo", 1), ("letter", 1)]),
    ],
)
def test_which_models_compete(
    client: httpx.Client, names: str | None, competing: list[tuple[str, int]]
) -> None:
    data = {} if names is None else {"models": names}
    assert notices(post(client, data, image=upload("")))["models"] == str(competing)


def test_no_such_model(client: httpx.Client) -> None:
    problem = assert_problem(post(client, {"models": "letter,nope"}, image=upload("")), 404, "not-found")
    assert "nope" in str(problem["detail"])


@pytest.mark.parametrize(
    ("accept", "expected"),
    [
        ("application/json", "application/json"),
        ("application/xml", "application/xml"),
        ("image/png", "image/png"),
        ("image/*, application/json;q=0.5", "image/png"),
        ("text/html,application/xhtml+xml,*/*;q=0.8", "text/html; charset=utf-8"),
        ("", "application/json"),
    ],
)
def test_accept_chooses(client: httpx.Client, accept: str, expected: str) -> None:
    assert post(client, accept=accept, image=upload("")).headers["content-type"] == expected


def test_no_representation_fits(client: httpx.Client) -> None:
    problem = assert_problem(post(client, accept="text/csv", image=upload("")), 406, "not-acceptable")
    assert "application/xml" in str(problem["detail"])
    assert "image/jpeg" not in str(problem["detail"])


@pytest.mark.parametrize("script", ["undecodable-image", "unsupported-media-type", "too-large", "no-text"])
def test_a_bad_image(client: httpx.Client, script: str) -> None:
    problem = assert_problem(post(client, image=upload(script)), STATUS[script], script)
    assert problem["field"] == "image"


STATUS = {"undecodable-image": 422, "unsupported-media-type": 415, "too-large": 413, "no-text": 422}


def test_zones_that_are_none(client: httpx.Client) -> None:
    for zones in ("[]", "{", '{"width": 1, "height": 1}'):
        assert assert_problem(post(client, {"zones": zones}), 422, "invalid-option")["field"] == "zones"


def test_zones_may_be_many_and_have_a_limit_of_their_own() -> None:
    with serving(max_zones_bytes=200_000, max_zones_file_bytes=300_000) as client:
        assert post(client, {"zones": ZONES + " " * 150_000}).status_code == 200
        for response, setting in (
            (post(client, {"zones": ZONES + " " * 210_000}), "(MAX_ZONES_BYTES)"),
            (post(client, zones=ZONES.encode() + b" " * 210_000), "(MAX_ZONES_BYTES)"),
            (post(client, zones_file=b" " * 300_001), "(MAX_ZONES_FILE_BYTES)"),
        ):
            assert setting in str(assert_problem(response, 413, "too-large")["detail"])
        assert post(client, zones_file=b" " * 300_000).status_code == 200
        response = post(client, {"models": "a" * 70_000}, image=upload(""))
        assert_problem(response, 422, "invalid-option")
        assert_problem(post(client, {"zones": " " * 400_000}), 400, "bad-request")
        told = notices(post(client, image=upload("")))["settings"]
        assert "max_zones=500, max_zones_file_bytes=300000, content_features=None" in told


def test_more_parts_than_a_form_may_have(client: httpx.Client) -> None:
    parts = [("zones", (None, b"x"))] * 51
    assert_problem(client.post("/layout", files=parts), 400, "bad-request")


def test_a_result_that_breaks_the_contract_is_not_kept() -> None:
    with serving(replace(OPERATIONS, recognize_layout=named(recognize_to_nonsense))) as client:
        assert_problem(post(client, image=upload("")), 500, "internal")


def recognize_to_nonsense(*arguments: object) -> LayoutReply:
    page: Any = {}
    return LayoutReply(b"", "application/json", LayoutResult.model_validate({"class": "round"}), page)


def test_old_results_go() -> None:
    with serving(max_results=3, result_ttl_s=1000) as client:
        ids = [post(client, {"zones": ZONES}).json()["id"] for _ in range(105)]
        statuses = [client.get(f"/layout/results/{result_id}").status_code for result_id in ids]
        # The first was followed by a purge at once, and the 101st after it by another one.
        assert 404 in statuses
        assert statuses[-1] == 200
        assert statuses == sorted(statuses, reverse=True)
        assert statuses.count(200) <= 3 + 100


def test_a_full_queue_refuses_before_the_body() -> None:
    with serving(queue_length=0) as client:
        occupant, body = connect(client), form(upload("hang"))
        occupant.sendall(head(len(body)) + body)
        until_sample(client, "engine_admitted", 1)
        for path in ("/layout", "/layout/models/letter/samples", "/layout/models/letter/initialize"):
            with connect(client) as connection:
                connection.sendall(head(50_000, path))  # and nothing of the body
                answer = read_answer(connection)
            assert (answer.status, code(answer)) == (503, "busy"), path
            assert 1 <= int(answer.headers["retry-after"]) <= 60
        assert_problem(client.put("/layout/models/letter", json={}), 503, "busy")
        assert client.get("/layout/models").status_code == 200
        assert_problem(client.get("/layout/models/letter"), 404, "not-found")
        occupant.close()


def test_a_client_that_leaves_stops_its_work() -> None:
    with serving(queue_length=0) as client:
        body = form(upload("hang"))
        connection = connect(client)
        connection.sendall(head(len(body), "/layout") + body)
        until_sample(client, "engine_running", 1)
        connection.close()
        until_sample(client, "engine_admitted", 0)
        assert post(client, image=upload("")).status_code == 200
        text = client.get("/metrics").text
        assert sample(text, 'http_requests_total{method="POST",path="/layout",status="499"}') == 1


def test_pages_side_by_side(client: httpx.Client) -> None:
    with ThreadPoolExecutor(4) as threads:
        answers = list(threads.map(lambda _: post(client, {"zones": ZONES}), range(40)))
    assert {answer.status_code for answer in answers} <= {200, 503}
    found = [answer.json()["id"] for answer in answers if answer.status_code == 200]
    assert len(set(found)) == len(found) > 4
    assert all(client.get(f"/layout/results/{result_id}").status_code == 200 for result_id in found)


def test_paths_with_names_are_counted_by_their_template(client: httpx.Client) -> None:
    client.get("/layout/models/one")
    client.get("/layout/models/two")
    text = client.get("/metrics").text
    assert sample(text, 'http_requests_total{method="GET",path="/layout/models/{name}",status="404"}') >= 2


def test_names_are_taken_once_in_their_order() -> None:
    assert parse_names("b, a,b") == ("b", "a")
