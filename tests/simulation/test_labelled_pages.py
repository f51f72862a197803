"""Labelled pages: their zones are true to the ink, and as varied as pages are."""

import json
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import get_args

import numpy as np
import pytest

from simulation.labelled_pages import (
    DocumentKind,
    LabelledPage,
    document_pages,
    fax_page,
    letter_continuation,
    letter_page,
    memo_continuation,
    memo_page,
    paper_continuation,
    title_page,
)

Maker = Callable[..., LabelledPage]
MAKERS: dict[str, Maker] = {
    "letter": letter_page,
    "memo": memo_page,
    "fax": fax_page,
    "plain": partial(title_page, journal="plain"),
    "two-column": partial(title_page, journal="two-column"),
    "margin": partial(title_page, journal="margin"),
    "letter-continuation": letter_continuation,
    "memo-continuation": memo_continuation,
    "plain-continuation": partial(paper_continuation, journal="plain"),
    "two-column-continuation": partial(paper_continuation, journal="two-column"),
}
TITLE_LABELS = """title author affiliation abstract keywords date doi licence header footer page-number section-title
body figure caption footnote margin-note logo correspondence other"""
LETTER_LABELS = """letterhead date receiver subject salutation body closing signature enclosure typist-initials ps cc
reference footer page-number stamp handwriting other title sender field"""
LABELS = {*TITLE_LABELS.split(), *LETTER_LABELS.split()}
ALWAYS = {
    "letter": {"date", "receiver", "salutation", "body", "closing", "signature"},
    "memo": {"title", "receiver", "sender", "date", "subject", "body"},
    "fax": {"title", "receiver", "sender", "date", "field", "subject"},
    "plain": {"header", "title", "author", "affiliation", "abstract", "section-title", "body", "page-number"},
    "two-column": {"title", "author", "affiliation", "abstract", "section-title", "body", "page-number"},
    "margin": {"logo", "title", "author", "doi", "margin-note", "date", "licence", "body", "footer"},
    "letter-continuation": {"body", "closing", "signature"},
    "memo-continuation": {"subject", "page-number", "body"},
    "plain-continuation": {"header", "page-number", "body"},
    "two-column-continuation": {"header", "page-number", "body"},
}
DARK = 70
"""Below the gray of a rule, which is no zone."""


@pytest.mark.parametrize("name", MAKERS)
def test_zones_are_those_of_the_class(name: str) -> None:
    pages = [MAKERS[name](np.random.default_rng(seed), draw=False) for seed in range(40)]
    for page in pages:
        found = {zone.label for zone in page.zones}
        assert page.document_class == name
        assert ALWAYS[name] <= found <= LABELS
        assert len({zone.id for zone in page.zones}) == len(page.zones)
        for zone in page.zones:
            x0, y0, x1, y1 = zone.box
            assert 0 <= x0 < x1 <= page.width
            assert 0 <= y0 < y1 <= page.height
            assert (zone.kind == "text") == bool(zone.text) == bool(zone.lines) == (zone.font_size > 0)
    # Pages of one class differ: in the number of their zones, and in where they stand.
    assert len({len(page.zones) for page in pages}) >= 4
    assert len({tuple(zone.box for zone in page.zones) for page in pages}) == len(pages)


@pytest.mark.parametrize("name", MAKERS)
def test_zones_do_not_overlap(name: str) -> None:
    for seed in range(60):
        page = MAKERS[name](np.random.default_rng(seed), draw=False)
        boxes = np.array([zone.box for zone in page.zones], float)
        low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
        high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
        shared = (high - low).clip(0).prod(axis=2)
        np.fill_diagonal(shared, 0.0)
        worst = np.unravel_index(int(shared.argmax()), shared.shape)
        assert shared.max() == 0.0, (seed, [page.zones[int(index)] for index in worst])


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("scale", [1.0, 0.6])
def test_boxes_hold_the_ink(name: str, scale: float) -> None:
    page = MAKERS[name](np.random.default_rng(7), scale=scale)
    assert page.image is not None
    assert page.image.shape == (page.height, page.width)
    assert page.image.dtype == np.uint8
    outside = page.image < DARK
    for zone in page.zones:
        x0, y0, x1, y1 = zone.box
        ink = page.image[y0:y1, x0:x1] < DARK
        assert ink.any(), zone
        columns, rows = np.flatnonzero(ink.any(axis=0)), np.flatnonzero(ink.any(axis=1))
        # The ink reaches the box's sides within what rounding and thin strokes of a letter take.
        slack = 3 + 0.15 * zone.font_size
        assert columns[0] <= slack
        assert x1 - x0 - 1 - columns[-1] <= slack + 0.02 * (x1 - x0), zone
        assert rows[0] <= slack + 6 * scale or zone.label == "signature", zone
        assert y1 - y0 - 1 - rows[-1] <= slack + 6 * scale, zone
        outside[max(0, y0 - 2) : y1 + 2, max(0, x0 - 2) : x1 + 2] = False
    assert not outside.any()


