"""The TypeScript client compiles, and goes the main way in node against the scripted service."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.app.scripted_layout import PAGE
from tests.app.scripts import upload
from tests.end_to_end.forked import ROOT
from tests.end_to_end.typescript import NEEDS_NODE, NODE_MODULES

CLIENT = ROOT / "clients" / "typescript"
ADDRESS = "http://127.0.0.1:8000"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in whose `node_modules` the compiled client is installed."""
    folder = tmp_path_factory.mktemp("typescript")
    package = folder / "node_modules" / "document-rectification-client"
    tsc = [NODE_MODULES / ".bin" / "tsc", "-p", CLIENT, "--outDir", package / "dist"]
    compiled = subprocess.run(tsc, capture_output=True, text=True, check=False)
    assert compiled.returncode == 0, compiled.stdout
    shutil.copy(CLIENT / "package.json", package)
    return folder


def run(folder: Path, script: Path, *arguments: str, given: str = "") -> str:
    """What the script prints; it is run as a file of the folder."""
    own = Path(shutil.copy(script, folder)) if script.parent != folder else script
    done = subprocess.run(
        ["node", own, *arguments],
        cwd=folder,
        input=given,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@NEEDS_NODE
def test_it_goes_the_main_way(url: str, folder: Path, tmp_path: Path) -> None:
    scripts = {"flat": "", "noText": "no-text", "wait": f"wait {tmp_path}"}
    sent = {name: upload(script).decode("latin1") for name, script in scripts.items()}
    given = json.dumps({**sent, "zones": json.dumps(PAGE)})
    output = tmp_path / "pages.pdf"
    seen = json.loads(run(folder, Path(__file__).parent / "visit.mjs", url, str(output), given=given))
    assert (output.read_bytes(), seen["mediaType"]) == (b"2 as pdf", "application/pdf")
    assert seen["states"] == ["flat", "failed"]
    assert seen["width"] > 0
    assert seen["zones"] == len(PAGE["zones"])
    assert seen["refused"] == {"code": "no-text", "status": 422, "field": "image", "wait": None}
    assert seen["unpaused"] == 0
    assert seen["retries"] == [7, 1, 0.5]
    assert seen["late"] == {"code": "unexpected-answer", "status": 503, "field": None, "wait": 3600}
    assert seen["unreachable"]["code"] == "unreachable"
    # The answer that was lost had started the job that the second request found.
    assert seen["job"] == ["flat as pdf", "succeeded", 1, 2]
    assert seen["cancelled"] == {"code": "cancelled", "status": 410, "field": None, "wait": None}
    assert seen["aborted"] == ["of a request", "of a try", "of a job"]
    assert seen["givenUp"] == seen["cancelled"]
    assert seen["early"] == "before"
    # The answer to the first piece was lost, so it was kept; the second photo met a busy service.
    sent = ["POST", "PATCH", "HEAD", "POST", "PATCH", "HEAD", "PATCH"]
    assert seen["pieces"] == ["2 as pdf", sent, [0.5, 3]]
    assert seen["upload"] == "flat as png"
    assert (seen["forgotten"]["code"], seen["unknown"]) == ("not-found", "flat as pdf")


@NEEDS_NODE
def test_what_is_told_runs_as_written(url: str, folder: Path) -> None:
    page = (ROOT / "clients" / "README.md").read_text("utf-8")
    (code,) = re.findall(r"^```js\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert ADDRESS in code
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        (folder / name).write_bytes(upload(""))
    script = folder / "told.mjs"
    script.write_text(code.replace(ADDRESS, url), encoding="utf-8")
    assert "flat" in run(folder, script)
    assert (folder / "pages.pdf").read_bytes() == (folder / "again.pdf").read_bytes() == b"3 as pdf"
