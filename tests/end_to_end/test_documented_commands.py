"""Every command of README.md and of the pages of docs/api/, in order, as written, against a running service.

Work on photos that both of them show runs once. Commands above the answers that docs/api/ shows are those that
`make api-answers` has run; tests/test_api_answers.py holds them to the OpenAPI document.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from deploy import api_tables
from deploy.api_answers import without_answers
from tests.end_to_end.forked import ROOT
from tests.end_to_end.processes import PRODUCT, running
from tests.programs import NEEDS_CURL

ADDRESS = "127.0.0.1:8000"
NOT_RUN = ("make ", "docker ")
"""Commands that set up and start the service; the tests themselves run in what they make."""
STRICT_CURL = 'curl() { command curl --fail-with-body --silent --show-error "$@"; }'


TEXTS = {
    "README.md": (ROOT / "README.md").read_text("utf-8"),
    "docs/api": without_answers(api_tables.reference()),
}


def commands_of(text: str) -> str:
    """All shell blocks of a text in Markdown, in order."""
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    kept = [block for block in blocks if not block.startswith(NOT_RUN)]
    assert len(kept) >= 1
    return "\n".join(kept)


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_no_command_is_left_out(text: str) -> None:
    lines = [line for line in text.splitlines() if re.match(r"\s*(\w+=\$\()?curl ", line)]
    commands = commands_of(text).splitlines()
    assert [line for line in lines if line not in commands] == []
    assert lines


def of_its_own(name: str) -> str:
    """The commands of a text; of README.md without the work on photos that the reference has as well."""
    commands = commands_of(TEXTS[name])
    if name != "README.md":
        return commands
    others = set(commands_of(TEXTS["docs/api"]).splitlines())
    is_work = re.compile(r"curl -F .*/(rectify|mosaic)( .*)?$")
    return "\n".join(line for line in commands.splitlines() if not (is_work.match(line) and line in others))


@NEEDS_CURL
@pytest.mark.parametrize("name", TEXTS)
def test_the_commands_run_as_written(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "examples"
    shutil.copytree(ROOT / "examples", folder, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    commands = re.sub(r"^cd examples$", "", of_its_own(name), flags=re.MULTILINE)
    assert ADDRESS in commands
    with running(PRODUCT, workers=1, job_timeout_s=120, mosaic_timeout_s=300) as process:
        script = f"set -euo pipefail\n{STRICT_CURL}\nset -x\n" + commands.replace(
            ADDRESS, f"127.0.0.1:{process.port}"
        )
        ran = subprocess.run(
            ["bash", "-c", script],
            cwd=folder,
            env={**os.environ, "LC_ALL": "C.UTF-8"},
            capture_output=True,
            timeout=500,
            check=False,
        )
    assert ran.returncode == 0, ran.stderr.decode(errors="replace")[-2000:] + ran.stdout[-1000:].decode(
        errors="replace"
    )
    made = {path.name: path.stat().st_size for path in folder.iterdir()}
    written = re.findall(r" -o ([\w./-]+)", commands)
    assert written
    assert [path for path in written if path != "/dev/null" and not made.get(path)] == []
