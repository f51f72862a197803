"""What tells a gutter from the gap between two columns."""

import numpy as np
import pytest

from services.arrays import Points
from services.rectify.analysis.gutter import Gutter, direction_jump, find_gutter, row_gap
from services.texture_flow.field import FlowSamples

HEIGHT = 10.0


def blocks(gap: float) -> Points:
    """Characters of two blocks of text, `gap` text heights apart, in a photo of 900 x 1200."""
    rows = np.arange(150.0, 1050.0, 2 * HEIGHT)
    left = np.arange(450.0 - 0.5 * gap * HEIGHT, 100.0, -HEIGHT)
    right = 900.0 - left
    x, y = np.meshgrid(np.concatenate([left, right]), rows)
    return np.column_stack([x.ravel(), y.ravel()])


def flow_over(points: Points, turn_rad: float, bend: float = 0.0) -> FlowSamples:
    """Directions that turn by `turn_rad` at x = 450, and by `bend` times the square of the way to it, smoothly."""
    chosen = points[:: max(len(points) // 300, 1)]
    away = chosen[:, 0] - 450
    angles = np.sign(away) * (0.5 * turn_rad + bend * (np.abs(away) / (30 * HEIGHT)) ** 2)
    return FlowSamples(chosen, np.asarray(angles), np.ones(len(chosen)))


@pytest.mark.parametrize("gap", [2.0, 4.0, 9.0])
def test_the_gap_is_measured_across_the_line(gap: float) -> None:
    at = blocks(gap)
    assert row_gap(at[:, 0] - 450, at[:, 1], HEIGHT) == pytest.approx(gap, abs=0.01)
    # Where the line is within the gap does not matter.
    assert row_gap(at[:, 0] - 450 - 0.3 * gap * HEIGHT, at[:, 1], HEIGHT) == pytest.approx(gap, abs=0.01)


def test_a_few_short_lines_do_not_widen_the_gap() -> None:
    at = blocks(3.0)
    short = (np.floor(at[:, 1] / 20) % 2 == 0) & (at[:, 0] > 300) & (at[:, 0] < 450)
    assert row_gap(at[~short, 0] - 450, at[~short, 1], HEIGHT) == pytest.approx(3.0, abs=0.01)


def test_text_on_one_side_has_no_gap() -> None:
    at = blocks(3.0)
    at = at[at[:, 0] < 440]
    assert row_gap(at[:, 0] - 450, at[:, 1], HEIGHT) == float("inf")


@pytest.mark.parametrize("turn_deg", [0.0, 5.0, 20.0])
@pytest.mark.parametrize("bend", [0.0, 0.3])
def test_a_turn_is_told_from_a_bend(turn_deg: float, bend: float) -> None:
    flow = flow_over(blocks(4.0), np.deg2rad(turn_deg), bend)
    jump = direction_jump(flow.points[:, 0] - 450, flow.points[:, 1], flow, HEIGHT)
    assert np.degrees(jump) == pytest.approx(turn_deg, abs=2.0)


def spread_photo(dip: float) -> np.ndarray:
    """White paper, darker by the share `dip` in a gutter that is 12 pixels wide."""
    x = np.arange(900.0)
    light = 220 * (1 - dip * np.exp(-((x - 450) ** 2) / (2 * 6.0**2)))
    return np.repeat(np.tile(light, (1200, 1))[..., None], 3, axis=2).astype(np.uint8)


def gutter_of(gap: float, dip: float, turn_deg: float) -> Gutter | None:
    at = blocks(gap)
    return find_gutter(spread_photo(dip), at, HEIGHT, flow_over(at, np.deg2rad(turn_deg)), 0.0)


@pytest.mark.parametrize(("dip", "turn_deg"), [(0.4, 0.0), (0.3, 8.0)])
def test_a_gutter_is_a_dark_line_in_a_wide_gap(dip: float, turn_deg: float) -> None:
    gutter = gutter_of(9.0, dip, turn_deg)
    assert gutter is not None
    assert np.array_equal(gutter.right, blocks(9.0)[:, 0] > 450)
    assert gutter.line[:, 0] == pytest.approx(450, abs=12)
    assert gutter.jump_rad == pytest.approx(np.deg2rad(turn_deg), abs=0.03)


@pytest.mark.parametrize(("gap", "dip", "turn_deg"), [(3.0, 0.4, 20.0), (9.0, 0.0, 0.0), (9.0, 0.0, 20.0)])
def test_a_narrow_gap_and_a_bright_one_are_no_gutter(gap: float, dip: float, turn_deg: float) -> None:
    assert gutter_of(gap, dip, turn_deg) is None


def columns(starts: tuple[float, ...], width: float) -> Points:
    """Characters of blocks of text that begin at `starts` and are `width` pixels wide, in a photo 1000 high."""
    x = np.concatenate([np.arange(start, start + width, HEIGHT) for start in starts])
    return np.stack(np.meshgrid(x, np.arange(80.0, 920.0, 2 * HEIGHT)), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize(
    ("photo_width", "starts", "width", "gutter_at"),
    [
        (1400, (60.0, 790.0), 550.0, 700.0),
        # Books in two columns: the gap in the middle is clearly the widest.
        (1400, (60.0, 350.0, 790.0, 1080.0), 260.0, 700.0),
        (1400, (60.0, 520.0, 980.0), 360.0, None),
        (1400, (40.0, 380.0, 730.0, 1080.0), 270.0, None),
        (1400, (60.0, 520.0), 360.0, None),
        (1400, (60.0, 720.0), 630.0, None),
        (700, (40.0, 390.0), 270.0, None),
    ],
    ids=["book", "book in columns", "three", "four", "two on the left", "narrow gap", "upright sheet"],
)
def test_in_a_flat_scan_the_widest_gap_in_the_middle_of_a_broad_photo_is_the_gutter(
    photo_width: int, starts: tuple[float, ...], width: float, gutter_at: float | None
) -> None:
    at = columns(starts, width)
    scan = np.full((1000, photo_width, 3), 250, np.uint8)
    gutter = find_gutter(scan, at, HEIGHT, flow_over(at, 0.0), 0.0)
    assert (gutter is None) == (gutter_at is None)
    if gutter is not None and gutter_at is not None:
        assert gutter.line[:, 0] == pytest.approx(gutter_at, abs=30)
        assert np.array_equal(gutter.right, at[:, 0] > gutter_at)
