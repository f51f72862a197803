"""The commands of docs/operations.md, and what a copy of the database alone lacks."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import httpx
import pytest

from app.learning.remeasuring import remeasure
from app.main import create_app
from app.settings import Settings
from app.storage.backup_note import NAME, TEXT
from app.storage.layout_store import DATABASE
from tests.app.scripted import OPERATIONS
from tests.app.scripts import upload
from tests.app.serving import SETTINGS, serving
from tests.app.test_remeasuring import add, images

OPERATION = Path(__file__).parents[2] / "docs" / "operations.md"


def fill(client: httpx.Client) -> str:
    """A sample with an image, and a result with its picture; the path of the picture."""
    add(client, "letter", "with", upload("kept"))
    files, data = {"image": upload("kept")}, {"keep_image": "true", "format": "json"}
    answer = client.post("/layout", files=files, data=data)
    answer.raise_for_status()
    return f"/layout/results/{answer.json()['id']}/image"


def commands() -> str:
    section = OPERATION.read_text("utf-8").partition("## Back-up\n")[2]
    [block] = re.findall(r"^```sh\n(.*?)^```", section.partition("\n## ")[0], re.MULTILINE | re.DOTALL)
    return block


def test_the_documented_backup_brings_everything_back(tmp_path: Path) -> None:
    with serving(data_dir=tmp_path / "data") as client:
        path = fill(client)
        picture = client.get(path).content
        samples = client.get("/layout/models/letter/samples").json()
        kept = images(tmp_path / "data")
        subprocess.run(["bash", "-ec", commands()], cwd=tmp_path, check=True)
    assert kept
    with serving(data_dir=tmp_path / "backup") as client:
        assert client.get(path).content == picture
        assert client.get("/layout/models/letter/samples").json() == samples
        assert images(tmp_path / "backup") == kept


def test_the_database_alone_says_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.learning.remeasuring.configure_logs", lambda level: None)

    def remeasured(name: str) -> int:
        app = create_app(Settings(**{**SETTINGS, "data_dir": tmp_path / name}), OPERATIONS)
        return remeasure(["letter"], app)

    with serving(data_dir=tmp_path / "data") as client:
        path = fill(client)
        assert remeasured("data") == 0
        subprocess.run(["bash", "-ec", commands()], cwd=tmp_path, check=True)
    shutil.rmtree(tmp_path / "backup" / "blobs")
    with serving(data_dir=tmp_path / "backup") as client:
        missing = client.get(path)
        assert missing.status_code == 404
        assert "restored without its blobs" in missing.json()["detail"]
        assert remeasured("backup") == 1
        assert "not one image is there" in capsys.readouterr().out


def test_the_folder_says_that_a_plain_copy_is_no_backup(tmp_path: Path) -> None:
    with serving(data_dir=tmp_path / "data") as client:
        fill(client)
        (tmp_path / "copy").mkdir()
        shutil.copy(tmp_path / "data" / DATABASE, tmp_path / "copy")
        note = (tmp_path / "data" / NAME).read_text()
        assert f"{DATABASE}-wal" in note
    with serving(
        data_dir=tmp_path / "copy"
    ) as client:  # what the note is about: it opens, and lacks the sample
        assert json.loads(client.get("/layout/models").content)["models"] == []


def test_no_empty_backup_is_made_in_the_wrong_folder(tmp_path: Path) -> None:
    """Nor an empty database in the place of the one that is not there."""
    (tmp_path / "data" / "blobs").mkdir(parents=True)
    assert subprocess.run(
        ["bash", "-ec", commands()], cwd=tmp_path, capture_output=True, check=False
    ).returncode
    assert not (tmp_path / "data" / DATABASE).exists()
    [command] = re.findall(r"^ +(python3 .*)$", TEXT, re.MULTILINE)
    here = command.replace("/BACKUP", ".")
    assert subprocess.run(["bash", "-ec", here], cwd=tmp_path, capture_output=True, check=False).returncode
