"""The OpenAPI document: FastAPI's, in a form from which generators make clients without warnings."""

import asyncio
import json
from collections.abc import Iterator, Mapping
from copy import deepcopy
from functools import cache
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.openapi.utils import get_openapi

from app.access.authentication import HEADER as API_KEY_HEADER
from app.access.authentication import OPEN_PATHS
from app.http.middleware import OPENAPI_PATH
from app.http.octets import OCTETS
from app.http.problems import documented
from app.openapi.examples import BODY_EXAMPLES, RESPONSE_EXAMPLES
from app.openapi.plain_answers import PLAIN_MOSAIC, PLAIN_PAGES
from app.schemas.layout_samples import PageBody
from services.contract.answers.problem import Problem

JSON = "application/json"
FORM = "multipart/form-data"
PROBLEM = "application/problem+json"
INFO = {
    "license": {"name": "Apache License 2.0", "identifier": "Apache-2.0"},
    "contact": {"name": "Whoever operates this service"},
}
_BINARY = "application/octet-stream"


def serve_description(app: FastAPI, tags: Mapping[str, str], *, keys: bool, root_path: str) -> None:
    """Serve the OpenAPI document (`describe`): made once, by the first request, in a thread."""

    @cache
    def openapi() -> dict[str, Any]:
        return describe(app, tags, keys=keys, root_path=root_path)

    @cache
    def text() -> str:
        return json.dumps(app.openapi(), ensure_ascii=False, separators=(",", ":"))

    async def answer(request: Request) -> Response:
        return Response(await asyncio.to_thread(text), media_type="application/json")

    app.openapi = openapi  # type: ignore[method-assign]
    app.add_route(OPENAPI_PATH, answer, include_in_schema=False)


def describe(app: FastAPI, tags: Mapping[str, str], *, keys: bool, root_path: str) -> dict[str, Any]:
    """The OpenAPI document of `app`.

    Parameters
    ----------
    app
        The app with all its routes.
    tags
        Meaning of each tag.
    keys
        Whether API keys are configured; else requests need none.
    root_path
        Prefix of all paths, as clients see them.
    """
    document = get_openapi(
        title=app.title,
        version=app.version,
        summary=app.summary,
        routes=app.routes,
        tags=[{"name": name, "description": meaning} for name, meaning in tags.items()],
        servers=[{"url": root_path}] if root_path else None,
    )
    components = document.setdefault("components", {})
    schemas = components.setdefault("schemas", {})
    document["info"] |= INFO
    document.setdefault("servers", [{"url": "/"}])
    _describe_keys(document, needed=keys)
    for _, operation in operations_of(document):
        _leave_out_doubles(operation, schemas)
        _describe_problems(operation)
        _add_examples(operation)
        _put_json_first(operation)
        _offer_bytes(operation)
    for foreseen in ("HTTPValidationError", "ValidationError"):
        schemas.pop(foreseen, None)
    schemas["Problem"] = Problem.model_json_schema()
    page = PageBody.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas |= {**page.pop("$defs"), "PageBody": page}
    for plain in (PLAIN_PAGES, PLAIN_MOSAIC):
        schemas |= plain.components()
    _name_schemas(document)
    _simplify(document)
    return document


