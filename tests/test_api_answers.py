"""The answers that docs/api/ shows: one of each operation, with the names and types of the OpenAPI document."""

import json
import re
import shlex
from functools import cache
from itertools import pairwise
from typing import Any

import jsonschema_rs
import pytest

from app.main import create_app
from app.settings import Settings
from deploy import api_answers, api_tables
from deploy.api_requests import REQUESTS, Request
from deploy.shown_answers import WIDTH, in_lines, shortened
from deploy.stable_answers import Stable, with_durations_of

CUT = {"type": "string", "pattern": r"\.\.\."}
"""What is shown in place of what was cut."""
OPEN = "LayoutModel"
"""What a service exports and imports as it is: its names are not in the document."""
SHOWN = {request.name: request for request in REQUESTS if request.operation}


@cache
def blocks() -> dict[str, tuple[str, str]]:
    """The page of each answer, and what it shows."""
    found = [
        (block["name"], page.name, block["block"])
        for page in api_tables.pages()
        for block in api_answers.BLOCK.finditer(page.read_text("utf-8"))
    ]
    assert len({name for name, _, _ in found}) == len(found)
    return {name: (page, block) for name, page, block in found}


@cache
def index() -> str:
    return api_tables.INDEX.read_text("utf-8")


@cache
def document() -> dict[str, Any]:
    described: dict[str, Any] = json.loads(json.dumps(create_app(Settings(api_keys=())).openapi()))
    return described


def described(operation: str) -> dict[str, Any]:
    """An operation of the OpenAPI document by its method and path."""
    method, path = operation.split()
    found: dict[str, Any] = document()["paths"][path][method.lower()]
    return found


def loosened(schema: Any) -> Any:
    """The schema for an answer that was cut: each value may be, and an object has no names but its own."""
    if isinstance(schema, list):
        return [loosened(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: loosened(each) for key, each in schema.items() if key not in {"minItems", "properties"}}
    for name in ("items", "additionalProperties"):
        if isinstance(kept.get(name), dict):
            kept[name] = {"anyOf": [kept[name], CUT]}
    if isinstance(kept.get("prefixItems"), list):
        kept |= {"prefixItems": [{"anyOf": [each, CUT]} for each in kept["prefixItems"]], "items": CUT}
    if isinstance(schema.get("properties"), dict):
        if schema.get("title") == OPEN:
            kept["additionalProperties"] = True
        properties = {name: {"anyOf": [loosened(each), CUT]} for name, each in schema["properties"].items()}
        kept = {"additionalProperties": False, **kept, "properties": properties}
    return kept


@cache
def loosened_components() -> Any:
    schemas = document()["components"]["schemas"]
    return {"schemas": {name: loosened(schema) for name, schema in schemas.items()}}


def misfits(operation: str, status: str, media_type: str, answer: Any) -> list[str]:
    """Where an answer that was cut does not fit the schema of its operation."""
    schema = loosened(described(operation)["responses"][status]["content"][media_type]["schema"])
    validator = jsonschema_rs.validator_for({**schema, "components": loosened_components()})
    return [f"{error.instance_path}: {error.message}" for error in validator.iter_errors(answer)]


def head_of(block: str) -> tuple[str, str]:
    """Status and media type that a block shows; no media type where there is no body."""
    found = re.search(r"^(\d{3}) [A-Z][\w ]+(?:, `([\w.+-]+/[\w.+-]+)`)?", block, re.MULTILINE)
    assert found, block
    return found[1], found[2] or ""


def test_every_operation_has_an_answer_and_every_answer_an_operation() -> None:
    operations = {f"{method.upper()} {path}" for path, each in document()["paths"].items() for method in each}
    assert {name.partition(", ")[0] for name in blocks()} == operations
    assert blocks().keys() == SHOWN.keys(), "make api-answers"


@pytest.mark.parametrize("request_", SHOWN.values(), ids=SHOWN)
def test_shown_answers_are_those_of_the_document(request_: Request) -> None:
    page, block = blocks()[request_.name]
    status, media_type = head_of(block)
    content = described(request_.operation)["responses"][status].get("content", {})
    assert media_type in content or (not media_type and status == "204"), content.keys()
    headers = {name for name in re.findall(r"`([A-Z][\w-]+): ", block.partition("\n\n```json")[0])}
    assert headers <= described(request_.operation)["responses"][status].get("headers", {}).keys()
    shown = api_answers.json_in(block)
    assert (shown is not None) == media_type.endswith("json")
    if shown is not None:
        assert misfits(request_.operation, status, media_type, shown) == []
    assert request_.case or f"(api/{page}#{api_tables.anchor_of(request_.operation)})" in index()
    assert f'<a id="{api_tables.anchor_of(request_.name)}"></a>' in block


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ('"sides_seen": 4', '"sides": 4', "'evidence'"),
        ('"width": 1383', '"width": "wide"', "'width'"),
        ('"kind": "curved",', "", '"kind"'),
        ('"image": null', '"image": null, "of_another_release": 1', "of_another_release"),
        ('"shadow_fraction": 0.0, ', "", "'quality'"),
    ],
)
def test_an_answer_of_another_release_is_found(old: str, new: str, where: str) -> None:
    _, block = blocks()["GET /pages/{id}"]
    assert block.count(old) == 1
    found = misfits(
        "GET /pages/{id}", "200", "application/json", api_answers.json_in(block.replace(old, new))
    )
    assert where in " ".join(found)


