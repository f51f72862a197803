"""POST /layout with several pages: results page by page, what is kept, limits, formats, models of later pages; HTML."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from app.schemas.layout import result_of
from app.storage.layout_store import DATABASE
from models.repository import Store
from services.contract.answers.layout import DocumentResult, StackResult
from services.contract.layout import DocumentReply, LayoutReply
from tests.app.pools import named
from tests.app.scripted import OPERATIONS
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.scripted_results import layout_document
from tests.app.scripts import JPEG, upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

PICTURE_BYTES = len(JPEG + b"page")
MODEL = "/layout/models/letter"


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    with serving(
        max_pages=5, max_stack_pages=7, max_document_upload_bytes=300_000, max_upload_bytes=200_000
    ) as client:
        for name, label in (("letter", "sender"), ("letter-2", "page-number")):
            client.put(f"/layout/models/{name}", json=model_document(name, label)).raise_for_status()
        yield client


def post(client: httpx.Client, *images: bytes, accept: str = "*/*", **data: str) -> httpx.Response:
    files = [("image", (f"page-{index}.png", image)) for index, image in enumerate(images)]
    return client.post("/layout", files=files, data=data, headers={"Accept": accept})


@pytest.mark.parametrize("images", [[upload("")] * 3, [upload("pages-3")], [upload("pages-2"), upload("")]])
def test_the_answer_is_the_contracts(client: httpx.Client, images: list[bytes]) -> None:
    response = post(client, *images)
    assert response.status_code == 200, response.text
    answer = response.json()
    assert list(answer) == [
        "id",
        "file_name",
        "class",
        "classes",
        "unknown_probability",
        "pages",
        "tables",
        "warnings",
        "timings_ms",
    ]
    DocumentResult.model_validate(answer)
    assert answer["class"]["name"] == "letter"
    assert len(answer["pages"]) == 3
    assert response.headers["document-class"] == "letter"
    assert response.headers["document-result"] == f"/layout/results/{answer['id']}"


def test_pages_have_the_names_of_their_images(client: httpx.Client) -> None:
    answer = post(client, upload("pages-2"), upload("")).json()
    assert answer["file_name"] == "page-0.png"
    assert [page["file_name"] for page in answer["pages"]] == ["page-0.png", "page-0.png", "page-1.png"]
    assert client.get(f"/layout/results/{answer['id']}").json() == answer


def test_files_name_the_upload_where_its_pixels_are_the_pages(client: httpx.Client) -> None:
    """Not where several pages are in one file, nor where the page was flattened: there ids are as good."""
    for images, options, known in (
        ([upload("pages-2"), upload("")], {}, [None, None, "page-1.png"]),
        ([upload("")], {}, ["page-0.png"]),
        ([upload("")], {"rectify": "true"}, [None]),
    ):
        answer = post(client, *images, **options).json()
        ids = [page["id"] for page in answer.get("pages", [answer])]
        names = [name or id for name, id in zip(known, ids, strict=True)]
        for form in ("pagexml", "alto"):
            file = client.get(f"/layout/results/{answer['id']}?format={form}")
            assert file.text.split(" | ") == names


def test_the_document_and_its_pages_are_kept(client: httpx.Client) -> None:
    answer = post(client, upload(""), upload("")).json()
    ids = {answer["id"], *(page["id"] for page in answer["pages"])}
    assert len(ids) == 3
    assert client.get(f"/layout/results/{answer['id']}").json() == answer
    for page in answer["pages"]:
        assert client.get(f"/layout/results/{page['id']}").json() == page


def test_a_document_gives_way_before_its_pages(tmp_path: Path) -> None:
    with serving(data_dir=tmp_path) as client:
        answer = post(client, upload("pages-3")).json()
        document, *pages = (f"/layout/results/{part['id']}" for part in (answer, *answer["pages"]))
        with Store.open(tmp_path / DATABASE) as store:
            assert store.purge_results(keep_newest=4) == 0
            assert client.get(document).json() == answer
            assert store.purge_results(keep_newest=3) == 1
        assert_problem(client.get(document), 404, "not-found")
        assert [client.get(page).json() for page in pages] == answer["pages"]


def test_feedback_is_given_on_pages(client: httpx.Client) -> None:
    answer = post(client, upload(""), upload("")).json()
    verdict = {"class": "letter", "labels": {"z1": "sender"}}
    problem = assert_problem(
        client.post(f"/layout/results/{answer['id']}/feedback", json=verdict), 422, "invalid-option"
    )
    assert all(page["id"] in str(problem["detail"]) for page in answer["pages"])
    for page in answer["pages"]:
        response = client.post(f"/layout/results/{page['id']}/feedback", json=verdict)
        assert response.status_code == 200, response.text


def test_what_a_model_continues_is_told_to_the_worker(client: httpx.Client) -> None:
    assert post(client, upload("")).json()["warnings"][3]["detail"] == "{}"
    change = {"continues": "letter"}
    client.patch("/layout/models/letter-2/settings", json=change).raise_for_status()
    assert post(client, upload("")).json()["warnings"][3]["detail"] == "{'letter-2': 'letter'}"


def test_one_page_is_no_document(client: httpx.Client) -> None:
    for response in (post(client, upload("")), post(client, upload(""), upload(""), page="2")):
        assert {"zones", "part", "document_class"} <= response.json().keys()
    options = post(client, upload(""), upload(""), page="2").json()["warnings"][0]["detail"]
    assert "page=2" in options
    assert "image_names=('page-0.png', 'page-1.png')" in options


@pytest.mark.parametrize(
    ("data", "accept", "asked"),
    [({"format": "pagexml"}, "*/*", True), ({}, "application/xml", False), ({}, "*/*", False)],
)
def test_what_asked_for_the_format_is_told(
    client: httpx.Client, data: dict[str, str], accept: str, asked: bool
) -> None:
    response = post(client, upload(""), accept=accept, **data)
    kept = client.get(response.headers["document-result"]).json()
    assert f"format_named={asked}" in kept["warnings"][0]["detail"]


def test_files_of_several_pages_come_in_an_archive(client: httpx.Client) -> None:
    response = post(client, upload("pages-2"), format="alto")
    assert response.headers["content-type"] == "application/zip"
    assert response.text == "page as alto"
    assert len(client.get(response.headers["document-result"]).json()["pages"]) == 2


def test_more_images_than_a_document_may_have(client: httpx.Client) -> None:
    assert len(post(client, *[upload("")] * 5).json()["pages"]) == 5
    for count in (6, 60):
        problem = assert_problem(post(client, *[upload("")] * count), 413, "too-large")
        assert "5 pages (MAX_PAGES)" in str(problem["detail"])
        assert problem["field"] == "image"


def test_documents_have_a_body_limit_of_their_own(client: httpx.Client) -> None:
    assert post(client, upload("") + bytes(250_000)).status_code == 200
    problem = assert_problem(post(client, upload("") + bytes(300_000)), 413, "too-large")
    assert "MAX_DOCUMENT_UPLOAD_BYTES" in str(problem["detail"])
    told = post(client, upload("")).json()["warnings"][1]["detail"]
    assert "max_bytes=300000" in told
    assert "max_pages=5, max_megapixels=200.0" in told


@pytest.mark.parametrize(
    ("data", "images", "field"),
    [
        ({"zones": "{}"}, 2, "image"),
        ({"zones": "{}", "page": "1"}, 1, "page"),
        ({"page": "0"}, 1, "page"),
        ({"page": "last"}, 1, "page"),
        ({"page": "1000000"}, 1, "page"),
    ],
)
def test_options_that_do_not_go_together(
    client: httpx.Client, data: dict[str, str], images: int, field: str
) -> None:
    problem = assert_problem(post(client, *[upload("")] * images, **data), 422, "invalid-option")
    assert problem["field"] == field


def test_a_problem_of_one_image_names_it(client: httpx.Client) -> None:
    problem = assert_problem(post(client, upload(""), upload("undecodable-image")), 422, "undecodable-image")
    assert problem["field"] == "image[1]"
    problem = assert_problem(
        client.post("/layout", files=[("image", upload("")), ("image", (None, b"no file"))]),
        400,
        "bad-request",
    )
    assert problem["field"] == "image"


def test_documents_have_a_time_limit_of_their_own() -> None:
    with serving(job_timeout_s=0.5, document_timeout_s=30.0) as client:
        tiff = b"II*\0" + upload("sleep 1.2")
        assert post(client, tiff).status_code == 200
        problem = assert_problem(post(client, upload("sleep 10")), 504, "timed-out")
        assert "JOB_TIMEOUT_S" in str(problem["detail"])
    with serving(document_timeout_s=0.5) as client:
        for images in ([b"%PDF-1.7" + upload("sleep 10")], [upload("sleep 10"), upload("")]):
            problem = assert_problem(post(client, *images), 504, "timed-out")
            assert "DOCUMENT_TIMEOUT_S" in str(problem["detail"])


def reply_of_a_continuation(*arguments: object) -> LayoutReply:
    return LayoutReply(b"", "application/json", result_of(_page("letter-2"), ""), PAGE)


def _page(name: str) -> dict[str, object]:
    document = layout_document(PAGE, [], [], {})
    match = {"name": name, "model_version": 1, "cost": 1.0, "probability": 0.9}
    return {
        **document,
        "class": match,
        "classes": [match],
        "part": "continuation",
        "document_class": "letter",
    }


def test_the_class_of_a_later_page_is_its_documents() -> None:
    with serving(replace(OPERATIONS, recognize_layout=named(reply_of_a_continuation))) as client:
        response = post(client, upload(""))
        assert response.headers["document-class"] == "letter"
        assert response.json()["class"]["name"] == "letter-2"


def reply_of_nonsense(*arguments: object) -> DocumentReply:
    return DocumentReply(b"", "application/json", DocumentResult.model_validate({"class": "round"}), [])


def test_a_document_that_breaks_the_contract_is_not_kept() -> None:
    with serving(replace(OPERATIONS, recognize_layout=named(reply_of_nonsense))) as client:
        assert_problem(post(client, upload("")), 500, "internal")


@pytest.fixture
def elements(client: httpx.Client) -> Iterator[dict[str, str]]:
    changed = client.patch(f"{MODEL}/settings", json={"elements": {"sender": "address", "body": "p"}})
    assert changed.status_code == 200, changed.text
    yield changed.json()["elements"]
    client.patch(f"{MODEL}/settings", json={"elements": None}).raise_for_status()


def test_several_pages_are_one_file(client: httpx.Client) -> None:
    answer = post(client, upload(""), upload(""), format="html")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-disposition"] == 'inline; filename="page-0.html"'
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert answer.headers["document-class"] == "letter"


def test_a_stored_result_with_its_picture(client: httpx.Client, elements: dict[str, str]) -> None:
    result = post(client, upload(""), keep_image="true").json()
    path = f"/layout/results/{result['id']}"
    shown = f"2 zones, {PICTURE_BYTES} bytes, {elements}"
    for answer in (
        client.get(path, params={"format": "html"}),
        client.get(path, headers={"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}),
    ):
        assert answer.text == shown
        assert answer.headers["content-type"] == "text/html; charset=utf-8"
        assert answer.headers["content-disposition"] == f'inline; filename="{path.rpartition("/")[2]}.html"'
        assert answer.headers["vary"] == "Accept"
        assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert client.get(path, headers={"Accept": "text/html"}, params={"format": "json"}).json()["zones"]
    assert_problem(client.get(path, headers={"Accept": "image/tiff"}), 406, "not-acceptable")
    assert client.get(path, params={"format": "gif"}).json()["field"] == "format"


def test_a_document_with_pictures_that_are_gone(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = post(client, upload(""), upload(""), keep_image="true").json()
    path = f"/layout/results/{document['id']}"
    shown = f"2 zones, {PICTURE_BYTES} bytes, {{}}"
    assert client.get(path, params={"format": "html"}).text == f"{shown} | {shown}"
    monkeypatch.setattr("app.storage.kept_images.KeptImages._key", lambda *_: "nowhere")
    gone = shown.replace(f"{PICTURE_BYTES} bytes", "0 bytes")
    assert client.get(path, params={"format": "html"}).text == f"{gone} | {gone}"


def test_the_class_of_a_document_is_what_a_person_says_of_its_first_page(client: httpx.Client) -> None:
    document = post(client, upload(""), upload("")).json()
    path = f"/layout/results/{document['id']}"
    first, second = (page["id"] for page in document["pages"])
    for page, shown in ((second, "letter"), (first, None)):
        told = client.post(f"/layout/results/{page}/feedback", json={"class": None})
        assert told.status_code == 200, told.text
        corrected = client.get(path).json()
        assert (corrected["class"] or {"name": None})["name"] == shown
    assert corrected["found"] == {"class": "letter", "probability": document["class"]["probability"]}
    assert [page["class"] for page in corrected["pages"]] == [None, None]
    assert client.get(path, params={"format": "html"}).headers.get("document-class") is None
    for page in (first, second):
        assert client.delete(f"/layout/results/{page}/feedback").status_code == 200
    assert client.get(path).json() == document


def test_settings_of_the_class_and_of_the_model_of_the_page(
    client: httpx.Client, elements: dict[str, str]
) -> None:
    later = {"continues": "letter", "elements": {"sender": "h2", "date": "p"}}
    changed = client.patch("/layout/models/letter-2/settings", json=later)
    assert changed.json()["elements"] == {"sender": "h2", "date": "p"}
    page = post(client, upload(""), models="letter-2").json()
    text = client.get(f"/layout/results/{page['id']}?format=html").text
    assert text.endswith(str({"sender": "h2", "date": "p"}))


def test_settings_of_elements(client: httpx.Client, elements: dict[str, str]) -> None:
    assert elements == {"sender": "address", "body": "p"}
    kept = client.patch(f"{MODEL}/settings", json={"elements": {"body": None, "date": "h2"}}).json()
    assert kept["elements"] == {"sender": "address", "date": "h2"}
    assert client.patch(f"{MODEL}/settings", json={"genre": None}).json()["elements"] == kept["elements"]
    for wrong in ({"sender": "script"}, {"": "p"}, {"x" * 61: "p"}, [], {"sender": 3}):
        problem = assert_problem(
            client.patch(f"{MODEL}/settings", json={"elements": wrong}), 422, "invalid-option"
        )
        assert str(problem["field"]).startswith("elements")


def test_a_stack_is_answered_as_its_documents(client: httpx.Client) -> None:
    response = post(client, upload("pages-2"), upload(""), upload("pages-3"), split="true")
    assert response.status_code == 200, response.text
    answer = response.json()
    assert list(answer) == ["documents"]
    StackResult.model_validate(answer)
    assert [len(document["pages"]) for document in answer["documents"]] == [2, 1, 3]
    assert [document["file_name"] for document in answer["documents"]] == [f"page-{n}.png" for n in range(3)]
    assert response.headers["document-class"] == "letter, letter, letter"
    assert "unsure-beginning" in response.headers["document-warnings"]
    for document in answer["documents"]:
        assert client.get(f"/layout/results/{document['id']}").json() == document
        for page in document["pages"]:
            assert client.get(f"/layout/results/{page['id']}").json() == page


def test_a_stack_is_json_for_who_takes_it_too(client: httpx.Client) -> None:
    for accept in ("text/html, */*;q=0.1", "application/xml, application/json;q=0.5"):
        assert post(client, upload(""), accept=accept, split="true").json()["documents"]


def test_a_stack_may_have_more_pages_than_a_document(client: httpx.Client) -> None:
    assert len(post(client, *[upload("")] * 7, split="true").json()["documents"]) == 7
    problem = assert_problem(post(client, *[upload("")] * 8, split="true"), 413, "too-large")
    assert "a stack may have 7 pages (MAX_STACK_PAGES)" in str(problem["detail"])
    told = post(client, upload(""), split="true").json()["documents"][0]["warnings"][1]["detail"]
    assert "max_pages=7, max_megapixels=280.0, of='stack'" in told


@pytest.mark.parametrize(
    ("data", "accept", "status", "code", "field"),
    [
        ({"split": "true", "format": "pagexml"}, "*/*", 422, "invalid-option", "format"),
        ({"split": "true"}, "application/xml", 406, "not-acceptable", None),
        ({"split": "true", "page": "2"}, "*/*", 422, "invalid-option", "split"),
        ({"split": "true", "zones": "{}"}, "*/*", 422, "invalid-option", "split"),
        ({"split": "perhaps"}, "*/*", 422, "invalid-option", "split"),
    ],
)
def test_what_a_stack_cannot_be(
    client: httpx.Client, data: dict[str, str], accept: str, status: int, code: str, field: str | None
) -> None:
    problem = assert_problem(post(client, upload(""), accept=accept, **data), status, code)
    assert problem.get("field") == field
