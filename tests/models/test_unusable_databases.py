"""Databases that are damaged, and places where none can be: refused with a reason, and left as they are."""

import os
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from models.errors import StoreDamaged, StoreUnavailable
from models.repository import Store
from tests.models.databases import PAGE, filled


@pytest.mark.parametrize("keep", [100, PAGE, 50 * PAGE, 50 * PAGE + 17])
def test_a_file_that_was_cut_off_is_refused(tmp_path: Path, keep: int) -> None:
    path = filled(tmp_path / "store.sqlite3")
    assert path.stat().st_size > keep
    os.truncate(path, keep)
    with pytest.raises(StoreDamaged):
        Store.open(path)


@pytest.mark.parametrize("page", [0, 1, 3])
def test_a_file_with_an_overwritten_page_is_refused(tmp_path: Path, page: int) -> None:
    path = filled(tmp_path / "store.sqlite3")
    with path.open("r+b") as file:
        file.seek(page * PAGE)
        file.write(b"\xa5" * PAGE)
    with pytest.raises(StoreDamaged):
        Store.open(path)


def test_a_file_that_is_something_else_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "store.sqlite3"
    path.write_text("Dear Sir or Madam, " * 1000)
    with pytest.raises(StoreDamaged):
        Store.open(path)
    assert path.read_text() == "Dear Sir or Madam, " * 1000


def test_tables_without_a_version_are_refused(tmp_path: Path) -> None:
    path = filled(tmp_path / "store.sqlite3")
    with sqlite3.connect(path) as connection:
        connection.execute("DROP TABLE alembic_version")
    connection.close()
    with pytest.raises(StoreDamaged, match="layout_models"):
        Store.open(path)


def test_a_document_that_is_not_one_is_an_error_of_the_store(tmp_path: Path) -> None:
    path = filled(tmp_path / "store.sqlite3")
    with sqlite3.connect(path) as connection:
        connection.execute(
            "UPDATE layout_model_versions SET document = substr(document, 1, 1000) WHERE version = 2"
        )
        connection.execute("UPDATE layout_model_versions SET document = x'00' WHERE version = 3")
    connection.close()
    with Store.open(path) as store:
        for version in (2, 3):
            with pytest.raises(StoreDamaged):
                store.model("letter", version)
        assert store.model("letter").version == 20


@contextmanager
def nobody() -> Iterator[None]:
    """Without root's right to write everywhere."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_a_folder_that_cannot_be_written() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        filled(folder / "there.sqlite3")
        folder.chmod(0o555)
        (folder / "there.sqlite3").chmod(0o444)
        try:
            with nobody():
                for path in (
                    folder / "new.sqlite3",
                    folder / "new" / "new.sqlite3",
                    folder / "there.sqlite3",
                ):
                    with pytest.raises(StoreUnavailable):
                        Store.open(path)
        finally:
            folder.chmod(0o755)
        assert [file.name for file in folder.iterdir()] == ["there.sqlite3"]


@pytest.mark.parametrize(
    "where",
    [
        "/dev/null/store.sqlite3",
        "sqlite://",
        "sqlite:///:memory:",
        "nonsense://x",
        "sqlite+none:///x",
        "mysql+pymysql://x",
        "postgresql://someone@/store?host=/dev/null",
    ],
)
def test_places_where_nothing_can_be_kept(where: str) -> None:
    with pytest.raises(StoreUnavailable):
        Store.open(where)


def test_a_folder_in_the_place_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(StoreUnavailable):
        Store.open(tmp_path)


def test_a_file_that_can_no_longer_be_written(tmp_path: Path) -> None:
    path = filled(tmp_path / "store.sqlite3")
    with Store.open(path) as store:
        store.models()
        with store._readers.connect() as connection:  # the one that the pool gives next
            connection.exec_driver_sql("PRAGMA query_only=ON")
        with pytest.raises(StoreUnavailable, match="readonly"):
            store.add_sample("letter", {"late": True})
        assert store.sample_count("letter") == 20
