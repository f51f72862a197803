"""Relations of zones: by hand, near their tolerances, and their laws under shifts and mirrors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.graph.edge_attributes import ALIGNED_X, ALIGNED_Y, RELATIONS, measure_pairs, pair_zones
from services.layout.graph.layout_graph import MOST_NEIGHBOURS
from services.layout.graph.node_attributes import describe_zones
from services.layout.page import Box, Page, Zone
from tests.services.layout.samples import page_of

STEP = 27.0
"""Of a page of 1000: no multiple of it lies near a tolerance or a bound of distances."""
ACROSS = ["left-left", "left-right", "right-left", "right-right", "centre-centre"]


def described(page: Page, upper: str, lower: str) -> dict[str, str]:
    """Descriptors of one pair by name."""
    measures = describe_zones(page)
    pairs = pair_zones(measures, MOST_NEIGHBOURS)
    names = [zone.id for zone in page.zones]
    (row,) = np.flatnonzero((pairs == [names.index(upper), names.index(lower)]).all(axis=1))
    found = measure_pairs(measures, pairs)
    return {each.name: each.descriptors[int(each.measure(found)[row])] for each in RELATIONS}


def test_a_title_over_a_narrower_paragraph_by_hand() -> None:
    title = Zone("title", (200, 100, 800, 160), font_size=40.0, lines=1)
    text = Zone("text", (200, 200, 500, 600), font_size=20.0, lines=20)
    assert described(Page(1000, 1000, (title, text)), "title", "text") == {
        "top-top": "below",
        "top-bottom": "below",
        "bottom-top": "below",
        "bottom-bottom": "below",
        "left-left": "aligned",
        "left-right": "to-the-right",
        "right-left": "to-the-left",
        "right-right": "to-the-left",
        "centre-centre": "to-the-left",
        "gap-along": "block",
        "gap-across": "none",
        "font-step": "much-smaller",
        "neighbours": "next",
        "places-apart": "one",
        "same-row": "apart",
    }


def test_two_columns_by_hand() -> None:
    found = described(page_of((50, 100, 480, 900), (520, 100, 950, 700)), "z0", "z1")
    assert found == {
        "top-top": "aligned",
        "top-bottom": "below",
        "bottom-top": "above",
        "bottom-bottom": "above",
        "left-left": "to-the-right",
        "left-right": "to-the-right",
        "right-left": "to-the-right",
        "right-right": "to-the-right",
        "centre-centre": "to-the-right",
        "gap-along": "touching",
        "gap-across": "narrow",
        "font-step": "alike",
        "neighbours": "apart",
        "places-apart": "one",
        "same-row": "same",
    }


@pytest.mark.parametrize(
    ("relation", "shift_x", "shift_y"),
    [("left-left", 1, 0), ("right-right", 1, 0), ("centre-centre", 1, 0), ("bottom-bottom", 0, 1)],
)
def test_boundaries_are_aligned_within_their_tolerance(relation: str, shift_x: int, shift_y: int) -> None:
    tolerance = 1000 * (ALIGNED_X * shift_x + ALIGNED_Y * shift_y)
    names = ("to-the-left", "to-the-right") if shift_x else ("above", "below")
    for share, expected in ((-1.01, names[0]), (-0.99, "aligned"), (0.99, "aligned"), (1.01, names[1])):
        x, y = share * tolerance * shift_x, share * tolerance * shift_y
        # The lower zone starts below, so that it stays the lower one.
        upper, lower = (100, 100, 300, 300), (100 + x, 150, 300 + x, 300 + y)
        assert described(page_of(upper, lower), "z0", "z1")[relation] == expected


def test_tops_are_aligned_within_their_tolerance() -> None:
    for share, expected in ((0.0, "aligned"), (0.99, "aligned"), (1.01, "below")):
        lower = (300.0, 100 + share * 1000 * ALIGNED_Y, 400.0, 200.0)
        assert described(page_of((100, 100, 200, 200), lower), "z0", "z1")["top-top"] == expected


@pytest.mark.parametrize(
    ("sizes", "step"),
    [
        ((20, 10), "much-smaller"),
        ((20, 17), "smaller"),
        ((20, 20), "alike"),
        ((20, 23), "larger"),
        ((20, 40), "much-larger"),
        ((20, None), "alike"),
    ],
)
def test_steps_of_font_sizes(sizes: tuple[float, float | None], step: str) -> None:
    zones = tuple(
        Zone(f"z{k}", (0, 100 * k, 9, 100 * k + 50), font_size=size) for k, size in enumerate(sizes)
    )
    assert described(Page(1000, 1000, zones), "z0", "z1")["font-step"] == step


def test_neighbours_are_next_in_their_columns() -> None:
    # z0 is wide; z1 and z2 stand under it, z3 under z1.
    page = page_of((0, 0, 900, 50), (0, 100, 400, 150), (500, 120, 900, 170), (0, 200, 400, 250))
    found = {
        pair: described(page, *pair)["neighbours"] for pair in (("z0", "z1"), ("z0", "z2"), ("z1", "z3"))
    }
    assert found == {("z0", "z1"): "next", ("z0", "z2"): "next-above", ("z1", "z3"): "next"}
    assert described(page, "z0", "z3")["neighbours"] == "apart"
    assert described(page, "z1", "z2")["neighbours"] == "apart"
    assert described(page, "z0", "z3")["places-apart"] == "three"


def test_every_descriptor_is_one_of_its_relation() -> None:
    rng = np.random.default_rng(5)
    corners = rng.uniform(0, 900, (60, 2))
    boxes = np.hstack([corners, corners + rng.uniform(1, 400, (60, 2))])
    measures = describe_zones(page_of(*map(tuple, boxes.tolist())))
    found = measure_pairs(measures, pair_zones(measures, MOST_NEIGHBOURS))
    for relation in RELATIONS:
        descriptors = relation.measure(found)
        assert descriptors.min() >= 0
        assert descriptors.max() < len(relation.descriptors)
        # No sizes are known here; and the bottom of a lower zone lies above an upper one's top in none.
        expected = 1 if relation.name in ("font-step", "top-bottom") else 2
        assert len(np.unique(descriptors)) >= expected, f"{relation.name} tells zones apart"


grid_boxes = st.lists(
    # Of odd heights, so that no zone shares just half of a row.
    st.tuples(st.integers(0, 20), st.integers(0, 20), st.integers(1, 12), st.sampled_from([1, 3, 5, 9])),
    min_size=2,
    max_size=9,
    unique=True,
)


def on_grid(cells: list[tuple[int, int, int, int]]) -> list[Box]:
    return [(x * STEP, y * STEP, (x + w) * STEP, (y + h) * STEP) for x, y, w, h in cells]


def table(boxes: list[Box]) -> dict[tuple[int, int], dict[str, int]]:
    measures = describe_zones(page_of(*boxes))
    pairs = pair_zones(measures, MOST_NEIGHBOURS)
    found = measure_pairs(measures, pairs)
    columns = {relation.name: relation.measure(found).tolist() for relation in RELATIONS}
    return {
        (int(upper), int(lower)): {name: column[row] for name, column in columns.items()}
        for row, (upper, lower) in enumerate(pairs)
    }


@settings(max_examples=50, deadline=None)
@given(grid_boxes, st.integers(-3, 5), st.integers(-3, 5))
def test_relations_stay_when_the_page_content_is_shifted(
    cells: list[tuple[int, int, int, int]], x: int, y: int
) -> None:
    shifted = [(x0 + x, y0 + y, w, h) for x0, y0, w, h in cells]
    assert table(on_grid(shifted)) == table(on_grid(cells))


@settings(max_examples=50, deadline=None)
@given(grid_boxes)
def test_a_mirror_swaps_left_and_right(cells: list[tuple[int, int, int, int]]) -> None:
    boxes = on_grid(cells)
    # One of each height, so that who is upper is sure.
    boxes = list({box[1]: box for box in boxes}.values())
    plain = table(boxes)
    mirrored = table([(1000 - x1, y0, 1000 - x0, y1) for x0, y0, x1, y1 in boxes])
    assert plain.keys() == mirrored.keys()
    swap = {"left-left": "right-right", "left-right": "right-left", "centre-centre": "centre-centre"}
    for pair, found in plain.items():
        for name, other in swap.items():
            assert mirrored[pair][name] == 2 - found[other]
            assert mirrored[pair][other] == 2 - found[name]
        for name in ("top-top", "bottom-bottom", "gap-along", "gap-across", "same-row", "places-apart"):
            assert mirrored[pair][name] == found[name]


@settings(max_examples=50, deadline=None)
@given(grid_boxes)
def test_all_zones_of_a_usual_page_are_paired_once(cells: list[tuple[int, int, int, int]]) -> None:
    boxes = on_grid(cells)
    pairs = table(boxes)
    assert {frozenset(pair) for pair in pairs} == {
        frozenset((i, j)) for i in range(len(boxes)) for j in range(i)
    }
    for upper, lower in pairs:
        assert (boxes[upper][1], boxes[upper][0]) <= (boxes[lower][1], boxes[lower][0])


@pytest.mark.parametrize("crowd", ["spread", "one place"])
def test_crowded_pages_have_the_nearest_pairs_only(crowd: str) -> None:
    rng = np.random.default_rng(1)
    corners = rng.uniform(0, 950, (500, 2)) if crowd == "spread" else np.full((500, 2), 10.0)
    measures = describe_zones(page_of(*map(tuple, np.hstack([corners, corners + 20]).tolist())))
    pairs = pair_zones(measures, MOST_NEIGHBOURS)
    assert 500 * MOST_NEIGHBOURS / 2 <= len(pairs) <= 500 * MOST_NEIGHBOURS
    assert len({frozenset(pair) for pair in pairs.tolist()}) == len(pairs)
    assert np.bincount(pairs.ravel(), minlength=500).min() >= MOST_NEIGHBOURS
    assert (pairs[:, 0] != pairs[:, 1]).all()


def test_pairs_of_crowded_pages_do_not_depend_on_the_order_of_zones() -> None:
    cells = [(30.0 * (k % 10), 30.0 * (k // 10)) for k in range(100)]
    boxes = np.array([(x, y, x + 20, y + 20) for x, y in cells])
    order = np.random.default_rng(2).permutation(100)

    def pairs(of: np.ndarray) -> np.ndarray:
        return pair_zones(describe_zones(page_of(*map(tuple, of.tolist()))), MOST_NEIGHBOURS)

    assert {tuple(pair) for pair in order[pairs(boxes[order])].tolist()} == {
        tuple(pair) for pair in pairs(boxes).tolist()
    }


def test_pages_of_no_and_one_zone_have_no_pairs() -> None:
    assert table([]) == {}
    assert table([(0, 0, 9, 9)]) == {}