def test_scale_is_the_resolution() -> None:
    small, large = (letter_page(np.random.default_rng(3), scale=s, draw=False) for s in (1.0, 2.0))
    assert (large.width, large.dpi) == (2 * small.width, 300)
    assert [zone.text for zone in small.zones] == [zone.text for zone in large.zones]
    boxes, halves = (np.array([zone.box for zone in page.zones], float) for page in (large, small))
    # Letters are fitted to the pixels: their advances at 150 dpi are up to some 4 % off.
    np.testing.assert_allclose(boxes[:, [1, 3]], 2 * halves[:, [1, 3]], atol=6)
    np.testing.assert_allclose(boxes[:, [0, 2]], 2 * halves[:, [0, 2]], atol=0.05 * large.width)
    with pytest.raises(ValueError, match="scale"):
        letter_page(np.random.default_rng(3), scale=0.0)


@pytest.mark.parametrize("name", MAKERS)
def test_drawing_changes_no_zone(name: str) -> None:
    drawn, plain = (MAKERS[name](np.random.default_rng(11), draw=draw) for draw in (True, False))
    assert plain.image is None
    assert drawn.zones == plain.zones


def test_optional_parts_come_and_go() -> None:
    pages = [letter_page(np.random.default_rng(seed), draw=False) for seed in range(200)]
    counts = Counter(label for page in pages for label in {zone.label for zone in page.zones})
    optional = (
        "subject",
        "typist-initials",
        "enclosure",
        "cc",
        "ps",
        "reference",
        "footer",
        "stamp",
        "letterhead",
    )
    for label in (*optional, "page-number", "handwriting"):
        assert 2 <= counts[label] <= 195, label


def test_the_document_is_ready_for_json() -> None:
    page = title_page(np.random.default_rng(0), "margin", draw=False)
    document = json.loads(json.dumps(page.document()))
    assert (document["width"], document["height"]) == (page.width, page.height)
    assert set(document["zones"][0]) == {"id", "box", "label", "kind", "font_size", "lines", "text"}
    assert [zone["label"] for zone in document["zones"]] == [zone.label for zone in page.zones]


def test_there_are_three_publications() -> None:
    with pytest.raises(ValueError, match="no such publication"):
        title_page(np.random.default_rng(0), "gazette")  # type: ignore[arg-type]


@pytest.mark.pipeline
def test_graphs_without_pictures_are_quick() -> None:
    letter_page(np.random.default_rng(0), draw=False)
    began = time.process_time()
    for seed in range(60):
        for maker in MAKERS.values():
            maker(np.random.default_rng(seed), draw=False)
    # 3 ms a page, three times that on a busy machine.
    assert time.process_time() - began < 60 * len(MAKERS) * 0.009


@pytest.mark.parametrize("kind", get_args(DocumentKind))
def test_documents_begin_and_go_on_and_end(kind: DocumentKind) -> None:
    for seed in range(12):
        pages = document_pages(np.random.default_rng(seed), kind, 3, draw=False)
        assert [page.document_class for page in pages] == [kind, *[f"{kind}-continuation"] * 2]
        labels = [{zone.label for zone in page.zones} for page in pages]
        assert all("body" in page for page in labels)
        assert "title" not in labels[1] | labels[2]
        if kind == "letter":
            assert ["closing" in page for page in labels] == [False, False, True]
    alone = document_pages(np.random.default_rng(5), kind, 1, draw=False)
    assert [page.zones for page in alone] == [MAKERS[kind](np.random.default_rng(5), draw=False).zones]


def test_there_is_no_such_document() -> None:
    with pytest.raises(ValueError, match="no such document"):
        document_pages(np.random.default_rng(0), "letter", 0)
    with pytest.raises(ValueError, match="goes on"):
        paper_continuation(np.random.default_rng(0), "margin")
