"""The real answers in docs/api/: python -m deploy.api_answers URL, with a running service that has no class `letter`.

Photos are those of `examples/`. Long lists are cut; what is left out is counted in their last item.
"""

import json
import re
import sys
import time
from collections.abc import Iterator
from typing import Any

import httpx

from deploy.api_tables import DOCS

EXAMPLES = DOCS.parent / "examples"
ASKED = {
    "/rectify": [("image", "photo.jpg")],
    "/mosaic": [("images", "a.jpg"), ("images", "b.jpg")],
    "/layout": [("image", "page.png")],
}
"""Files of each request."""
PAGES = {
    "/rectify": "rectify",
    "/mosaic": "mosaic",
    "/layout": "layout",
    "/layout/results/{id}/feedback": "feedback",
    "/layout/proposals": "proposals",
    "GET /jobs/{id}": "jobs",
    "/uploads": "uploads",
}
"""The page of each answer."""
POLL_S = 0.2
MOST_ITEMS = 4
"""Of numbers, as a box or a direction has; of anything else one item is shown."""


def shortened(value: Any) -> Any:
    """The value with its long lists cut, and numbers of six digits."""
    if isinstance(value, dict):
        return {key: shortened(each) for key, each in value.items()}
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if not isinstance(value, list):
        return value
    most = MOST_ITEMS if all(isinstance(each, int | float) for each in value) else 1
    left = len(value) - most
    return [*map(shortened, value[:most]), *([f"... {left} more"] if left > 0 else [])]


def with_answer(page: str, path: str, answer: dict[str, Any]) -> str:
    """The page with the answer, a line for each of its names, below the comment of its path."""
    lines = ",\n".join(
        f"  {json.dumps(key)}: {json.dumps(each, ensure_ascii=False)}"
        for key, each in shortened(answer).items()
    )
    block = f"<!-- answer of {path}: deploy/api_answers.py -->\n```json\n{{\n{lines}\n}}\n```"
    old = rf"<!-- answer of {re.escape(path)}: deploy/api_answers\.py -->\n```json\n.*?```"
    return re.sub(old, lambda _: block, page, flags=re.DOTALL)


def answers(url: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The answer of every path of `PAGES`."""
    with httpx.Client(base_url=url, timeout=120, headers={"Accept": "application/json"}) as client:

        def post(path: str, *files: tuple[str, str], **more: Any) -> Any:
            parts = [(part, (name, (EXAMPLES / name).read_bytes())) for part, name in files]
            return client.post(path, files=parts or None, **more).raise_for_status().json()

        for number in (1, 2):
            post(
                "/layout/models/letter/samples",
                ("image", f"letter-{number}.png"),
                ("zones", f"letter-{number}.json"),
            )
        post("/layout/models/letter/initialize")
        for path, files in ASKED.items():
            answer = post(path, *files)
            yield path, answer
        wrong = {"class": "letter", "labels": {answer["zones"][2]["id"]: "receiver"}}
        yield "/layout/results/{id}/feedback", post(f"/layout/results/{answer['id']}/feedback", json=wrong)
        for zones in _alike(post("/layout", ("image", "page-2.jpg"))):
            stranger = post("/layout", data={"zones": json.dumps(zones)})
            post(f"/layout/results/{stranger['id']}/feedback", json={"class": None})
        yield "/layout/proposals", post("/layout/proposals")
        job = post("/rectify", *ASKED["/rectify"], headers={"Prefer": "respond-async"})
        while job["ended"] is None:
            time.sleep(POLL_S)
            job = client.get(f"/jobs/{job['id']}").raise_for_status().json()
        yield "GET /jobs/{id}", job
        headers = {
            "Tus-Resumable": "1.0.0",
            "Upload-Length": "8388608",
            "Upload-Metadata": "filename cGhvdG8uanBn",
        }
        yield "/uploads", post("/uploads", headers=headers)


def _alike(page: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The zones of a page, and those of two pages like it, which are printed a little lower."""
    for down in (0, 6, 12):
        zones = [
            {"id": zone["id"], "box": [x0, y0 + down, x1, y1 + down]}
            for zone in page["zones"]
            for x0, y0, x1, y1 in (zone["box"],)
        ]
        yield {"width": page["width"], "height": page["height"] + 12, "zones": zones}


if __name__ == "__main__":
    for path, answer in answers(sys.argv[1]):
        page = DOCS / "api" / f"{PAGES[path]}.md"
        page.write_text(with_answer(page.read_text("utf-8"), path, answer), encoding="utf-8")
