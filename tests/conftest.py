"""What kind of test each one is, by its folder; photos that several tests use; what this machine cannot test."""

import gc
import os
import shutil
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path

import httpx
import pytest
from httpx._transports import default as httpx_transport
from hypothesis import settings
from hypothesis.internal.conjecture import providers

from services.ocr.tesseract import find_tessdata
from simulation.flat_page import Page
from tests.counts import IS_LONG
from tests.end_to_end.accessibility import HAS_AXE
from tests.end_to_end.browser import CHROMIUM
from tests.end_to_end.openapi_generator import HAS_GENERATOR
from tests.end_to_end.typescript import HAS_TYPESCRIPT
from tests.fork_server import load_for_workers
from tests.models.databases import KINDS
from tests.services.scenes import Album

# The time of one example says nothing on a busy machine; the same examples run every time.
settings.register_profile("laws", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("laws")
# Hypothesis also tries constants of the modules that are loaded, which are others in each process of a run.
providers._get_local_constants = lambda: providers._local_constants
# Each client of httpx reads all certificates that it trusts: 20 ms, which each look at a service would cost.
vars(httpx_transport)["create_ssl_context"] = cache(httpx.create_ssl_context)

ROOT = Path(__file__).parent
KIND_OF_FOLDER = {
    "app": "service",
    "benchmarks": "pipeline",
    "clients": "service",
    "end_to_end": "end_to_end",
    "models": "service",
    "services/layout/discovery": "pipeline",
}
"""Tests of all other folders are fast, but for those that say that they are of a pipeline."""
PIPELINE_FIXTURES = {"album"}
"""Who uses one of these simulates and analyses whole photos."""


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out folders without fast tests where only these are wanted: collecting them takes half of the time."""
    return _is_left_out(collection_path, config) or None


def _is_left_out(path: Path, config: pytest.Config) -> bool:
    folders = [ROOT / folder for folder in KIND_OF_FOLDER]
    return config.option.markexpr == "fast" and any(path.is_relative_to(folder) for folder in folders)


def pytest_configure() -> None:
    """While tests are collected nothing goes that was made, and looking for it took a third of the time."""
    gc.disable()
    load_for_workers()


def pytest_sessionstart(session: pytest.Session) -> None:
    """Import the test modules of a whole run, each process from another one on.

    Rewriting assertions takes longer than importing. Who comes second to a module reads what the first one kept.
    """
    number_of = getattr(session.config, "workerinput", None)
    if number_of is None or session.config.args_source is not pytest.Config.ArgsSource.TESTPATHS:
        return
    modules = [path for path in sorted(ROOT.rglob("test_*.py")) if not _is_left_out(path, session.config)]
    first = int(number_of["workerid"].removeprefix("gw")) * len(modules) // number_of["workercount"]
    for path in modules[first:] + modules[:first]:
        with suppress(Exception):  # collection tells
            import_module(".".join(path.relative_to(ROOT.parent).with_suffix("").parts))


def pytest_make_parametrize_id(val: object) -> str | None:
    """Long values are named by their beginning: processes send names to and fro, and hostile files are megabytes."""
    return ascii(val[:60]) if isinstance(val, str | bytes) and len(val) > 200 else None


def pytest_collection_finish() -> None:
    """From now on garbage is looked for, but not among what modules and tests hold to the end."""
    gc.enable()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)  # pytest-xdist reads the groups in the same hook
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give each test the marker of its kind, and have one process run all tests of a module.

    Whatever uses the album is run by one process, so that no photo is made and analysed twice. So is every module that
    uses the product's process, whose start takes four seconds.
    """
    of_product = {item.path for item in items if "product" in getattr(item, "fixturenames", ())}
    for item in items:
        module = item.path.relative_to(ROOT)
        uses = PIPELINE_FIXTURES & set(getattr(item, "fixturenames", ()))
        group = "album" if uses else "product" if item.path in of_product else module.as_posix()
        item.add_marker(pytest.mark.xdist_group(group))
        folders = {parent.as_posix() for parent in module.parents}
        kind = next((kind for folder, kind in KIND_OF_FOLDER.items() if folder in folders), None)
        if kind is None:
            kind = "pipeline" if uses or item.get_closest_marker("pipeline") else "fast"
        item.add_marker(kind)


@pytest.fixture(scope="session")
def album() -> Album:
    """Simulated photos by name."""
    return Album()


@pytest.fixture(scope="session")
def pages(album: Album) -> tuple[Page, ...]:
    """The five pages of our own setting, 800 x 1250 px, 21 px to the em."""
    return album.pages()


def untested() -> list[str]:
    """What the tests leave out on this machine, with the reason."""
    missing = []
    if "postgresql" not in KINDS:
        missing.append("The store on PostgreSQL: its programs are not installed (Debian: postgresql).")
    if CHROMIUM is None:
        missing.append("A real browser: Chromium is not installed (Debian: chromium).")
    if not HAS_AXE:
        missing.append("Accessibility of the page: axe-core is not installed (make typescript).")
    if not HAS_TYPESCRIPT:
        missing.append("TypeScript types and client: openapi-typescript is not installed (make typescript).")
    if IS_LONG and not HAS_GENERATOR:
        missing.append("Clients in Kotlin and Swift: no openapi-generator or Java (make venv-dev java).")
    if shutil.which("curl") is None:
        missing.append("The commands of README.md and docs/api: curl is not installed (Debian: curl).")
    if find_tessdata("eng") is None:
        missing.append("OCR with Tesseract: its language data are not installed (Debian: tesseract-ocr-eng).")
    return missing


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say last, and loudly, what was not tested."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        return
    for line in untested():
        terminalreporter.write_line(f"NOT TESTED  {line}", red=True, bold=True)
