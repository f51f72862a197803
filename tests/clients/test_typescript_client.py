"""The TypeScript client compiles, and goes the main way in node against the scripted service."""

import json
import subprocess
from pathlib import Path

from tests.app.scripted import PAGE
from tests.app.scripts import upload
from tests.end_to_end.forked import ROOT
from tests.end_to_end.typescript import NEEDS_NODE, NODE_MODULES

CLIENT = ROOT / "clients" / "typescript"


@NEEDS_NODE
def test_it_compiles_and_goes_the_main_way(url: str, tmp_path: Path) -> None:
    tsc = [NODE_MODULES / ".bin" / "tsc", "-p", CLIENT, "--outDir", tmp_path / "dist"]
    compiled = subprocess.run(tsc, capture_output=True, text=True, check=False)
    assert compiled.returncode == 0, compiled.stdout
    (tmp_path / "dist" / "package.json").write_text((CLIENT / "package.json").read_text("utf-8"))
    scripts = {"flat": "", "noText": "no-text", "wait": f"wait {tmp_path}"}
    sent = {name: upload(script).decode("latin1") for name, script in scripts.items()}
    output = tmp_path / "pages.pdf"
    visit = [
        "node",
        Path(__file__).parent / "visit.mjs",
        tmp_path / "dist" / "index.js",
        url.rstrip("/"),
        output,
    ]
    done = subprocess.run(
        visit,
        input=json.dumps({**sent, "zones": json.dumps(PAGE)}),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
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
