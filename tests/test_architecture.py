"""The import rules of the house, held against the code's own imports."""

import ast
import functools
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ARRAYS = ("numpy", "cv2", "PIL", "scipy", "pillow_heif", "img2pdf", "pikepdf", "pypdfium2")
HTTP = ("fastapi", "starlette", "uvicorn", "httpx", "pydantic_settings", "prometheus_client")
SQL = ("sqlalchemy", "alembic", "sqlite3")
ESTIMATORS = ("services.rectify", "services.mosaic", "services.layout")
SHEET = ("services.sheet",)

RULES = [
    # (who, may not import, but may)
    ("app", ("simulation", "benchmarks", "tests", *ARRAYS), ()),
    # Of what workers run the server knows the contract: plain data, and names of operations.
    (
        "app",
        ("services",),
        (
            "services.contract",
            "services.errors",
            "services.progress",
            "services.deadline",
            "services.heap",
            "services.side_by_side",
            "services.layout.content.content_settings",
        ),
    ),
    ("services/contract", ("services", "models", *ARRAYS, *HTTP, *SQL), ("services.contract",)),
    # The store's door is its repository; no table and no session comes through it.
    (
        "app",
        ("models", *SQL),
        (
            "models.repository",
            "models.records",
            "models.feedback_records",
            "models.errors",
            "models.blobs",
            "models.job_records",
        ),
    ),
    ("app/engine", (*HTTP, "pydantic", "app"), ("app.engine",)),
    (
        "app/schemas",
        ("app.routes", "app.engine", "app.main", "services"),
        ("services.contract", "services.errors"),
    ),
    ("services", ("app", "simulation", "benchmarks", "tests", "models", *HTTP, *SQL), ()),
    (
        "services/geometry",
        (*ESTIMATORS, *SHEET, "services.imaging", "services.texture_flow", "services.ocr"),
        (),
    ),
    ("services/imaging", (*ESTIMATORS, *SHEET, "services.texture_flow", "services.ocr"), ()),
    ("services/texture_flow", (*ESTIMATORS, *SHEET, "services.ocr"), ()),
    ("services/ocr", (*ESTIMATORS, *SHEET, "services.texture_flow"), ()),
    ("services/sheet", (*ESTIMATORS, "services.ocr", "services.operations"), ()),
    # Sub-packages know nothing of the whole pages that are put together from them.
    ("services/sheet/outline", SHEET, ("services.sheet.outline",)),
    ("services/sheet/developable", SHEET, ("services.sheet.developable",)),
    ("services/sheet/tracing", SHEET, ("services.sheet.tracing", "services.sheet.developable.observations")),
    # A creased sheet explains the same observations as a smooth one.
    ("services/sheet/ridged", SHEET, ("services.sheet.ridged", "services.sheet.developable.observations")),
    (
        "services/sheet/plane",
        SHEET,
        (
            "services.sheet.plane",
            "services.sheet.tracing",
            "services.sheet.outline",
            "services.sheet.developable.observations",
            "services.sheet.evidence",
            "services.sheet.shape",
            "services.sheet.surfaces",
        ),
    ),
    ("services/rectify", ("services.mosaic", "services.layout", "services.operations"), ()),
    (
        "services/capture",
        (*ESTIMATORS, *SHEET, "services.texture_flow", "services.ocr", "services.operations"),
        (),
    ),
    # Text and documents are of any flat page.
    (
        "services/text",
        (*ESTIMATORS, *SHEET, "services.imaging", "services.texture_flow", "services.documents"),
        ("services.layout.exchange",),
    ),
    ("services/documents", (*ESTIMATORS, *SHEET, "services.texture_flow", "services.operations"), ()),
    ("services/mosaic", ("services.layout", "services.operations"), ()),
    ("services/layout", ("services.rectify", "services.mosaic", "services.operations"), ()),
    ("models", ("app", "services", "simulation", "benchmarks", "tests"), ("services.contract",)),
    ("simulation", ("app", "services", "models", "benchmarks", "tests"), ()),
    # The dissertation's chain builds on the product's evidence, and the steps of the chain on those before them.
    (
        "benchmarks/dissertation_chain",
        ("app", "models", "simulation", "tests", "benchmarks", *ESTIMATORS, *SHEET),
        ("benchmarks.dissertation_chain", "services.sheet.evidence", "services.sheet.surfaces"),
    ),
    ("benchmarks/dissertation_chain/rulings", ("benchmarks.dissertation_chain.strips", *SHEET), ()),
]
ONLY_IN = [
    # (module, the only places that may import it)
    ("sqlalchemy", ("models/",)),
    ("alembic", ("models/",)),
    ("obstore", ("models/",)),
    ("fastapi", ("app/",)),
    ("starlette", ("app/",)),
    # Of the services only answers and the form of model documents need it.
    ("pydantic", ("app/", "services/contract/answers/", "services/layout/model/model_document.py")),
]


