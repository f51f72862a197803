"""What is stored can be read by its owner only."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from models.blobs import Blobs
from models.private_files import narrow
from models.repository import Store


@pytest.fixture(autouse=True)
def usual_umask() -> Iterator[None]:
    """Under which new files can be read by everybody."""
    before = os.umask(0o022)
    yield
    os.umask(before)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def modes(folder: Path) -> dict[str, int]:
    return {path.name: mode(path) for path in folder.iterdir()}


def test_a_new_store_is_for_its_owner(tmp_path: Path) -> None:
    data = tmp_path / "data"
    with Store.open(data / "s.sqlite3") as store:
        store.add_sample("letter", {"zones": []})
        Blobs("", data / "blobs").put("page-images/a", b"a", 10)
        assert modes(data) == {
            "s.sqlite3": 0o600,
            "s.sqlite3-wal": 0o600,
            "s.sqlite3-shm": 0o600,
            "blobs": 0o700,
        }
    assert mode(data) == 0o700
    with Store.open(tmp_path / "s.sqlite3"):
        assert mode(tmp_path / "s.sqlite3") == 0o600


def test_a_store_of_before_is_narrowed_and_its_folder_is_not(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    (tmp_path / "blobs").mkdir()
    with Store.open(tmp_path / "s.sqlite3") as before:
        before.add_sample("letter", {"zones": []})
        for path in tmp_path.iterdir():
            path.chmod(0o755 if path.is_dir() else 0o664)
        with Store.open(tmp_path / "s.sqlite3") as store:
            Blobs("", tmp_path / "blobs")
            assert store.sample_count("letter") == 1
            assert modes(tmp_path) == {
                "s.sqlite3": 0o600,
                "s.sqlite3-wal": 0o600,
                "s.sqlite3-shm": 0o600,
                "blobs": 0o700,
            }
    assert mode(tmp_path) == 0o755


def test_what_belongs_to_others_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "s.sqlite3"
    path.touch(0o644)
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    narrow(path)
    narrow(tmp_path / "missing")
    assert mode(path) == 0o644