def operations_of(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Path and description of each operation in the document."""
    for path, methods in document["paths"].items():
        for operation in methods.values():
            yield path, operation


def _describe_problems(operation: dict[str, Any]) -> None:
    """Remove FastAPI's validation response, which is never sent; add that of an unknown query option."""
    responses = operation["responses"]
    if "HTTPValidationError" in str(responses.get("422")):
        del responses["422"]
    for status, response in documented("invalid-option").items():
        responses.setdefault(str(status), response)


def _leave_out_doubles(operation: dict[str, Any], schemas: Mapping[str, Any]) -> None:
    """Leave out query options that are parts of the form as well: generators declare both by one name.

    The query is still read: who writes a command puts `?format=` there.
    """
    form = operation.get("requestBody", {}).get("content", {}).get(FORM, {}).get("schema", {})
    if "$ref" in form:
        form = schemas[form["$ref"].rpartition("/")[2]]
    if "parameters" in operation:
        parts = form.get("properties", {})
        operation["parameters"] = [each for each in operation["parameters"] if each["name"] not in parts]


def _describe_keys(document: dict[str, Any], *, needed: bool) -> None:
    """Say that every operation takes a key, and whether it is `needed`, except those of open paths."""
    document["components"]["securitySchemes"] = {
        "ApiKey": {"type": "apiKey", "in": "header", "name": API_KEY_HEADER},
        "Bearer": {"type": "http", "scheme": "bearer"},
    }
    for path, operation in operations_of(document):
        if path not in OPEN_PATHS:
            operation["security"] = [*([] if needed else [{}]), {"ApiKey": []}, {"Bearer": []}]
            refusals = documented("unauthorized", "forbidden")
            operation["responses"] |= {str(status): meaning for status, meaning in refusals.items()}


def _name_schemas(document: dict[str, Any]) -> None:
    """Move object schemas that have a title to the components; generators name classes by it."""
    schemas = document["components"]["schemas"]
    for _, operation in operations_of(document):
        parts = [operation.get("requestBody", {}), *operation["responses"].values()]
        for content in (content for part in parts for content in part.get("content", {}).values()):
            schema = content.get("schema", {})
            if schema.get("type") != "object" or "title" not in schema:
                continue
            text = json.dumps(schema).replace("#/$defs/", "#/components/schemas/")
            schema = json.loads(text)
            schemas |= schema.pop("$defs", {})
            schemas[schema["title"]] = schema
            content["schema"] = {"$ref": f"#/components/schemas/{schema['title']}"}


def _add_examples(operation: dict[str, Any]) -> None:
    """A short real example for the body and for the JSON response of the operation."""
    name = operation["operationId"]
    contents = operation.get("requestBody", {}).get("content", {})
    for media_type, content in contents.items():
        if name in BODY_EXAMPLES.get(media_type, {}):
            content["example"] = deepcopy(BODY_EXAMPLES[media_type][name])
    for status, response in operation["responses"].items():
        content = response.get("content", {})
        if status.startswith("2") and JSON in content and (status, name) in RESPONSE_EXAMPLES:
            content[JSON]["example"] = deepcopy(RESPONSE_EXAMPLES[status, name])
        elif PROBLEM in content:
            code = response["description"].split("`")[1]
            content[PROBLEM] = {
                **content[PROBLEM],
                "example": _problem_example(int(status), code, response["description"]),
            }


def _put_json_first(operation: dict[str, Any]) -> None:
    """Order the types of each response: generators take the first one that they know."""
    for response in operation["responses"].values():
        if JSON in response.get("content", {}):
            content = response["content"]
            response["content"] = {JSON: content.pop(JSON), **content}


def _offer_bytes(operation: dict[str, Any]) -> None:
    """Files may be asked for as bytes; generators leave out answers that have other media types only."""
    for response in operation["responses"].values():
        content = response.get("content", {})
        schemas = [each.get("schema", {}) for each in content.values()]
        if schemas and all(schema.get("format") == "binary" for schema in schemas):
            response["content"] = {OCTETS: {"schema": schemas[0]}, **content}


def _problem_example(status: int, code: str, description: str) -> dict[str, Any]:
    detail = description.split(f"`{code}`: ", 1)[1].split(" `", 1)[0]
    return {
        "type": "about:blank",
        "title": code.replace("-", " ").capitalize(),
        "status": status,
        "code": code,
        "detail": detail,
        "request_id": "7f3a9c0e5b1d4e8f",
    }


def _simplify(part: Any) -> None:
    """Change what generators misread, everywhere in `part`.

    Files are `format: binary`: generators and Swagger UI take FastAPI's `contentMediaType` for text. A form's
    condition on its parts (`anyOf` at its root) makes generators drop its fields; the description has it too.
    Integers have integral bounds, because generators print them. A parameter is absent and never null, and an integer
    is a number: a choice between both makes classes without a name.
    """
    if isinstance(part, list):
        for each in part:
            _simplify(each)
    if not isinstance(part, dict):
        return
    if part.get("type") == "string" and part.get("contentMediaType") == _BINARY:
        del part["contentMediaType"]
        part["format"] = "binary"
    if part.get("type") == "object" and "properties" in part and part.pop("anyOf", None):
        part["minProperties"] = 1
    if "in" in part and "anyOf" in part.get("schema", {}):
        part["schema"] = {
            **{key: value for key, value in part["schema"].items() if key != "anyOf"},
            **next(option for option in part["schema"]["anyOf"] if option.get("type") != "null"),
        }
    if [option.get("type") for option in part.get("anyOf", ())] == ["integer", "number"]:
        part["type"] = part.pop("anyOf")[1]["type"]
    if part.get("type") == "integer":
        for bound in ("minimum", "maximum"):
            if isinstance(part.get(bound), float):
                part[bound] = int(part[bound])
    for each in part.values():
        _simplify(each)
