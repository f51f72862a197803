"""A service whose settings file of content features is damaged does not start, and names the entry."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.end_to_end.processes import ROOT, SCRIPTED


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[date]\npatterns = ['(a*)*']", "date.patterns[0]: '(a*)*' can be tried in too many ways"),
        ("no settings", "no TOML"),
    ],
)
def test_the_entry_is_named(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "features.toml"
    path.write_text(text)
    settings = {"HOST": "127.0.0.1", "PORT": "0", "DATA_DIR": str(tmp_path), "CONTENT_FEATURES": str(path)}
    ended = subprocess.run(
        [sys.executable, "-m", SCRIPTED],
        cwd=ROOT,
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode != 0
    (line,) = [line for line in map(json.loads, ended.stdout.splitlines()) if line["logger"] == "app.main"]
    assert line["level"] == "error"
    assert f"(CONTENT_FEATURES) cannot be used: {path}: {reason}" in line["message"]
