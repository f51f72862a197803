"""The answers' types of both clients, from the OpenAPI document: `make client-models`.

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
ANSWERS = ("PlainPagesResult", "PlainMosaicResult", "LayoutResult", "DocumentResult", "JobStatus", "Problem")
"""What the clients answer; whatever these have in them comes along."""
_PLAIN_TYPES = {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None"}
_PLACE = "#/components/schemas/"
_HEAD = '''"""What the service answers. Made from its OpenAPI document; do not edit."""

from __future__ import annotations

import dataclasses
from typing import Literal
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


def _untitled(schema: Any) -> Any:
    """The schema without titles, which only repeat names. A property may be named `title`."""
    if isinstance(schema, list):
        return [*map(_untitled, schema)]
    if not isinstance(schema, dict):
        return schema
    return {key: _untitled(each) for key, each in schema.items() if (key, type(each)) != ("title", str)}


def python_of(schemas: dict[str, Schema]) -> str:
    """The module with one dataclass for each schema.

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
    made = answer_schemas()
    PYTHON.write_text(python_of(made), encoding="utf-8")
    TYPESCRIPT.write_text(typescript_of(made), encoding="utf-8")
