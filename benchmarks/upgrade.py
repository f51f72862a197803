"""`python -m benchmarks upgrade`: stores of the first commit of each schema, brought up to date by this one.

The code of each commit (by `git archive`) runs as a service of its own and is filled by requests: samples with images,
a model, results with pictures, feedback, jobs, a camera, as far as it knew them. The service of this checkout then
opens the folder. What the old one had answered must be in the new answers, value by value; feedback must be undoable or
say why not; what was open must be in the queue. `--write FOLDER` keeps each store and its answers for the tests.
"""

import argparse
import io
import json
import shutil
import subprocess
import sys
import tarfile
import time
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx

from benchmarks.common.places import REPOSITORY
from benchmarks.learning.server_processes import Server

COMMITS = {
    "0001": "4f5a05c",
    "0002": "e27c0e9",
    "0002-feedback": "3f93072",
    "0003": "fd9b6b0",
    "0004": "e5602be",
    "0005": "9655ae0",
    "0006": "a4b7d6a",
    "0007": "59e1d62",
    "0008": "72e24da",
}
"""The first commit of each schema on the main line; of the second also the last, the first one with feedback."""
FIRST_WITH_JOBS = "0005"
"""Before it jobs were in the memory of the service."""
ROUNDED = 1e-4
"""Old services answered some numbers with all digits."""
EXAMPLES = REPOSITORY / "examples"
LONG_S = "315360000"
KEPT = {"RESULT_TTL_S": LONG_S, "JOB_TTL_S": LONG_S, "WORKERS": "1", "KEEP_IMAGES": "true"}
"""What is stored lasts ten years, so that the tests can open it."""
ANSWERS, DATABASE = "answers.json", "layout.sqlite3"
_TIMEOUT_S = 120.0
_FILL_WITHOUT_HTTP = """
import json, sys
from pathlib import Path
from models.repository import Store
letter = json.loads(Path(sys.argv[2]).read_text())
with Store.open(Path(sys.argv[1]) / "layout.sqlite3") as store:
    sample = store.add_sample("letter", letter).id
    store.add_version("letter", {"labels": ["sender"], "nodes": [1.5, 2.25]}, "import")
    result = store.add_result({"result": {"zones": []}}, float(sys.argv[3]))
print(json.dumps({"sample": sample, "result": result}))
"""
"""The first schema had no routes."""


def main(arguments: Sequence[str]) -> int:
    """Print a line for each schema; 1 if something is lost."""
    parser = argparse.ArgumentParser(prog="benchmarks upgrade", description=__doc__)
    parser.add_argument("--schema", choices=COMMITS, action="append", help="only these")
    parser.add_argument("--write", type=Path, help="keep the old stores with their answers in this folder")
    options = parser.parse_args(arguments)
    failures = 0
    for schema in options.schema or COMMITS:
        with TemporaryDirectory() as name:
            folder = Path(name)
            answers = make_store(schema, folder)
            if options.write is not None:
                write_store(folder / "data", answers, options.write / f"schema_{schema}.zip")
            faults = compare(folder / "data", answers)
        failures += bool(faults)
        print(
            f"schema {schema}: {len(answers['get'])} answers of the old service, {len(faults)} faults",
            flush=True,
        )
        for fault in faults:
            print(f"    {fault}")
    return int(failures > 0)


