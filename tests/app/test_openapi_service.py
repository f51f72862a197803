"""The running service keeps to its OpenAPI document: schemathesis asks, the document says what may come back."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, assume, settings
from pydantic import ValidationError
from schemathesis.specs.openapi.checks import (
    missing_required_header,
    negative_data_rejection,
    positive_data_acceptance,
)

from app.http.json_bodies import MOST_BYTES
from app.http.paths import MOSAIC_PATHS, RECTIFY_PATHS, UPLOAD_PATHS
from app.main import create_app
from app.schemas.layout_settings import TypedField
from app.settings import Settings
from services.contract.mosaic import MOST_PHOTOS
from tests.app.scripted import OPERATIONS
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.serving import serving
from tests.counts import repeats

MOST_PAGES = Settings().max_pages
FILES = ("image", "images", "zones_file", "archive")
OF_SHORTCUT = {
    "/rectify/image": "jpeg",
    "/rectify/pdf": "pdf",
    "/rectify/text": "txt",
    "/rectify/pages": "json",
}
"""Formats of the operations whose answer is of one type."""
documented = schemathesis.pytest.from_fixture("document")


@pytest.fixture(scope="module")
def document() -> schemathesis.schemas.BaseSchema:
    """Read when the test runs: by `parametrize` of the document itself every process makes all cases to collect."""
    return schemathesis.openapi.from_dict(create_app(Settings(api_keys=()), OPERATIONS).openapi())


@pytest.fixture(scope="module")
def base_url() -> Iterator[str]:
    # Whoever prefers an answer later sends the next request at once: there is room for as many as are sent.
    with serving(max_upload_bytes=1_000_000, body_timeout_s=5, queue_length=150) as client:
        # Of the names that are drawn many are this one: what its paths do is seen, beside that others are not there.
        assert client.put("/layout/models/0", json=model_document("0", "sender")).status_code == 201
        yield str(client.base_url)


@documented.parametrize()
@settings(
    max_examples=repeats(4, 40), deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
@pytest.mark.long
def test_the_service_keeps_to_its_document(case: schemathesis.Case, base_url: str) -> None:
    if isinstance(case.body, dict) and case.media_type == "multipart/form-data":
        assume_a_form(case.body)
        asked = case.query.get("format") if case.query else None
        assume(not (asked and case.body.get("format")) or asked == case.body.get("format"))
        # What the document cannot say: a form has files, or uploads that are there.
        assume("upload" not in case.body)
        assume(
            case.operation.path not in (*RECTIFY_PATHS, *MOSAIC_PATHS)
            or {"image", "images"} & case.body.keys()
        )
        if case.operation.path in RECTIFY_PATHS:
            asked = asked or OF_SHORTCUT.get(case.operation.path)
            assume_one_document(case.body, asked)
            assume_a_possible_preview(case.body, asked)
        if case.operation.path.endswith("/samples"):
            assume({"zones", "zones_file"} & case.body.keys())
        if case.operation.path.startswith("/layout") and "archive" not in case.body:
            assume_parts_that_go_together(case.body)
    if case.operation.path.endswith("/settings") and isinstance(case.body, dict):
        assume_options_of_their_types(case.body)
    if case.operation.path.endswith("/feedback") and isinstance(case.body, dict):
        assume(
            not {"labels", "zones"} <= case.body.keys()
        )  # the document cannot say that one excludes the other
    response = case.call(base_url=base_url)
    refused = (
        is_refused_by_the_models(response) or is_refused_for_its_size(response) or sends_text_as_file(case)
    )
    # Where its size alone speaks, nobody has looked at what is wrong in it.
    unjudged = [positive_data_acceptance, negative_data_rejection] if refused else []
    if case.operation.path in UPLOAD_PATHS:
        # tus has 412 for a missing version and 413 for a length, and nobody refuses further headers.
        unjudged = [positive_data_acceptance, negative_data_rejection, missing_required_header]
    case.validate_response(response, excluded_checks=unjudged)


def sends_text_as_file(case: schemathesis.Case) -> bool:
    """Whether a part that is to be a file is a text, which in a form is a file as well."""
    is_form = isinstance(case.body, dict) and case.media_type == "multipart/form-data"
    return is_form and any(
        isinstance(case.body.get(name), str) for name in ("image", "zones_file", "archive")
    )


def is_refused_for_its_size(response: schemathesis.Response) -> bool:
    """Whether the body was longer than bodies of JSON may be, which the document cannot say."""
    return response.status_code == 413 and len(response.request.body or b"") > MOST_BYTES


def is_refused_by_the_models(response: schemathesis.Response) -> bool:
    """Whether a request was well formed, and the model has no samples yet, or is not the one of If-Match.

    Nor can the document say which hosts `callback_url` may name, and which bytes are a ZIP archive.
    """
    if response.status_code == 412:
        return True
    problem = response.json() if response.status_code == 422 else {}
    return problem.get("code") == "no-samples" or problem.get("field") in ("callback_url", "archive")


def assume_options_of_their_types(body: dict[str, Any]) -> None:
    """What the document cannot say of typed fields: which options a type has, and what a bounded pattern is."""
    fields = body.get("fields")
    for asked in fields.values() if isinstance(fields, dict) else ():
        if isinstance(asked, dict):
            try:
                TypedField.model_validate(asked)
            except ValidationError as error:
                # A violation of the document stays in; what the model's own check refuses is left out.
                assume(any(one["type"] != "value_error" for one in error.errors()))


def assume_a_form(body: dict[str, Any]) -> None:
    """What the document cannot say of any form, and what a form turns into something else."""
    images = [*as_list(body.get("images", [])), *as_list(body.get("image", []))]
    # "An object in place of the file" goes out as a file that holds JSON: bytes like any others.
    assume(all(isinstance(body.get(name, b""), bytes | str) for name in ("zones", "zones_file", "archive")))
    assume(all(isinstance(image, bytes | str) for image in images))
    # An empty field of a form is one that was left out, and a list of one goes out as its item: no violations.
    options = [value for name, value in body.items() if name not in FILES]
    assume("" not in options)
    assume(not any(isinstance(value, list) and len(value) < 2 for value in options))
    # What the document cannot say: the base is one of the photos that came with it.
    base = body.get("base")
    is_index = str(base).isascii() and str(base).isdigit()
    assume(not is_index or not len(images) <= int(base) < MOST_PHOTOS)


def assume_one_document(body: dict[str, Any], asked: str | None) -> None:
    """A document has a bounded number of pages; several have no region, and go into a format of several pages."""
    images = as_list(body.get("image", []))
    assume(len(images) <= MOST_PAGES)
    one_page = str(asked or body.get("format")).lower() in ("jpeg", "jpg", "png", "webp")
    assume(len(images) < 2 or not (one_page or body.get("region")))


def assume_a_possible_preview(body: dict[str, Any], asked: str | None) -> None:
    """A preview is JSON, and has neither text nor pictures."""
    if str(body.get("preview")).lower() == "true":
        others = [str(body.get(name)).lower() for name in ("text", "embed", "pages")]
        assume(str(asked or body.get("format")).lower() == "json")
        assume(not {"true", "both"} & set(others) and not body.get("embed_format"))


def as_list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def assume_parts_that_go_together(body: dict[str, Any]) -> None:
    """Zones are sent once, for an image as it is; their text is a page's."""
    assume({"image", "zones", "zones_file"} & body.keys())
    assume(not {"zones", "zones_file"} <= body.keys())
    has_zones = bool({"zones", "zones_file"} & body.keys())
    assume(body.get("rectify") is not True or not has_zones)
    assume(str(body.get("keep_image")).lower() != "true" or "image" in body)
    # Zones are of one page, and a document has a bounded number of them.
    several = len(as_list(body.get("image", []))) > 1
    assume(not (has_zones and (several or "page" in body)))
    assume(len(as_list(body.get("image", []))) <= MOST_PAGES)
    if "zones" in body:
        body["zones"] = json.dumps(PAGE)
    if "zones_file" in body:
        body["zones_file"] = json.dumps(PAGE).encode()
