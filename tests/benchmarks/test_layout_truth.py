"""The truth of labelled pages: what is read from a file."""

import json
from pathlib import Path

from benchmarks.layout.truth import load_page, load_set
from services.layout.page import Page, Zone

TOLD = {
    "class": "jose",
    "width": 100,
    "height": 200,
    "zones": [
        {"id": 0, "box": [0, 0, 40, 20], "label": "logo", "lines": 0, "font_size": 0, "text": ""},
        {"id": 1, "box": [50, 0, 100, 20], "label": "title", "lines": 2, "font_size": 9.5, "text": "A\nB"},
        {"id": 2, "box": [0, 100, 100, 200], "label": "body", "lines": 8, "text": "C"},
    ],
}


def truth(tmp_path: Path) -> Page:
    file = tmp_path / "layout" / "titles" / "p1.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(TOLD), encoding="utf-8")
    return load_page(file)[0]


def test_a_page_is_what_a_segmenter_could_know_and_labels(tmp_path: Path) -> None:
    page = truth(tmp_path)
    assert (page.width, page.height) == (100.0, 200.0)
    logo, title, body = page.zones
    assert logo == Zone("0", (0.0, 0.0, 40.0, 20.0), kind="figure", label="logo")
    assert title == Zone("1", (50.0, 0.0, 100.0, 20.0), lines=2, font_size=9.5, text="A\nB", label="title")
    assert (body.kind, body.font_size, body.lines) == ("text", None, 8)


def test_a_set_is_empty_without_the_data(tmp_path: Path) -> None:
    assert load_set("titles", str(tmp_path)) == []
    truth(tmp_path)
    [page] = load_set("titles", str(tmp_path))
    assert (page.name, page.class_name, page.image.name) == ("p1", "jose", "p1.webp")
