"""The OpenAPI document: complete, without double names, and what it says of single fields is so."""

import json
import re
from collections.abc import Iterator
from functools import cache
from typing import Any

import jsonschema_rs
from fastapi.routing import APIRoute
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.http.middleware import WORK
from app.http.paths import MOSAIC_PATHS, RECTIFY_PATHS
from app.http.problems import STATUS_OF_CODE
from app.main import ROUTERS, create_app
from app.openapi.document import operations_of
from app.schemas.photo_points import REGION_PATTERN, parse_region
from app.settings import Settings
from tests.app.scripted import OPERATIONS


@cache
def described() -> dict[str, Any]:
    """The document of a service without keys, made when a test asks: collecting tests does not wait for it."""
    document: dict[str, Any] = create_app(Settings(api_keys=()), OPERATIONS).openapi()
    return document


def test_every_route_is_documented_and_every_job_is_admitted() -> None:
    routes = [route for router in ROUTERS for route in router.routes if isinstance(route, APIRoute)]
    assert {route.path for route in routes} == described()["paths"].keys()
    methods = {(method, route.path) for route in routes for method in route.methods}
    writes = {(method, path) for method, path in methods if method in {"POST", "PUT"}}
    of_the_store_alone = {
        ("POST", "/layout/models/{name}/rollback"),
        *(("POST", f"/layout/results/{{id}}/{act}") for act in ("claim", "release", "skip")),
    }
    assert writes - WORK == {*of_the_store_alone, ("POST", "/tokens"), ("POST", "/uploads")}
    assert WORK - writes == {
        ("GET", "/layout/models/{name}/versions/{version}/diff"),
        ("DELETE", "/layout/results/{id}/feedback"),
        ("GET", "/pages/{id}/photo"),
    }


def test_every_route_stands_under_a_heading_that_is_explained() -> None:
    used = {
        tag
        for path in described()["paths"].values()
        for operation in path.values()
        for tag in operation["tags"]
    }
    assert used == {tag["name"] for tag in described()["tags"]}
    assert all(tag["description"] for tag in described()["tags"])


def test_problems_are_documented_as_problems() -> None:
    for path in described()["paths"].values():
        for operation in path.values():
            for status, response in operation["responses"].items():
                if not status.startswith("2"):
                    assert list(response["content"]) == ["application/problem+json"]
                    assert f"`{code_in(response)}`" in response["description"]
                    # A conflict with what the writer expects is 412, any other 409.
                    statuses = {STATUS_OF_CODE[code_in(response)]}
                    assert int(status) in (statuses | {412} if code_in(response) == "conflict" else statuses)
    assert "HTTPValidationError" not in described()["components"]["schemas"]
    assert described()["components"]["schemas"]["Problem"]["properties"].keys() >= {
        "code",
        "detail",
        "request_id",
    }


def test_whoever_takes_a_precondition_may_refuse_it() -> None:
    for path in described()["paths"].values():
        for operation in path.values():
            headers = {parameter["name"].lower() for parameter in operation.get("parameters", ())}
            is_conditional = bool(headers & {"if-match", "if-none-match", "tus-resumable"})
            assert (
                is_conditional == ("412" in operation["responses"])
                or operation["operationId"] == "job_result"
            )


def code_in(response: dict[str, str]) -> str:
    return response["description"].split("`")[1]


def test_the_form_is_documented_field_by_field() -> None:
    fields = described()["components"]["schemas"]["RectifyForm"]["properties"]
    assert list(fields) == [
        "image", "kind", "upright", "focal_length_px", "region", "corners", "rotate", "margin", "illumination", "crop",
        "pages", "paper", "on_no_text", "preview", "keep_photo", "camera", "text", "language", "format",
        "quality", "embed", "embed_format", "max_width", "max_height", "pdf_version", "title", "archive",
        "callback_url", "upload", "kept_page",
    ]  # fmt: skip
    assert all(field["description"] for field in fields.values())
    assert fields["quality"]["minimum"] == 1
    assert fields["kind"]["enum"] == ["auto", "planar", "curved"]


def test_the_form_of_a_mosaic_is_documented_field_by_field() -> None:
    fields = described()["components"]["schemas"]["MosaicForm"]["properties"]
    assert list(fields) == [
        "images", "rectify", "base", "composition", "upright", "rotate", "illumination", "keep_photo", "camera", "text",
        "language", "format", "quality", "embed", "embed_format", "max_width", "max_height", "pdf_version", "title",
        "callback_url", "upload", "kept_page",
    ]  # fmt: skip
    assert all(field["description"] for field in fields.values())
    assert (fields["images"]["minItems"], fields["images"]["maxItems"]) == (2, 16)
    assert fields["base"]["default"] == "auto"
    assert fields["illumination"]["default"] == "normalize"


