"""Clients for phones, in Kotlin and Swift, by openapi-generator: they are read, since no compiler is at hand."""

import json
import re
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator

import pytest

from app.main import create_app
from app.settings import Settings
from tests.end_to_end.openapi_generator import ARCHIVE, NEEDS_GENERATOR

QUICK = ("-XX:TieredStopAtLevel=1", "-XX:+UseSerialGC")
"""For a program of seconds: only its first compiler, and no threads that collect garbage."""
ENDINGS = {"kotlin": ".kt", "swift6": ".swift"}
COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
LIST = re.compile(r"\b(?:(?:fun|func|class)\s+(?:<[^>]*>\s*)?(\w+)|(init))\s*\(")
"""Up to the parameters of a function, or the properties of a class."""
UNTYPED = re.compile(r"\b(?:Any|AnyCodable|JSONValue)\b")
"""What stands where a generator knows no type."""
OWN_NAMES = re.compile(r"(?:Plain\w+|Point|Vector|Box|Problem|JobStatus)$")
"""Models of the operations of one answer, and of what all operations answer."""


def code_of(source: str) -> str:
    """The source without its comments; a text is no comment, though it may hold `//`."""
    return COMMENT.sub("", re.sub(r'"(?:\\.|[^"\\\n])*"', '""', source))


def lists_of(code: str) -> Iterator[tuple[str, list[str]]]:
    """Name of each function or class with a list in parentheses, and the names that the list declares."""
    for match in LIST.finditer(code):
        depth, part, names = 1, "", []
        for sign in code[match.end() :].replace("->", "  "):
            depth += (sign in "([<{") - (sign in ")]>}")
            if depth == 0 or (depth == 1 and sign == ","):
                declared = re.search(r"(\w+)`?\s*:(?!:)", re.sub(r"@[\w.:]+(\([^)]*\))?", "", part))
                names += [declared[1]] if declared else []
                part = ""
            else:
                part += sign
            if depth == 0:
                break
        yield match[1] or match[2], names


def doubles_of(code: str) -> list[str]:
    """`place.name` of what is declared more than once in one list.

    Such a source does not compile. Newer generators call the second one `name2`.
    """
    return [
        f"{place}.{name}"
        for place, names in lists_of(code)
        for name, times in Counter(name.removesuffix("2") for name in names).items()
        if times > 1
    ]


@pytest.mark.parametrize(
    ("source", "doubles"),
    [
        ("fun send(image: File, format: String?, format: Format? = Format.pdf): File", ["send.format"]),
        ('data class Page (@Json(name = "id")\n val id: Int, @Json(name = "id") val `id`: Int)', ["Page.id"]),
        ("fun send(format: Format?, title: String?, format2: Format?)", ["send.format"]),
        ("fun <T> map(a: (T) -> Int, b: Map<a, T>, c: String /* a: Int, a: Int */): T", []),
        ("class func pay(image: [URL], image: [URL]) async throws -> String", ["pay.image"]),
        ("public init(x: Double, y: Double) { self.x = x }\nfunc f(x: Double) {}", []),
    ],
)
def test_double_declarations_are_found(source: str, doubles: list[str]) -> None:
    assert doubles_of(code_of(source)) == doubles


def test_untyped_values_are_found() -> None:
    assert UNTYPED.search(code_of("val box: kotlin.collections.List<kotlin.Any?>,"))
    assert UNTYPED.search(code_of("public var box: [JSONValue]"))
    assert not UNTYPED.search(code_of("/* Any */ val any: Anything = of() // Any"))


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, str]]:
    """Makes a client for a language: the code of its models and operations by their names."""
    folder = tmp_path_factory.mktemp("mobile")
    document = create_app(Settings(api_keys=(), workers=1)).openapi()
    (folder / "openapi.json").write_text(json.dumps(document), encoding="utf-8")

    def make(language: str) -> dict[str, str]:
        assert ARCHIVE is not None
        made = subprocess.run(
            [
                "java",
                *QUICK,
                "-jar",
                ARCHIVE,
                "generate",
                "-g",
                language,
                "-i",
                "openapi.json",
                "-o",
                language,
            ],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        assert made.returncode == 0, made.stdout[-2000:] + made.stderr[-2000:]
        paths = (folder / language).rglob(f"*{ENDINGS[language]}")
        parts = (path for path in paths if path.parent.name.lower() in ("models", "apis"))
        return {path.stem: code_of(path.read_text("utf-8")) for path in parts if "test" not in path.parts}

    return make


@NEEDS_GENERATOR
@pytest.mark.long
@pytest.mark.parametrize("language", ENDINGS)
def test_a_client_for_phones_has_no_doubles_and_types_for_all_that_is_plain(
    generated: Callable[[str], dict[str, str]], language: str
) -> None:
    sources = generated(language)
    assert {name: doubles for name, code in sources.items() if (doubles := doubles_of(code))} == {}
    plain = {name: code for name, code in sources.items() if OWN_NAMES.match(name)}
    assert {"PlainRectifyResult", "PlainMosaicResult", "Point", "Box"} <= set(plain)
    assert [name for name, code in plain.items() if UNTYPED.search(code)] == []
    answers = dict(lists_of(sources["RectifyApi" if language == "kotlin" else "RectifyAPI"]))
    assert {"image", "text", "format", "corners"} <= set(answers["rectifyToPdf"])
