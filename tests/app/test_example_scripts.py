"""The scripts of examples/scripts against the scripted service."""

import os
import subprocess
import sys
from pathlib import Path

import httpx

from tests.app.scripts import upload
from tests.programs import NEEDS_CURL

ROOT = Path(__file__).parent.parent.parent
SCRIPTS = ROOT / "examples" / "scripts"
PYTHON_CLIENT = ROOT / "clients" / "python"


def run(client: httpx.Client, *command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The script's end; it knows the address of the service."""
    address = {"RECTIFY_URL": str(client.base_url).rstrip("/"), "PYTHONPATH": str(PYTHON_CLIENT)}
    return subprocess.run(
        [str(part) for part in command],
        env={**os.environ, **address, **environment},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@NEEDS_CURL
def test_paperless_gets_a_pdf_in_place_of_the_photo(client: httpx.Client, tmp_path: Path) -> None:
    photo, other, bad = tmp_path / "scan.JPG", tmp_path / "notes.txt", tmp_path / "bad.jpg"
    photo.write_bytes(upload(""))
    other.write_bytes(b"text")
    bad.write_bytes(upload("undecodable-image"))
    for path in (photo, other, bad):
        done = run(client, "sh", SCRIPTS / "paperless_pre_consume.sh", DOCUMENT_WORKING_PATH=str(path))
        assert done.returncode == 0, done.stderr
    assert photo.read_bytes() == b"flat as pdf"
    assert other.read_bytes() == b"text"
    assert bad.read_bytes() == upload("undecodable-image")


@NEEDS_CURL
def test_a_batch_leaves_out_what_is_there(client: httpx.Client, tmp_path: Path) -> None:
    photos, pdfs = tmp_path / "my photos", tmp_path / "pdfs"
    photos.mkdir()
    pdfs.mkdir()
    for name, script in (("a b.jpg", ""), ("c.jpg", ""), ("d.jpg", "no-text")):
        (photos / name).write_bytes(upload(script))
    (pdfs / "c.pdf").write_bytes(b"there")
    done = run(client, "sh", SCRIPTS / "batch.sh", photos, pdfs)
    assert sorted(path.name for path in pdfs.iterdir()) == ["a b.pdf", "c.pdf"]
    assert (pdfs / "a b.pdf").read_bytes() == b"flat as pdf"
    assert (pdfs / "c.pdf").read_bytes() == b"there"
    assert "d.jpg: not flattened" in done.stderr


def test_a_watched_folder(client: httpx.Client, tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    (folder / "page.jpg").write_bytes(upload(""))
    (folder / "bad.jpg").write_bytes(upload("no-text"))
    options = ("--url", str(client.base_url), "--once", "--every-s", "0.01")
    done = run(client, sys.executable, SCRIPTS / "watched_folder.py", folder, out, *options)
    assert done.returncode == 0, done.stderr
    assert (out / "page.pdf").read_bytes() == b"flat as pdf"
    assert (folder / "done" / "page.jpg").exists()
    assert "scripted no-text" in (folder / "failed" / "bad.jpg.txt").read_text(encoding="utf-8")
