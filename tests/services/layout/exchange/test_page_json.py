"""The contract's zones JSON: what is a page, and what is told of everything else."""

import json
import math
from typing import Any

import pytest
from hypothesis import given, settings

from services.layout.exchange.page_json import page_from_document, page_to_document
from services.layout.page import InkAppearance, InvalidLayout, Page, Zone, ZoneWord
from tests.services.layout.exchange.pages import LIMITS, pages

BOX = [10, 20, 30, 40]
NAMES = ("density", "size", "size_spread", "stroke", "slant", "regularity")


def document(*zones: Any, width: Any = 100, height: Any = 200) -> dict[str, Any]:
    return {"width": width, "height": height, "zones": list(zones)}


def zone(**more: Any) -> dict[str, Any]:
    return {"id": "z1", "box": BOX, **more}


@given(pages())
@settings(max_examples=40, deadline=None)
def test_round_trip(page: Page) -> None:
    assert page_from_document(json.loads(json.dumps(page_to_document(page))), LIMITS) == page


def test_what_a_result_says_is_a_page() -> None:
    result = {
        "id": "01J",
        "class": None,
        **document(
            {
                **{
                    "id": "z3",
                    "box": BOX,
                    "label": "receiver",
                    "confidence": 0.93,
                    "group": "receiver",
                    "order": 2,
                },
                **{
                    "kind": "text",
                    "lines": 4,
                    "font_size": 34.0,
                    "font_class": "normal",
                    "line_spacing": 48.2,
                },
                **{
                    "text": "Mr. ...",
                    "content": {"name": 0.9, "zipcode": 1.0},
                    "alignment": None,
                    "weight": None,
                },
            }
        ),
    }
    assert page_from_document(result, LIMITS).zones == (
        Zone(
            "z3",
            (10, 20, 30, 40),
            lines=4,
            font_size=34.0,
            line_spacing=48.2,
            text="Mr. ...",
            content={"name": 0.9, "zipcode": 1.0},
            label="receiver",
        ),
    )


def test_pieces_are_kept_and_wrong_ones_refused() -> None:
    pieces = [[10, 20, 30, 40], [10, 50, 30, 60]]
    page = page_from_document(document(zone(pieces=pieces)), LIMITS)
    assert page.zones[0].pieces == ((10, 20, 30, 40), (10, 50, 30, 60))
    assert page_to_document(page)["zones"][0]["pieces"] == pieces
    for wrong, field in (("two", "zones[0].pieces"), ([[1, 2, 3]], "zones[0].pieces[0]")):
        with pytest.raises(InvalidLayout) as refused:
            page_from_document(document(zone(pieces=wrong)), LIMITS)
        assert refused.value.field == field


WORDS = (
    ZoneWord("Total", (10.0, 10.0, 60.0, 22.0), 0.9, 0),
    ZoneWord("9.50", (10.0, 30.0, 50.0, 42.0), 0.75, 1),
)


def test_words_are_kept_in_whole_pixels() -> None:
    zone = Zone("a", (10.0, 10.0, 60.0, 42.0), text="Total\n9.50", words=WORDS)
    told = json.loads(json.dumps(page_to_document(Page(100.0, 100.0, (zone,)))))
    assert told["zones"][0]["printed"][1] == ["9.50", 10, 30, 50, 42, 0.75, 1]
    assert page_from_document(told, LIMITS).zones[0].words == WORDS


@pytest.mark.parametrize(
    "wrong",
    [
        "Total",
        [["Total", 10, 10, 60, 22, 0.9]],
        [["Total", 10, 10, 60, 22, 1.5, 0]],
        [["Total", 10, 10, math.inf, 22, 0.9, 0]],
        [["Total", 10, 10, 60, 22, 0.9, -1]],
        [[7, 10, 10, 60, 22, 0.9, 0]],
        [["", 10, 10, 60, 22, 0.9, 0]],
        [["x", 0, 0, 1, 1, 0.9, 0]] * 5001,
    ],
)
def test_words_that_are_none_are_passed_over(wrong: object) -> None:
    zone = {"id": "a", "box": [10, 10, 60, 42], "text": "Total", "printed": wrong}
    [read] = page_from_document({"width": 100, "height": 100, "zones": [zone]}, LIMITS).zones
    assert read.words == ()
    assert read.text == "Total"


def test_appearance_is_kept() -> None:
    looks = {"density": 0.2, "size": 1.1, "size_spread": 0.4, "stroke": 0.9, "slant": -0.1, "regularity": 1}
    page = page_from_document(document(zone(appearance=looks)), LIMITS)
    assert page.zones[0].appearance == InkAppearance(0.2, 1.1, 0.4, 0.9, -0.1, 1.0)
    assert page_from_document(page_to_document(page), LIMITS) == page


@pytest.mark.parametrize(
    "wrong", ["print", {}, {"density": 0.2}, {"density": float("nan")}, dict.fromkeys(NAMES, 1e9)]
)
def test_a_wrong_appearance_is_refused(wrong: object) -> None:
    with pytest.raises(InvalidLayout) as refused:
        page_from_document(document(zone(appearance=wrong)), LIMITS)
    assert refused.value.field == "zones[0].appearance"


