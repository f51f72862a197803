"""Temporary files of a killed run are deleted by the next one, and those of a running service are not."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from app.run_folder import PREFIX, run_folder, sweep
from tests.end_to_end.forked import ROOT

KILLED = """
import os, signal, tempfile
import app.run_folder
from app.run_folder import run_folder
app.run_folder._LONGEST_PARENT = 1000
with run_folder() as folder:
    tempfile.NamedTemporaryFile(delete=False).write(b"left behind")
    print(folder, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(autouse=True)
def long_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """The folders of tests have long paths, and nothing here makes a socket."""
    monkeypatch.setattr("app.run_folder._LONGEST_PARENT", 1000)


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def test_what_a_killed_run_left_is_deleted(tmp_path: Path) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    killed = subprocess.run(
        [sys.executable, "-c", KILLED], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    left = Path(killed.stdout.strip())
    assert left.parent == tmp_path
    assert len(list(left.iterdir())) == 2  # the lock and the file
    with run_folder():
        assert not left.exists()


def test_folders_in_use_and_young_ones_stay(tmp_path: Path) -> None:
    young, old = tmp_path / f"{PREFIX}young", tmp_path / f"{PREFIX}old"
    young.mkdir()
    old.mkdir()
    os.utime(old, (time.time() - 1000,) * 2)
    other = tmp_path / "somebody-else"
    other.mkdir()
    with run_folder() as folder:
        assert Path(tempfile.mkdtemp()).parent == folder
        sweep(tmp_path)
        assert folder.exists()
        assert young.exists()
        assert other.exists()
        assert not old.exists()
    assert not folder.exists()


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.mkdir()
    (target / "file").touch()
    (tmp_path / f"{PREFIX}link").symlink_to(target)
    os.utime(target, (0, 0))
    sweep(tmp_path)
    assert (target / "file").exists()
