"""docs/api/ names every code of a warning and an advice, and none that nothing sends."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from deploy import api_tables

ROOT = Path(__file__).parent.parent
DOCUMENT = api_tables.reference()


def calls(name: str) -> Iterator[ast.Call]:
    """Every call of the class `name` in the service."""
    for folder in ("services", "app"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            source = path.read_text("utf-8")
            if name not in source:
                continue  # parsing takes longer than all else
            for node in ast.walk(ast.parse(source)):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name:
                    yield node


def codes_of(name: str) -> set[str]:
    """First arguments of these calls, or `code`; all of them must be written out, or no test could name them."""
    codes = set()
    for call in calls(name):
        named = [keyword.value for keyword in call.keywords if keyword.arg == "code"]
        assert call.args or named, ast.unparse(call)
        code = named[0] if named else call.args[0]
        if isinstance(code, ast.Attribute) and code.attr == "code":
            continue  # a notice that is passed on
        assert isinstance(code, ast.Constant), ast.unparse(call)
        codes.add(code.value)
    return codes


def rows(heading: str) -> str:
    """The rows of the table below a heading row."""
    _, _, below = DOCUMENT.partition(heading)
    return below.partition("\n\n")[0]


def test_every_warning_has_a_row_and_every_row_a_warning() -> None:
    written = set(re.findall(r"^\| `([a-z-]+)` \|", rows("| warning | meaning"), re.MULTILINE))
    assert written == codes_of("Notice")


def test_every_advice_is_named() -> None:
    assert {code for code in codes_of("Advice") if f"`{code}`" not in DOCUMENT} == set()
