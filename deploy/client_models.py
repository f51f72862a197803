"""The types of answers and options of both clients, from the OpenAPI document: `make client-models`.

Writes `models.py` of clients/python (dataclasses) and `models.ts` of clients/typescript (by openapi-typescript). The
rules for Python are few, because the document has few forms: named objects, lists, rows of numbers, null, unions.
"""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Any

from app.main import create_app
from app.settings import Settings

ROOT = Path(__file__).parent.parent
PYTHON = ROOT / "clients" / "python" / "document_rectification_client" / "models.py"
TYPESCRIPT = ROOT / "clients" / "typescript" / "src" / "models.ts"
OPENAPI_TYPESCRIPT = ROOT / "tests" / "end_to_end" / "node_modules" / ".bin" / "openapi-typescript"
ANSWERS = (
    "PlainPagesResult",
    "PlainMosaicResult",
    "LayoutResult",
    "DocumentResult",
    "StackResult",
    "JobStatus",
    "UploadState",
    "Problem",
)
"""What the clients answer; whatever these have in them comes along."""
OPTIONS = {
    "RectifyOptions": "RectifyForm",
    "MosaicOptions": "MosaicForm",
    "LayoutOptions": "LayoutForm",
}
"""Options of the forms whose work the clients ask for."""
_PLAIN_TYPES = {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None"}
_PLACE = "#/components/schemas/"
_HEAD = '''"""What the service answers. Made from its OpenAPI document; do not edit."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal, TypedDict
'''

Schema = dict[str, Any]


def answer_schemas() -> dict[str, Schema]:
    """The schemas of `ANSWERS` and of all that they refer to, by name, in alphabetical order."""
    schemas = create_app(Settings()).openapi()["components"]["schemas"]
    found: set[str] = set()
    wanted = list(ANSWERS)
    while wanted:
        name = wanted.pop()
        if name not in found:
            found.add(name)
            wanted += re.findall(rf'"{_PLACE}(\w+)"', json.dumps(schemas[name]))
    return {name: _untitled(schemas[name]) for name in sorted(found)}


def option_schemas() -> dict[str, Schema]:
    """The schemas of `OPTIONS`: what a form takes beside its files, any of it; JSON may be written as it is."""
    schemas = create_app(Settings()).openapi()["components"]["schemas"]
    made = {}
    for name, form in OPTIONS.items():
        parts = {
            key: _option(each) for key, each in schemas[form]["properties"].items() if not _is_file(key, each)
        }
        made[name] = {"type": "object", "description": f"Options of {form}.", "properties": parts}
    return made


def _is_file(name: str, schema: Schema) -> bool:
    """Whether a part of a form is a file, or stands for one."""
    return name in ("upload", "kept_page") or "binary" in (
        schema.get("format"),
        schema.get("items", {}).get("format"),
    )


def _option(schema: Schema) -> Schema:
    """An option without its bounds and its default. A text that is JSON may be a list, an object or a number."""
    kinds: Schema = {key: schema[key] for key in ("type", "enum") if key in schema}
    pattern, text = schema.get("pattern", ""), {"type": "string"}
    if pattern.startswith(r"^(\["):
        kinds = {"anyOf": [text, {"type": "array", "items": {}}]}
    elif "contentMediaType" in schema:
        kinds = {"anyOf": [text, {"type": "object", "additionalProperties": {}}]}
    elif kinds == text and re.search(r"auto\|(0|\[0-9\])", pattern):
        kinds = {"anyOf": [text, {"type": "integer"}]}
    return {**kinds, **{key: schema[key] for key in ("description",) if key in schema}}


def _untitled(schema: Any) -> Any:
    """The schema without titles, which only repeat names. A property may be named `title`."""
    if isinstance(schema, list):
        return [*map(_untitled, schema)]
    if not isinstance(schema, dict):
        return schema
    return {key: _untitled(each) for key, each in schema.items() if (key, type(each)) != ("title", str)}


def python_of(schemas: dict[str, Schema], options: dict[str, Schema]) -> str:
    """The module with one dataclass for each schema, and one dictionary for each of the options.

    `format` is a parameter of methods that answer files; the others answer JSON.

    Raises
    ------
    KeyError
        When a schema has a form without a rule.
    """
    lines = [_HEAD]
    for name, schema in schemas.items():
        lines += ["", "@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)", f"class {name}:"]
        lines += [*_docstring(schema.get("description", name)), ""]
        required = schema.get("required", ())
        for key, each in schema["properties"].items():
            lines += _field(key, each, key in required)
    for name, schema in options.items():
        lines += ["", f"class {name}(TypedDict, total=False):", *_docstring(schema["description"]), ""]
        for key, each in schema["properties"].items():
            if key != "format":
                lines += [f"    {key}: {_type(each)} | None"]
                lines += _docstring(each["description"]) if "description" in each else []
    return _formatted("\n".join(lines) + "\n")


def _field(key: str, schema: Schema, is_required: bool) -> Iterator[str]:
    """Its lines. A name that Python keeps for itself gets an underscore."""
    kind = _type(schema)
    default = ""
    if not is_required:
        if "const" in schema:
            default = f" = {schema['const']!r}"
        elif schema.get("default") == []:
            default = " = dataclasses.field(default_factory=list)"
        elif isinstance(schema.get("default"), str):
            default = f" = {schema['default']!r}"
        else:
            kind, default = f"{kind.removesuffix(' | None')} | None", " = None"
    yield f"    {key}{'_' if key == 'class' else ''}: {kind}{default}"
    if "description" in schema:
        yield from _docstring(schema["description"])


def _type(schema: Schema) -> str:
    match schema:
        case _ if not schema:
            kind = "Any"
        case {"$ref": place}:
            kind = str(place).removeprefix(_PLACE)
        case {"anyOf": options} | {"oneOf": options}:
            kind = " | ".join(map(_type, options))
        case {"const": value}:
            kind = f"Literal[{value!r}]"
        case {"enum": values}:
            kind = f"Literal[{', '.join(map(repr, values))}]"
        case {"prefixItems": items}:
            kind = f"tuple[{', '.join(map(_type, items))}]"
        case {"type": "array", "items": item}:
            kind = f"list[{_type(item)}]"
        case {"type": "object", "additionalProperties": item}:
            kind = f"dict[str, {_type(item)}]"
        case _:
            kind = _PLAIN_TYPES[schema["type"]]
    return kind


def _docstring(text: str) -> list[str]:
    quoted = '"""' + " ".join(text.split()).replace("\\", "\\\\") + '"""'
    return fill(quoted, 110, initial_indent="    ", subsequent_indent="    ").splitlines()


def _formatted(source: str) -> str:
    ruff = [sys.executable, "-m", "ruff", "format", "--stdin-filename", str(PYTHON), "-"]
    return subprocess.run(ruff, input=source, capture_output=True, text=True, check=True).stdout


def typescript_of(schemas: dict[str, Schema]) -> str:
    """The types that openapi-typescript makes of the schemas, each exported by its own name."""
    document = {
        "openapi": "3.1.0",
        "info": {"title": "answers", "version": "1"},
        "paths": {},
        "components": {"schemas": schemas},
    }
    with TemporaryDirectory() as folder:
        source, made = Path(folder) / "answers.json", Path(folder) / "models.ts"
        source.write_text(json.dumps(document), encoding="utf-8")
        options = ("--root-types", "--root-types-no-schema-prefix", "-o", made)
        subprocess.run((OPENAPI_TYPESCRIPT, source, *options), capture_output=True, check=True)
        return made.read_text("utf-8")


if __name__ == "__main__":
    answers, options = answer_schemas(), option_schemas()
    PYTHON.write_text(python_of(answers, options), encoding="utf-8")
    if not OPENAPI_TYPESCRIPT.exists():
        sys.exit(
            "models.ts is not written: openapi-typescript is not installed (make typescript, which needs npm)."
        )
    TYPESCRIPT.write_text(typescript_of({**answers, **options}), encoding="utf-8")