def test_whole_ids_sizes_of_none_and_labels() -> None:
    page = page_from_document(
        document(zone(id=7, font_size=0, label=" title ", lines=2.0, text=None)), LIMITS
    )
    assert page.zones == (Zone("7", (10, 20, 30, 40), lines=2, label="title"),)


def test_boxes_are_clipped_to_the_page() -> None:
    page = page_from_document(document(zone(box=[-5, -0.5, 100.5, 250])), LIMITS)
    assert page.zones[0].box == (0, 0, 100, 200)


def test_a_page_may_have_no_zones() -> None:
    assert page_from_document(document(), LIMITS) == Page(100, 200, ())


@pytest.mark.parametrize(
    ("given_", "field"),
    [
        (None, "zones"),
        ([], "zones"),
        ("zones", "zones"),
        ({"width": 1, "height": 1}, "zones"),
        ({"width": 1, "height": 1, "zones": {}}, "zones"),
        ({"height": 1, "zones": []}, "width"),
        ({"width": 1, "zones": []}, "height"),
        (document(width=None), "width"),
        (document(width="100"), "width"),
        (document(width=True), "width"),
        (document(width=math.nan), "width"),
        (document(width=math.inf), "width"),
        (document(width=10**400), "width"),
        (document(width=0), "width"),
        (document(height=-3), "height"),
        (document(height=100_001), "height"),
        (document(*(zone(id=i) for i in range(501))), "zones"),
        (document(zone(), 5), "zones[1]"),
        (document({"box": BOX}), "zones[0].id"),
        (document(zone(id=None)), "zones[0].id"),
        (document(zone(id=1.5)), "zones[0].id"),
        (document(zone(id=True)), "zones[0].id"),
        (document(zone(id="")), "zones[0].id"),
        (document(zone(id="x" * 101)), "zones[0].id"),
        (document(zone(id=10**5000)), "zones[0].id"),
        (document(zone(id="a\nb")), "zones[0].id"),
        (document(zone(id="\ud800")), "zones[0].id"),
        (document(zone(id=1), zone(id=2), zone(id="1")), "zones[2].id"),
        (document({"id": "z1"}), "zones[0].box"),
        (document(zone(), zone(id=2), zone(id=3), zone(id=4, box="10 20 30 40")), "zones[3].box"),
        (document(zone(box=[1, 2, 3])), "zones[0].box"),
        (document(zone(box=[1, 2, 3, 4, 5])), "zones[0].box"),
        (document(zone(box=[1, 2, "3", 4])), "zones[0].box"),
        (document(zone(box=[1, 2, math.nan, 4])), "zones[0].box"),
        (document(zone(box=[1, 2, 10**400, 4])), "zones[0].box"),
        (document(zone(box=[[], {}, [[]], None])), "zones[0].box"),
        (document(zone(box=[30, 20, 10, 40])), "zones[0].box"),
        (document(zone(box=[10, 20, 30, 20])), "zones[0].box"),
        (document(zone(box=[100, 0, 110, 10])), "zones[0].box"),
        (document(zone(box=[-20, -20, -10, -10])), "zones[0].box"),
        (document(zone(box=[10, 20, 1e9, 40])), "zones[0].box"),
        (document(zone(kind="table")), "zones[0].kind"),
        (document(zone(kind=[])), "zones[0].kind"),
        (document(zone(lines=-1)), "zones[0].lines"),
        (document(zone(lines=1.5)), "zones[0].lines"),
        (document(zone(lines="3")), "zones[0].lines"),
        (document(zone(lines=math.inf)), "zones[0].lines"),
        (document(zone(font_size=-1)), "zones[0].font_size"),
        (document(zone(font_size=math.nan)), "zones[0].font_size"),
        (document(zone(line_spacing=1e9)), "zones[0].line_spacing"),
        (document(zone(weight="bold")), "zones[0].weight"),
        (document(zone(alignment="center")), "zones[0].alignment"),
        (document(zone(text=5)), "zones[0].text"),
        (document(zone(text="x" * 100_001)), "zones[0].text"),
        (document(zone(text="\udc00")), "zones[0].text"),
        (document(zone(label=5)), "zones[0].label"),
        (document(zone(label="")), "zones[0].label"),
        (document(zone(label="x" * 61)), "zones[0].label"),
        (document(zone(label="a\tb")), "zones[0].label"),
        (document(zone(content=[])), "zones[0].content"),
        (document(zone(content={"date": 1.5})), "zones[0].content"),
        (document(zone(content={"date": None})), "zones[0].content"),
        (document(zone(content={"": 0.5})), "zones[0].content"),
        (document(zone(content={str(i): 0.5 for i in range(101)})), "zones[0].content"),
    ],
)
def test_what_is_refused(given_: Any, field: str) -> None:
    with pytest.raises(InvalidLayout) as refusal:
        page_from_document(given_, LIMITS)
    assert refusal.value.field == field
    assert refusal.value.detail.isascii()
    assert 20 < len(refusal.value.detail) < 300
