"""The real answers in docs/api/, written anew: `make api-answers`.

It starts a service with an empty store, sends the requests of `api_requests` with curl, as the pages show them, and
writes each answer between the two comments of its name. What is around them is written by hand. For a running service
with an empty store: python -m deploy.api_answers URL KEY.
"""

import json
import os
import re
import secrets
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx

from deploy.api_requests import REQUESTS, Request
from deploy.api_tables import DOCS, anchor_of
from deploy.shown_answers import Answer, fenced, head, in_lines, lines_of, shortened
from deploy.stable_answers import Stable, with_durations_of

EXAMPLES = DOCS.parent / "examples"
PAGES = DOCS / "api"
SHOWN_URL = "http://127.0.0.1:8000"
"""The service in commands that are shown."""
END = "<!-- end of answer -->"
BLOCK = re.compile(
    rf"^<!-- answer of (?P<name>[^:\n]+): make api-answers -->\n(?P<block>.*?){END}", re.MULTILINE | re.DOTALL
)
START_S = 120
"""A service is up within this time."""
ANSWER_S = 120


def with_answers(page: str, blocks: Mapping[str, str]) -> str:
    """The page with these blocks, by the names of answers."""

    def written(found: re.Match[str]) -> str:
        name = found["name"]
        block = blocks.get(name)
        return found[0] if block is None else f"{_start(name)}\n{block}{END}"

    return BLOCK.sub(written, page)


def without_answers(text: str) -> str:
    """The text of pages without what `make api-answers` has written."""
    return BLOCK.sub("", text)


def block_of(request: Request, answer: Answer, old: str, stable: Stable) -> str:
    """What the page shows of a request and its answer; `old` is what it has shown so far."""
    parts = [
        f'<a id="{anchor_of(request.name)}"></a>**`{request.operation}`**{request.case and f", {request.case}"}',
        f"```sh\n{request.command.replace('URL', SHOWN_URL)}\n```",
        stable.text(head(answer)),
    ]
    if answer.is_json:
        value = shortened(json.loads(stable.text(answer.body.decode())), request.levels)
        parts.append(fenced(answer.media_type, in_lines(with_durations_of(value, json_in(old)))))
    elif answer.is_text:
        parts.append(
            fenced(answer.media_type, lines_of(answer.media_type, stable.text(answer.body.decode())))
        )
    return "\n\n".join(parts) + "\n\n"


def json_in(block: str) -> Any:
    """The JSON that a block of a page shows; None where it shows none."""
    found = re.search(r"^```json\n(.*?)\n```", block, re.MULTILINE | re.DOTALL)
    return json.loads(found[1]) if found else None


def answers(url: str, key: str) -> Iterator[tuple[Request, Answer]]:
    """The answer of every request.

    Raises
    ------
    RuntimeError
        When one is refused that should not be, or the other way round.
    """
    with TemporaryDirectory() as folder:
        files = Path(folder) / "examples"
        shutil.copytree(EXAMPLES, files)
        dump = Path(folder) / "head"
        (Path(folder) / ".curlrc").write_text(
            f'silent\nshow-error\nmax-time = {ANSWER_S}\ndump-header = "{dump}"\nheader = "X-API-Key: {key}"\n'
        )
        variables = {"CURL_HOME": folder, "KEY": key}
        for request in REQUESTS:
            answer = _asked(request, url, files, dump, variables)
            if (answer.status >= 400) != request.refused:
                raise RuntimeError(f"{request.command}: {answer.status} {answer.body[:1000]!r}")
            variables |= {name: _found(answer, place) for name, place in request.kept.items()}
            yield request, answer


@contextmanager
def own_service() -> Iterator[tuple[str, str]]:
    """A service with an empty store, as `make serve` starts it, and its key."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    key, url = secrets.token_hex(), f"http://127.0.0.1:{port}"
    with TemporaryDirectory() as folder:
        settings = {"PORT": str(port), "DATA_DIR": folder, "API_KEYS": f"anna:{key}", "WORKERS": "2"}
        service = subprocess.Popen(
            [sys.executable, "-m", "app"], env={**os.environ, **settings}, stdout=subprocess.DEVNULL
        )
        try:
            _wait_for(url, service)
            yield url, key
        finally:
            service.terminate()
            service.wait()


def _wait_for(url: str, service: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + START_S
    while service.poll() is None and time.monotonic() < deadline:
        try:
            if httpx.get(f"{url}/health/ready").is_success:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.2)
    raise RuntimeError("The service did not start.")


def _asked(request: Request, url: str, files: Path, dump: Path, variables: Mapping[str, str]) -> Answer:
    command = request.command.replace("URL", url)
    ran = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command],
        cwd=files,
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        check=True,
    )
    written = re.search(r" -o (\S+)", command)
    content = (files / written[1]).read_bytes() if written else ran.stdout
    status, headers = 0, dict[str, str]()
    for line in dump.read_text("latin-1").splitlines():
        if line.startswith("HTTP/"):
            status, headers = int(line.split()[1]), {}
        elif ": " in line:
            name, _, value = line.partition(": ")
            headers["ETag" if name.lower() == "etag" else name.title()] = value
    return Answer(status, headers, content)


def _found(answer: Answer, place: str) -> str:
    """The value of a header, which begins with a capital, or of a name of the JSON."""
    if place[0].isupper():
        return answer.headers[place]
    value = json.loads(answer.body)
    for name in place.split("."):
        value = value[int(name) if name.isdigit() else name]
    return str(value)


def _start(name: str) -> str:
    return f"<!-- answer of {name}: make api-answers -->"


def main(url: str, key: str) -> None:
    """Write every answer into its page."""
    pages = {page: page.read_text("utf-8") for page in sorted(PAGES.glob("*.md"))}
    old = {found["name"]: found["block"] for text in pages.values() for found in BLOCK.finditer(text)}
    stable = Stable()
    blocks = {
        request.name: block_of(request, answer, old.get(request.name, ""), stable)
        for request, answer in answers(url, key)
        if request.operation
    }
    if blocks.keys() != old.keys():
        raise SystemExit(f"No place, or no request: {sorted(blocks.keys() ^ old.keys())}")
    for page, text in pages.items():
        page.write_text(with_answers(text, blocks), encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:]:
        main(*sys.argv[1:])
    else:
        with own_service() as (url, key):
            main(url, key)
