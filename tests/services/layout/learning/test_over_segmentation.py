"""Pages in pieces, as a segmenter may find them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.layout.learning.over_segmentation import over_segment
from services.layout.page import Page, Zone
from tests.services.layout.samples import labelled_page


@pytest.fixture
def cut_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every gap is cut, and there is no speck."""
    monkeypatch.setattr("services.layout.learning.over_segmentation._CUT", 100.0)
    monkeypatch.setattr("services.layout.learning.over_segmentation._SPECKS", 0.0)


@pytest.mark.usefixtures("cut_everywhere")
def test_a_zone_is_cut_between_its_lines() -> None:
    zone = Zone(
        "z", (10, 100, 90, 160), lines=3, text="one\ntwo words\nthree", label="body", content={"date": 1.0}
    )
    pieces = over_segment(Page(100, 200, (zone,)), np.random.default_rng(0)).zones
    assert [piece.text for piece in pieces] == ["one", "two words", "three"]
    assert [piece.label for piece in pieces] == ["body"] * 3
    assert [piece.lines for piece in pieces] == [1, 1, 1]
    assert [piece.box for piece in pieces] == [(10, 100, 90, 118), (10, 122, 90, 138), (10, 142, 90, 160)]
    assert all(not piece.content for piece in pieces), "it is of the whole zone's text"


def test_zones_that_are_said_to_have_thousands_of_lines_make_no_thousands_of_zones() -> None:
    zones = tuple(Zone(str(index), (0, 0, 900, 900), lines=100_000, label="body") for index in range(300))
    found = over_segment(Page(1000, 1000, zones), np.random.default_rng(0))
    assert 300 <= len([zone for zone in found.zones if zone.kind == "text"]) <= 500
    assert {zone.id.partition(".")[0] for zone in found.zones if zone.kind == "text"} == {
        zone.id for zone in zones
    }


@pytest.mark.usefixtures("cut_everywhere")
def test_words_are_shared_out_where_line_ends_are_not_known() -> None:
    zone = Zone("z", (0, 0, 90, 40), lines=2, text="a b c d e f", label="body")
    pieces = over_segment(Page(100, 200, (zone,)), np.random.default_rng(0)).zones
    assert [piece.text for piece in pieces] == ["a b c", "d e f"]


@pytest.mark.usefixtures("cut_everywhere")
@pytest.mark.parametrize("zone", [Zone("z", (0, 0, 9, 9)), Zone("z", (0, 0, 9, 9), kind="figure", lines=4)])
def test_what_has_no_lines_stays_whole(zone: Zone) -> None:
    assert over_segment(Page(10, 10, (zone,)), np.random.default_rng(0)).zones == (zone,)


def test_about_so_many_zones_are_cut_and_specks_added() -> None:
    rng = np.random.default_rng(1)
    pages = [labelled_page("letter", seed) for seed in range(40)]
    cut = [over_segment(page, rng) for page in pages]
    specks = sum(zone.kind in {"noise", "rule"} for page in cut for zone in page.zones)
    assert 1.0 < specks / len(pages) < 2.0
    several = sum((zone.lines or 0) > 1 for page in pages for zone in page.zones)
    whole = sum(
        (zone.lines or 0) > 1 and zone in page.zones
        for page, pieces in zip(pages, cut, strict=True)
        for zone in pieces.zones
    )
    assert 0.3 < whole / several < 0.8


@given(seed=st.integers(0, 10**6))
def test_pieces_cover_the_zones_and_keep_their_labels(seed: int) -> None:
    page = labelled_page("margin", seed % 20)
    pieces = over_segment(page, np.random.default_rng(seed))
    assert len({zone.id for zone in pieces.zones}) == len(pieces.zones)
    for zone in page.zones:
        mine = [piece for piece in pieces.zones if piece.id == zone.id or piece.id.startswith(f"{zone.id}.")]
        assert {piece.label for piece in mine} == {zone.label}
        assert min(piece.box[1] for piece in mine) == zone.box[1]
        assert max(piece.box[3] for piece in mine) == pytest.approx(zone.box[3])
    for zone in pieces.zones:
        x0, y0, x1, y1 = zone.box
        assert min(x0, y0) >= -1
        assert x0 < x1 <= page.width + 1
        assert y0 < y1 <= page.height + 1
