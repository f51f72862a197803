"""Every error is a problem document with a stable code, whoever raises it."""

import importlib
import pkgutil

import httpx
import pytest
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

import app
import services
from app.http.preconditions import PreconditionFailed
from app.http.problems import MEANING_OF_CODE, STATUS_OF_CODE, documented, refusal_of
from models.errors import NotFound, StoreError, VersionConflict
from services.errors import DocumentError, InvalidOption
from tests.app.pools import named
from tests.app.scripts import upload
from tests.app.serving import serving


def assert_problem(response: httpx.Response, status: int, code: str) -> dict[str, object]:
    assert (response.status_code, response.headers["content-type"]) == (status, "application/problem+json")
    problem: dict[str, object] = response.json()
    assert (problem["status"], problem["code"]) == (status, code)
    assert problem["request_id"] == response.headers["x-request-id"]
    assert problem["type"] == "about:blank"
    assert problem["title"]
    assert problem["detail"]
    assert "Traceback" not in response.text
    return problem


def rectify(client: httpx.Client, script: str) -> httpx.Response:
    return client.post("/rectify", files={"image": ("photo.jpg", upload(script))})


@pytest.mark.parametrize(
    ("script", "status", "code"),
    [
        ("too-large", 413, "too-large"),
        ("unsupported-media-type", 415, "unsupported-media-type"),
        ("undecodable-image", 422, "undecodable-image"),
        ("no-text", 422, "no-text"),
        (f"memory {1 << 31}", 413, "out-of-memory"),
        ("fail", 500, "internal"),
        ("exit", 500, "internal"),
        ("unpicklable", 500, "internal"),
        ("segfault", 500, "worker-died"),
        ("kill", 500, "worker-died"),
    ],
)
def test_what_befalls_the_work(client: httpx.Client, script: str, status: int, code: str) -> None:
    problem = assert_problem(rectify(client, script), status, code)
    assert "secret" not in str(problem)
    assert rectify(client, "").status_code == 200


def test_work_past_its_limit() -> None:
    with serving(job_timeout_s=0.3) as client:
        problem = assert_problem(rectify(client, "hang"), 504, "timed-out")
        assert "0.3 s" in str(problem["detail"])
        assert rectify(client, "").status_code == 200


def test_no_such_resource(client: httpx.Client) -> None:
    assert_problem(client.get("/nowhere"), 404, "not-found")
    assert_problem(client.post("/rectify/", content=b"x"), 404, "not-found")


def test_no_such_method(client: httpx.Client) -> None:
    response = client.get("/rectify")
    assert_problem(response, 405, "method-not-allowed")
    assert response.headers["allow"] == "OPTIONS, POST"


@pytest.mark.parametrize(
    ("body", "content_type"),
    [
        (b"", None),
        (b"photo", "image/jpeg"),
        (b"{}", "application/json"),
        (b"a=b", "application/x-www-form-urlencoded"),
        (b"", "multipart/form-data"),
        (b"", "multipart/form-data; boundary=x"),
        (b"nonsense", "multipart/form-data; boundary=x"),
        (b"--x\r\nContent-Disposition: form-data\r\n\r\n1\r\n--x--\r\n", "multipart/form-data; boundary=x"),
        (
            b'--x\r\nContent-Disposition: form-data; name="image"\r\n\r\n1\r\n--x--\r\n',
            "multipart/form-data; boundary=x",
        ),
        (
            b'--x\r\nContent-Disposition: form-data; name="image"; filename="a"\r\n\r\n1',
            "multipart/form-data; boundary=x",
        ),
    ],
)
def test_not_the_form_that_is_expected(client: httpx.Client, body: bytes, content_type: str | None) -> None:
    headers = {} if content_type is None else {"Content-Type": content_type}
    assert_problem(client.post("/rectify", content=body, headers=headers), 400, "bad-request")


def test_too_many_and_too_large_parts(client: httpx.Client) -> None:
    too_many = [("image", ("photo.jpg", upload("")))] * 65
    assert_problem(client.post("/rectify", files=too_many), 400, "bad-request")
    response = client.post("/rectify", files={"image": upload("")}, data={"region": "1" * 70_000})
    assert assert_problem(response, 413, "too-large")["field"] == "region"


def test_a_result_that_breaks_the_contract_is_a_defect_of_ours() -> None:
    from dataclasses import replace

    from tests.app.scripted import OPERATIONS

    with serving(replace(OPERATIONS, rectify=named(rectify_to_nonsense))) as client:
        response = client.post("/rectify", files={"image": upload("")}, data={"format": "json"})
        assert_problem(response, 500, "internal")


def rectify_to_nonsense(*arguments: object) -> object:
    from services.contract.answers.rectify import RectifyResult

    return RectifyResult.model_validate({"kind": "round"})


def all_errors() -> list[type[DocumentError | StoreError]]:
    """Every class of error that the product defines."""
    importlib.import_module("models.errors")
    for package in (app, services):
        for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            if module.name != "app.__main__":
                importlib.import_module(module.name)
    found: list[type[DocumentError | StoreError]] = []
    rest: list[type[DocumentError | StoreError]] = [DocumentError, StoreError]
    while rest:
        error = rest.pop()
        found.append(error)
        rest += error.__subclasses__()
    return [error for error in found if error.__module__.startswith(("app.", "services.", "models."))]


def test_every_error_of_the_product_has_a_status_and_a_meaning() -> None:
    errors = all_errors()
    assert len(errors) > 10
    for error in errors:
        what = ("what",) if issubclass(error, InvalidOption | NotFound | VersionConflict) else ()
        refusal = refusal_of(error("what happened", *what))
        assert refusal.code == error.code
        assert refusal.status == (
            412 if issubclass(error, PreconditionFailed) else STATUS_OF_CODE[error.code]
        )
    assert STATUS_OF_CODE.keys() == MEANING_OF_CODE.keys()


def test_what_is_not_foreseen_tells_nothing() -> None:
    for error in (KeyError("secret"), HTTPException(418, "secret"), DocumentError("secret")):
        refusal = refusal_of(error)
        assert (refusal.status, refusal.code) == (500, "internal")
        assert "secret" not in refusal.detail


def test_a_body_that_could_not_be_spooled_is_not_the_clients_fault() -> None:
    error = HTTPException(400, "There was an error parsing the body")
    assert refusal_of(error).code == "bad-request"
    error.__cause__ = OSError(28, "No space left on device")
    assert refusal_of(error).code == "store-unavailable"


def test_a_validation_error_without_a_place_is_about_the_body() -> None:
    refusal = refusal_of(RequestValidationError([{"type": "missing", "loc": ("body",), "msg": "x"}]))
    assert (refusal.status, refusal.code, refusal.field) == (400, "bad-request", None)


def test_documented_responses_join_the_codes_of_a_status() -> None:
    responses = documented("no-text", "invalid-option", "busy")
    assert list(responses) == [422, 503]
    assert "`no-text`" in str(responses[422]["description"])
    assert "Retry-After" in str(responses[503]["headers"])