def make_store(schema: str, folder: Path) -> dict[str, Any]:
    """Fill `folder/data` by the code of the schema's first commit; what it answered."""
    code, data = folder / "code", folder / "data"
    packed = subprocess.run(
        ["git", "archive", COMMITS[schema], "app", "models", "services"],
        cwd=REPOSITORY,
        capture_output=True,
        check=True,
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(code, filter="data")
    data.mkdir()
    if schema == "0001":
        ran = subprocess.run(
            [sys.executable, "-c", _FILL_WITHOUT_HTTP, data, EXAMPLES / "letter-1.json", LONG_S],
            cwd=code,
            capture_output=True,
            text=True,
            check=True,
        )
        ids = json.loads(ran.stdout)
        return {
            "schema": schema,
            "get": {},
            "pictures": {},
            "feedback": [],
            "open": [ids["result"]],
        }
    with _serving(data, code) as client:
        return {"schema": schema, **_fill(client, schema)}


def write_store(data: Path, answers: dict[str, Any], path: Path) -> None:
    """Pack the database and the answers as one file of the tests."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(ANSWERS, json.dumps(answers, indent=1))
        archive.write(data / DATABASE, DATABASE)


def compare(data: Path, answers: dict[str, Any]) -> list[str]:
    """What the service of this checkout answers otherwise on a copy of the store, or does not do."""
    faults = []
    with TemporaryDirectory() as name:
        copy = Path(name) / "data"
        shutil.copytree(data, copy)
        with _serving(copy, REPOSITORY) as client:
            for path, before in answers["get"].items():
                response = client.get(path)
                after = response.json() if response.status_code == 200 else response.text[:200]
                faults += [f"GET {path}: {fault}" for fault in lost(before, after)]
            for path, digest in answers["pictures"].items():
                if sha256(client.get(path).content).hexdigest() != digest:
                    faults.append(f"GET {path}: another picture, or none")
            queue = client.get(
                "/layout/results", params={"state": "open", "order": "gain", "limit": 100}
            ).json()
            listed = {one["id"] for one in queue["results"]}
            faults += [
                f"{one} was open and is not in the queue" for one in answers["open"] if one not in listed
            ]
            for result_id in answers["feedback"]:
                response = client.delete(f"/layout/results/{result_id}/feedback")
                if response.status_code != 200:
                    said = f"undo: {response.status_code} {response.json().get('detail')}"
                    print(f"    {said}") if says_why(response) else faults.append(said)
    return faults


def says_why(response: httpx.Response) -> bool:
    """Whether a refused undo names what can be done instead."""
    return response.status_code == 409 and "initialize" in response.json().get("detail", "")


def lost(before: Any, after: Any, at: str = "") -> Iterator[str]:
    """What is in `before` and not, or otherwise, in `after`; what is new there is no loss."""
    if isinstance(before, dict) and isinstance(after, dict):
        for name, value in before.items():
            if name not in after:
                yield f"{at}.{name} is not there"
            else:
                yield from lost(value, after[name], f"{at}.{name}")
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for number, (one, other) in enumerate(zip(before, after, strict=True)):
            yield from lost(one, other, f"{at}[{number}]")
    elif isinstance(before, float) and isinstance(after, float) and abs(before - after) <= ROUNDED:
        return
    elif before != after:
        yield f"{at} was {str(before)[:80]}, is {str(after)[:80]}"


@contextmanager
def _serving(data: Path, code: Path) -> Iterator[httpx.Client]:
    server = Server(data, code=code, **KEPT)
    server.start()
    try:
        with httpx.Client(base_url=server.url, timeout=_TIMEOUT_S) as client:
            yield client
    finally:
        server.stop()


def _fill(client: httpx.Client, schema: str) -> dict[str, Any]:
    """Store one of each, as far as this service knows it; what it answers then."""
    for number in (1, 2):
        zones = (EXAMPLES / f"letter-{number}.json").read_bytes()
        files = {
            "image": (EXAMPLES / f"letter-{number}.png").read_bytes(),
            "zones": (None, zones, "application/json"),
        }
        response = client.post("/layout/models/letter/samples", files=files)
        if response.status_code != 201:
            response = client.post("/layout/models/letter/samples", json=json.loads(zones))
        response.raise_for_status()
    client.post("/layout/models/letter/initialize")
    page = (EXAMPLES / "page.png").read_bytes()
    results = []
    for _ in range(3):
        response = client.post("/layout", files={"image": page})
        if response.status_code == 200 and response.json().get("id"):
            results.append(response.json())
    taught = []
    for number, result in enumerate(results[:2]):
        body = {"class": "letter", "labels": {result["zones"][number]["id"]: "receiver"}}
        if client.post(f"/layout/results/{result['id']}/feedback", json=body).status_code == 200:
            taught.append(result["id"])
    jobs = []
    asked = {"format": "jpeg", "quality": "30"}
    response = client.post("/rectify", files={"image": page}, data=asked, headers={"Prefer": "respond-async"})
    if response.status_code == 202:
        jobs.append(response.headers["Location"])
        while client.get(jobs[0]).json()["state"] in ("queued", "running"):
            time.sleep(0.1)
    client.post("/rectify", files={"image": (EXAMPLES / "photo.jpg").read_bytes()}, data={"camera": "phone"})
    paths = ["/layout/models", "/layout/models/letter", "/layout/models/letter/samples"]
    if schema < FIRST_WITH_JOBS:
        jobs = []
    paths += ["/layout/models/letter/versions", "/layout/models/letter/feedback", "/cameras", *jobs]
    paths += [f"/layout/results/{result['id']}" for result in results]
    answers = {path: client.get(path) for path in paths}
    pictures = {path: client.get(path) for path in [f"/layout/results/{one['id']}/image" for one in results]}
    pictures |= {f"{job}/result": client.get(f"{job}/result") for job in jobs}
    return {
        "get": {path: answer.json() for path, answer in answers.items() if answer.status_code == 200},
        "pictures": {
            path: sha256(answer.content).hexdigest()
            for path, answer in pictures.items()
            if answer.status_code == 200
        },
        "feedback": taught,
        "open": [one["id"] for one in results if one["id"] not in taught],
    }
