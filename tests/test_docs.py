"""The pages keep to the code: names that they write exist, links lead somewhere, options have their rows."""

import re
from functools import cache
from pathlib import Path

import pytest
from pydantic import BaseModel

from app.http.problems import STATUS_OF_CODE
from app.schemas.layout import LayoutForm
from app.schemas.mosaic import MosaicForm
from app.schemas.rectify import RectifyForm
from benchmarks.__main__ import MODULES
from deploy import api_tables

ROOT = Path(__file__).parent.parent
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text("utf-8")
DECISIONS = ROOT / "docs" / "decisions"
MOST_WORDS = 1200
"""Of a page that is read whole."""
PAGES = [
    *ROOT.glob("*.md"),
    *(page for folder in ("docs", "benchmarks", "deploy") for page in sorted((ROOT / folder).rglob("*.md"))),
]
SUPERSEDED = re.compile(
    r'uperseded (?:\([^)]+\) )?by "([^"]+)" \((\d{4}-\d\d-\d\d), (?:below|\[[\w-]+\]\(([\w-]+\.md)\))\)'
)


@cache
def code() -> tuple[frozenset[str], frozenset[str]]:
    """The names of all files of the code, and all words in them."""
    folders = ("app", "services", "models", "benchmarks", "tests")
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*.py") if path != Path(__file__)]
    words = {
        word for path in paths for word in re.findall(r"(?<=\")[a-z]+-[a-z-]+|\w+", path.read_text("utf-8"))
    }
    return frozenset(path.name for path in paths), frozenset(words)


def is_path(name: str, folders: tuple[str, ...]) -> bool:
    """Whether a file, a folder or a module of this name lies in one of the folders."""
    found = [ROOT / folder / f"{name.rstrip('/')}{end}" for folder in folders for end in ("", ".py")]
    return any(path.exists() for path in found)


def unknown_names(page: str) -> list[str]:
    """Names in backticks of a page that are no path, module, benchmark or name of the code.

    Short paths lie in the folder that the heading of their table names.
    """
    (files, words), unknown = code(), []
    for part in re.split(r"^(?=#|\| step)", page, flags=re.MULTILINE):
        named = re.search(r"^\| step \(modules in `(services/[a-z/]*)`\)", part)
        folders = ("", named[1]) if named else ("",)
        for name in re.findall(r"(?<!`)`([^`\n]+)`(?!`)", part):
            if command := re.fullmatch(r"python -m benchmarks (\w+)", name):
                known = command[1] in MODULES
            elif " " in name:
                continue  # other commands, requests
            elif "/" in name:
                known = is_path(name, folders)
            elif name.endswith((".py", ".md")):
                known = (ROOT / name).exists() or name in files
            else:
                known = name in words or is_path(name, folders)
            unknown += [] if known else [name]
    return unknown


@pytest.mark.parametrize("name", ["docs/architecture.md", "CHANGELOG.md"])
def test_pages_that_are_read_whole_are_short(name: str) -> None:
    assert len((ROOT / name).read_text("utf-8").split()) <= MOST_WORDS


def test_what_the_first_page_names_is_there() -> None:
    assert unknown_names(ARCHITECTURE) == []


@pytest.mark.parametrize(
    "name",
    ["app/nothing.py", "services/nowhere/", "nobody_calls_it_so", "python -m benchmarks none", "no.py"],
)
def test_what_is_not_there_is_found(name: str) -> None:
    assert unknown_names(f"# Page\nIt is in `{name}`.") == [name]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)\s]+)\)", page.read_text("utf-8"))
    inner = (link.partition("#")[0] for link in links if not re.match(r"[a-z]+:", link))
    assert [link for link in inner if link and not (page.parent / link).exists()] == []


def test_every_topic_of_decisions_is_in_the_index() -> None:
    listed = re.findall(
        r"^\| \[[\w-]+\]\(([\w-]+\.md)\) \|", (DECISIONS / "README.md").read_text(), re.MULTILINE
    )
    assert sorted(listed) == sorted(page.name for page in DECISIONS.glob("*.md") if page.name != "README.md")


def test_what_supersedes_a_decision_is_a_later_paragraph() -> None:
    marks = 0
    for page in DECISIONS.glob("*.md"):
        for title, date, other in SUPERSEDED.findall(page.read_text("utf-8")):
            text = (DECISIONS / (other or page.name)).read_text("utf-8")
            assert re.search(rf"^\*\*{date}:? {re.escape(title)}", text, re.MULTILINE), (page.name, title)
            marks += 1
    assert marks > 20


@pytest.mark.parametrize(
    ("form", "page"), [(RectifyForm, "rectify.md"), (MosaicForm, "mosaic.md"), (LayoutForm, "layout.md")]
)
def test_every_option_is_in_the_page_of_its_route(form: type[BaseModel], page: str) -> None:
    # What all three have for jobs has a page of its own.
    told = "".join((ROOT / "docs" / "api" / name).read_text("utf-8") for name in (page, "jobs.md"))
    assert [name for name in form.model_fields if f"`{name}`" not in told] == []


@pytest.mark.parametrize("name", api_tables.TABLES)
def test_the_tables_of_the_api_pages_are_those_of_the_code(name: str) -> None:
    assert api_tables.TABLES[name][0].read_text("utf-8") == api_tables.with_table(name), "make api-tables"


def test_every_page_of_the_reference_is_in_its_index() -> None:
    assert sorted(api_tables.pages()[1:]) == sorted((ROOT / "docs" / "api").glob("*.md"))


def test_what_is_told_beyond_limits_is_of_settings_and_codes() -> None:
    assert [name for name in api_tables.BEYOND if f"`{name.upper()}`" not in api_tables.limits()] == []
    told = {
        code for text in api_tables.BEYOND.values() for code in re.findall(r"`([a-z]+(?:-[a-z]+)*)`", text)
    }
    assert told <= set(STATUS_OF_CODE)


def test_links_to_sections_lead_to_headings() -> None:
    """By the names that GitHub makes of headings."""
    for target in {place for _, place in api_tables.SECTIONS}:
        name, _, anchor = target.partition("#")
        page = (ROOT / "docs" / name).read_text("utf-8")
        headings = re.findall(r"^#+ (.*)$", page, re.MULTILINE)
        slugs = [re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings]
        assert not anchor or anchor in slugs, target