def test_the_form_of_a_layout_is_documented_field_by_field() -> None:
    schemas = described()["components"]["schemas"]
    fields = schemas["LayoutForm"]["properties"]
    assert list(fields) == [
        "image", "zones", "zones_file", "rectify", "ocr", "language", "models", "format", "keep_image", "page",
        "split", "explain", "words", "callback_url", "upload",
    ]  # fmt: skip
    assert all(field["description"] for field in fields.values())
    assert fields["language"] == schemas["RectifyForm"]["properties"]["language"]
    assert fields["language"] == schemas["MosaicForm"]["properties"]["language"]


def test_files_are_binary_and_no_form_has_a_condition_on_its_parts() -> None:
    text = json.dumps(described())
    # Counted: pytest would take minutes to show where in the text it stands.
    assert text.count('"contentMediaType": "application/octet-stream"') == 0
    assert text.count("*/*") == 0
    schemas = described()["components"]["schemas"]
    for form, name in (("LayoutForm", "zones_file"), ("SampleForm", "image")):
        assert schemas[form]["properties"][name]["format"] == "binary"
    for form, name in (("MosaicForm", "images"), ("LayoutForm", "image"), ("RectifyForm", "image")):
        assert schemas[form]["properties"][name]["items"]["format"] == "binary"
    assert [name for name, schema in schemas.items() if "properties" in schema and "anyOf" in schema] == []


def test_no_two_schemas_have_one_name() -> None:
    """FastAPI would name both by their modules, and generators make both the same class."""
    titles = [schema.get("title", name) for name, schema in described()["components"]["schemas"].items()]
    assert sorted(titles) == sorted(set(titles))
    assert [name for name in described()["components"]["schemas"] if "__" in name] == []


def test_nothing_in_the_document_has_a_misleading_default() -> None:
    quality = described()["components"]["schemas"]["RectifyForm"]["properties"]["quality"]
    assert ("default" in quality, quality["examples"]) == (False, [90])
    prefer = [
        parameter
        for parameter in described()["paths"]["/rectify"]["post"]["parameters"]
        if parameter["name"] == "Prefer"
    ]
    assert [sorted(parameter) for parameter in prefer] == [
        ["description", "in", "name", "required", "schema"]
    ]


def test_no_operation_has_two_options_of_one_name() -> None:
    for path, operation in operations_of(described()):
        parameters = [parameter["name"] for parameter in operation.get("parameters", ())]
        for content in operation.get("requestBody", {}).get("content", {}).values():
            names = [*parameters, *resolved(content["schema"]).get("properties", ())]
            assert len(names) == len(set(names)), path


