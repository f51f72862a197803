"""The command `flatten`."""

import json
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from document_rectification_client import Client, File, Job, clients
from document_rectification_client.__main__ import main
from tests.app.scripts import upload
from tests.app.serving import POLL_S


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    pause = time.sleep
    monkeypatch.setattr(clients, "time", SimpleNamespace(sleep=lambda seconds: pause(POLL_S)))


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "photo.jpg"
    path.write_bytes(upload(""))
    return path


def test_the_ending_decides(
    url: str, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, content in (("a.PDF", "flat as pdf"), ("a.jpg", "flat as jpeg"), ("a.md", "flat as markdown")):
        assert main([str(photo), "-o", str(tmp_path / name), "--url", url]) == 0
        assert (tmp_path / name).read_text() == content
    assert "100% succeeded" in capsys.readouterr().err
    page = tmp_path / "a.json"
    assert main([str(photo), "-o", str(page), "--url", url, "--option", "illumination=bw"]) == 0
    assert json.loads(page.read_text())["pages"][0]["state"] == "flat"
    assert main([str(photo), str(photo), "-o", str(tmp_path / "m.png"), "--url", url, "--mosaic"]) == 0
    capsys.readouterr()
    assert main([str(photo), "-o", str(page), "--url", url, "--language", "no language"]) == 1
    assert "flatten: invalid-option: language" in capsys.readouterr().err


def test_errors_are_one_line(
    url: str, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "page.pdf"
    photo.write_bytes(upload("no-text"))
    assert main([str(photo), "-o", str(output), "--url", url]) == 1
    assert capsys.readouterr().err.splitlines()[-1].startswith("flatten: no-text: image: scripted no-text")
    assert main([str(tmp_path / "none.jpg"), "-o", str(output), "--url", url]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"flatten: {tmp_path / 'none.jpg'}: No such file or directory"
    ]
    assert main([str(photo), "-o", str(output), "--url", "http://127.0.0.1:1"]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("flatten: unreachable: ")
    assert not output.exists()


@pytest.mark.parametrize(
    "more",
    [
        ["-o", "page.gif"],
        ["-o", "no folder/page.pdf"],
        ["-o", "a.pdf", "--option", "bw"],
        ["-o", "a.pdf", "--url", "127.0.0.1:8000"],
        [],
    ],
)
def test_what_cannot_be_meant_is_usage(more: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["photo.jpg", *more])
    assert caught.value.code == 2


def test_who_interrupts_wants_the_work_no_more(
    url: str, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    photo.write_bytes(upload(f"wait {tmp_path}"))
    jobs: list[Job[File]] = []

    def interrupt(client: Client, job: Job[File], progress: object) -> File:
        jobs.append(job)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(Client, "result", interrupt)
        assert main([str(photo), "-o", str(tmp_path / "page.pdf"), "--url", url]) == 130
    with Client(url) as client:
        assert [client.look(job).state for job in jobs] == ["cancelled"]


def test_pages_that_are_left_out_are_said(
    url: str, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = tmp_path / "bad.jpg"
    bad.write_bytes(upload("no-text"))
    assert main([str(photo), str(bad), "-o", str(tmp_path / "pages.pdf"), "--url", url]) == 0
    assert "flatten: left out: page 2 no-text" in capsys.readouterr().err