@functools.cache
def sources(folder: str) -> list[Path]:
    return sorted(path for path in (ROOT / folder).rglob("*.py") if "__pycache__" not in path.parts)


@functools.cache
def imports(path: Path) -> tuple[str, ...]:
    """Dotted names that a module imports, wherever in it."""
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            assert node.module is not None
            found += (f"{node.module}.{alias.name}" for alias in node.names)
    return tuple(found)


def within(name: str, packages: tuple[str, ...]) -> bool:
    return any(name == package or name.startswith(package + ".") for package in packages)


@pytest.mark.parametrize(
    ("who", "forbidden", "allowed"), RULES, ids=[f"{rule[0]}-{rule[1][0]}" for rule in RULES]
)
def test_imports_run_one_way(who: str, forbidden: tuple[str, ...], allowed: tuple[str, ...]) -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in sources(who)
        for name in imports(path)
        if within(name, forbidden) and not within(name, allowed)
    ]
    assert wrong == []


def test_only_main_imports_routes() -> None:
    """What routes share with other rooms has a room of its own."""
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in sources("app")
        for name in imports(path)
        if within(name, ("app.routes",)) and path.parent.name != "routes" and path.name != "main.py"
    ]
    assert wrong == []


def test_the_app_has_rooms() -> None:
    """At most a dozen modules lie in none of them."""
    assert len(list((ROOT / "app").glob("*.py"))) <= 12


@pytest.mark.pipeline
def test_the_server_loads_no_arrays() -> None:
    """Neither directly nor through what it imports: that is for the workers."""
    loaded = subprocess.run(
        [sys.executable, "-c", "import sys, app.main; print(*sys.modules)"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert {name.partition(".")[0] for name in loaded.stdout.split()}.isdisjoint(ARRAYS)


@pytest.mark.parametrize("package", ["layout", "rectify", "sheet"])
def test_rooms_of_a_package_import_each_other_one_way(package: str) -> None:
    """`graphlib` refuses a cycle, and names it."""
    folder = ROOT / "services" / package
    rooms = {room.name for room in folder.iterdir() if (room / "__init__.py").exists()}
    needs = {
        room: {
            name.split(".")[2]
            for path in sources(f"services/{package}/{room}")
            for name in imports(path)
            if name.startswith(f"services.{package}.")
        }
        & (rooms - {room})
        for room in rooms
    }
    assert set(TopologicalSorter(needs).static_order()) == rooms


@pytest.mark.parametrize(("module", "places"), ONLY_IN, ids=[rule[0] for rule in ONLY_IN])
def test_some_libraries_have_one_place(module: str, places: tuple[str, ...]) -> None:
    wrong = [
        str(path.relative_to(ROOT))
        for folder in ("app", "services", "models", "simulation", "benchmarks")
        for path in sources(folder)
        for name in imports(path)
        if within(name, (module,)) and not str(path.relative_to(ROOT)).startswith(places)
    ]
    assert wrong == []


def test_only_the_codec_decodes_and_encodes() -> None:
    calls = {"imread", "imdecode", "imwrite", "imencode"}
    wrong = [
        f"{path.relative_to(ROOT)}: {node.attr}"
        for path in sources("services")
        for text in [path.read_text(encoding="utf-8")]
        if path.relative_to(ROOT).parts[:2] != ("services", "imaging") and any(map(text.count, calls))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Attribute) and node.attr in calls
    ]
    assert wrong == []


def test_only_problems_knows_status_codes() -> None:
    """No number of HTTP's errors anywhere else in `app`, but 499 in the log, of a client that left.

    A named number of a module is something else (how many pages, how many bytes), unless its name says status.
    """

    def named(tree: ast.Module) -> set[int]:
        values = [
            node.value
            for node in tree.body
            if isinstance(node, ast.Assign)
            and all(
                isinstance(name, ast.Name) and name.id.isupper() and "STATUS" not in name.id
                for name in node.targets
            )
        ]
        return {id(value) for value in values}

    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {node.value}"
        for path in sources("app")
        if path.name not in {"problems.py", "settings.py"} and path.parent.name != "schemas"
        for tree in [ast.parse(path.read_text(encoding="utf-8"))]
        for numbers in [named(tree)]
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and type(node.value) is int
        and 400 <= node.value < 600
        and node.value != 499
        and id(node) not in numbers
    ]
    assert wrong == []


def test_no_room_for_leftovers() -> None:
    names = {"utils", "helpers", "common", "manager", "core", "misc"}
    folders = ("app", "services", "models", "simulation", "benchmarks")
    assert [path for folder in folders for path in sources(folder) if path.stem in names] == []


@pytest.mark.parametrize("folder", ["app", "services", "models", "simulation"])
def test_the_rules_see_the_code(folder: str) -> None:
    assert sources(folder)