def resolved(schema: dict[str, Any]) -> dict[str, Any]:
    if "$ref" not in schema:
        return schema
    found: dict[str, Any] = described()["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
    return found


def test_parameters_are_of_one_type_and_never_null() -> None:
    for path, operation in operations_of(described()):
        for parameter in operation.get("parameters", ()):
            assert "anyOf" not in parameter["schema"], (path, parameter["name"])


def test_operations_of_one_answer_say_nothing_that_generators_cannot_type() -> None:
    for path in (*RECTIFY_PATHS[1:], *MOSAIC_PATHS[1:]):
        answer = described()["paths"][path]["post"]["responses"]["200"]
        schemas = [content["schema"] for content in answer["content"].values()]
        assert len({json.dumps(schema) for schema in schemas}) == 1, path
        for part in parts_of(schemas[0]):
            assert not {"prefixItems", "anyOf"} & part.keys(), (path, part)
            assert part.get("type") != "null", (path, part)
            assert "oneOf" not in part or "discriminator" in part, (path, part)


def parts_of(part: Any) -> Iterator[dict[str, Any]]:
    """All objects of a schema and of those that it names."""
    if isinstance(part, dict):
        yield part
        yield from parts_of(resolved(part) if "$ref" in part else list(part.values()))
    if isinstance(part, list):
        for each in part:
            yield from parts_of(each)


def test_the_document_tells_keys_servers_and_licence_also_where_no_keys_are_set() -> None:
    assert described()["servers"] == [{"url": "/"}]
    assert described()["info"]["license"]["identifier"] == "Apache-2.0"
    assert described()["info"]["contact"]["name"]
    with_keys = create_app(Settings(api_keys=("a:reader:" + "0" * 64,)), OPERATIONS).openapi()
    for document, needed in ((described(), False), (with_keys, True)):
        operation = document["paths"]["/rectify"]["post"]
        assert ({} in operation["security"]) is not needed
        assert {"401", "403"} <= operation["responses"].keys()


def test_every_operation_has_examples_that_fit_their_schemas() -> None:
    contents = 0
    for _, operation in operations_of(described()):
        name = operation["operationId"]
        for media_type, content in operation.get("requestBody", {}).get("content", {}).items():
            if (media_type, name) != ("multipart/form-data", "add_layout_sample"):
                assert "example" in content, (name, media_type)
                contents += check(content)
        for status, response in operation["responses"].items():
            content = response.get("content", {}).get("application/json")
            if content is not None:
                assert "example" in content, (name, status)
                contents += check(content)
            if status >= "4":
                contents += check(response["content"]["application/problem+json"])
    assert contents > 200


def check(content: dict[str, Any]) -> int:
    """The example of `content` fits its schema; 1."""
    validator_of(json.dumps(content["schema"])).validate(content["example"])
    return 1


@cache
def validator_of(schema: str) -> jsonschema_rs.Validator:
    """Many operations share one schema, and to compile it with all others takes long."""
    return jsonschema_rs.validator_for({**json.loads(schema), "components": described()["components"]})


def test_every_kind_of_surface_is_documented_and_told_by_its_type() -> None:
    schemas = described()["components"]["schemas"]
    surface = schemas["RectifyResult"]["properties"]["surface"]
    kinds = {
        kind: reference.rsplit("/", 1)[1] for kind, reference in surface["discriminator"]["mapping"].items()
    }
    assert kinds == {"plane": "Plane", "strips": "Strips", "mesh": "CreasedSheet"}
    assert {choice["$ref"].rsplit("/", 1)[1] for choice in surface["oneOf"]} == set(kinds.values())
    mesh = schemas["CreasedSheet"]
    assert set(mesh["required"]) >= {"rows", "columns", "points", "normals"}
    assert mesh["properties"]["rows"]["minimum"] == 2


def test_the_headers_of_images_are_documented() -> None:
    pages = ["Document-Pages", "Document-Advice", "Document-Failed"]
    common = [
        "Content-Disposition",
        "Document-Rotation",
        "Document-Warnings",
        "Document-Page-Id",
        "Server-Timing",
    ]
    of_rectify = (
        "/rectify",
        "/rectify/image",
        "/rectify/pdf",
        "/rectify/text",
        "/pages/{id}/render",
        "/pages/bind",
    )
    for path in of_rectify:
        assert list(headers_of(path)) == ["Document-Kind", *common, *pages]
    for path in ("/mosaic", "/mosaic/image", "/mosaic/pdf"):
        assert list(headers_of(path)) == ["Document-Unplaced", *common]


def headers_of(path: str) -> dict[str, Any]:
    headers: dict[str, Any] = described()["paths"][path]["post"]["responses"]["200"]["headers"]
    return headers


def test_the_result_of_a_job_may_be_that_of_every_operation_that_makes_one() -> None:
    makes_jobs = [
        operation["responses"]["200"]["content"]
        for _, operation in operations_of(described())
        if "202" in operation["responses"]
    ]
    assert len(makes_jobs) > 10
    result = described()["paths"]["/jobs/{id}/result"]["get"]["responses"]["200"]["content"]
    assert {media_type for content in makes_jobs for media_type in content} <= {
        *result,
        "application/octet-stream",
    }
    named = re.findall(r"#/components/schemas/\w+", json.dumps(result["application/json"]))
    for content in makes_jobs:
        told = re.findall(
            r"#/components/schemas/\w+", json.dumps(content.get("application/json", {}).get("schema"))
        )
        assert set(told) <= set(named)


# A long text of a pattern takes a while to be drawn, on a busy machine longer than hypothesis likes: no fault of ours.
unhurried = settings(derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])


@unhurried
@given(st.from_regex(REGION_PATTERN, fullmatch=True))
def test_what_the_document_says_of_a_region_is_a_region(text: str) -> None:
    assert text == "" or len(parse_region(text)) >= 3


coordinates = st.floats(-1e6, 1e6) | st.integers(-(10**6), 10**6)


@unhurried
@given(st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=200))
def test_every_polygon_comes_through(points: list[tuple[float, float]]) -> None:
    assert parse_region(json.dumps(points)) == tuple(points)
