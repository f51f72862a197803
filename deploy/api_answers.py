"""The real answers in docs/api.md: python -m deploy.api_answers URL, with a running service that has no class `letter`.

Photos are those of `examples/`. Long lists are cut; what is left out is counted in their last item.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

import httpx

from deploy.api_tables import PAGE

EXAMPLES = PAGE.parent.parent / "examples"
ASKED = {
    "/rectify": [("image", "photo.jpg")],
    "/mosaic": [("images", "a.jpg"), ("images", "b.jpg")],
    "/layout": [("image", "page.png")],
}
"""Files of each request."""
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
    old = rf"<!-- answer of {path}: deploy/api_answers\.py -->\n```json\n.*?```"
    return re.sub(old, lambda _: block, page, flags=re.DOTALL)


def main(url: str) -> None:
    """Ask for all answers and write them into the page."""
    page = PAGE.read_text("utf-8")
    with httpx.Client(base_url=url, timeout=120) as client:

        def post(path: str, *files: tuple[str, str]) -> Any:
            parts = [(part, (name, (EXAMPLES / name).read_bytes())) for part, name in files]
            answer = client.post(path, files=parts or None, headers={"Accept": "application/json"})
            return answer.raise_for_status().json()

        for number in (1, 2):
            post(
                "/layout/models/letter/samples",
                ("image", f"letter-{number}.png"),
                ("zones", f"letter-{number}.json"),
            )
        post("/layout/models/letter/initialize")
        for path, files in ASKED.items():
            page = with_answer(page, path, post(path, *files))
    Path(PAGE).write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