@pytest.mark.parametrize("request_", SHOWN.values(), ids=SHOWN)
def test_shown_requests_are_those_of_the_document(request_: Request) -> None:
    """The last curl of a command asks the operation, with parts that its form has."""
    _, block = blocks()[request_.name]
    command = request_.command.replace("URL", api_answers.SHOWN_URL)
    assert f"```sh\n{command}\n```" in block, "make api-answers"
    words = shlex.split(command.rpartition("curl ")[2])
    method, path = request_.operation.split()
    (url,) = (word.removeprefix(api_answers.SHOWN_URL) for word in words if word.startswith("http://"))
    asked = re.sub(r"\$\w+", "/id" if url.startswith("$") else "id", url.partition("?")[0])
    pattern = re.sub(r"\\{\w+\\}", "[^/]+", re.escape(path))
    assert re.fullmatch(pattern, asked) or url.startswith("$"), asked
    has_body = {"-F", "-d", "--data-binary"} & set(words)
    assert method == (words[words.index("-X") + 1] if "-X" in words else "POST" if has_body else "GET")
    parts = {word.partition("=")[0] for option, word in pairwise(words) if option == "-F"}
    if parts and not request_.refused:
        form = described(request_.operation)["requestBody"]["content"]["multipart/form-data"]["schema"]
        assert (
            parts <= document()["components"]["schemas"][form["$ref"].rpartition("/")[2]]["properties"].keys()
        )


def test_long_answers_are_cut_and_say_so() -> None:
    shown = shortened(
        {
            "box": [1, 2, 3, 4],
            "row": [0.12345678, 1, 2, 3, 4],
            "zones": [{}, {}, {}],
            "words": {str(number): number for number in range(20)},
            "text": "a" * 300,
        }
    )
    assert shown == {
        "box": [1, 2, 3, 4],
        "row": [0.123457, 1, 2, 3, "... 1 more"],
        "zones": [{}, "... 2 more"],
        "words": {"0": 0, "1": 1, "2": 2, "...": "... 17 more"},
        "text": "a" * 200 + "...",
    }
    assert shortened({"a": {"b": {"c": 1}}, "d": [{"e": 1}]}, 1) == {"a": "{...}", "d": ["{...}"]}


def test_json_is_shown_in_lines_that_can_be_read() -> None:
    value = {
        "names": {f"name-{number}": number / 7 for number in range(30)},
        "empty": {},
        "list": [[1, 2], None],
    }
    lines = in_lines(value)
    assert json.loads(lines) == value
    assert max(map(len, lines.splitlines())) <= WIDTH
    assert len(lines.splitlines()) == 15


def test_what_changes_by_itself_stays() -> None:
    stable, first, second = Stable(), "01M8D4JHAVXABWFQWQ7YBVV0VB", "01M8D4JHAVXABWFQWQ810R2Y93"
    shown = stable.text(f'{{"id":"{first}","of":"{second}","at":"2026-01-02T03:04:05.678901Z"}}')
    assert shown == Stable().text(f'{{"id":"{second}","of":"{first}","at":"2026-02-02T00:00:00Z"}}')
    assert stable.text(f"{first} {second}").split() == [json.loads(shown)["id"], json.loads(shown)["of"]]
    old = {"pages": [{"timings_ms": {"a": 1.0}}], "timings_ms": {"b": 2.0}}
    new = {"pages": [{"timings_ms": {"a": 3.0}}, {}], "timings_ms": {"c": 4.0}}
    assert with_durations_of(new, old) == {
        "pages": [{"timings_ms": {"a": 1.0}}, {}],
        "timings_ms": {"c": 4.0},
    }
