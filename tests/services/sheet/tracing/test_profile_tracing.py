"""Lines of drawn words are traced to a fraction of a pixel, across gaps and creases, and none where there are none."""

import cv2
import numpy as np
import pytest

from services.arrays import Floats, Points, Vector
from services.geometry.page_map import PlaneMap
from services.kernels.library import find_kernels
from services.sheet.developable.observations import LineObservations
from services.sheet.tracing.profile_tracing import (
    FlatGray,
    ProfileParameters,
    Ridges,
    flatten_darkness,
    link_ridges,
    link_ridges_plain,
    trace_profiles,
)

H = 10.0
"""Text height in pixels."""
SIZE = (500, 360)
SCALE = 400.0
FLAT = PlaneMap(np.eye(3))


def words(
    baselines: Floats, seed: int = 0, gap: tuple[float, float] | None = None, size: tuple[int, int] = SIZE
) -> Floats:
    """Darkness (H, W) of lines of letters that stand on `baselines` (N, W); none between the columns `gap`."""
    rng = np.random.default_rng(seed)
    width, height = size
    dark = np.zeros((height, width), np.float32)
    y = np.arange(height)[:, None]
    for base in baselines:
        x = 30.0
        while x < width - 36:
            for _ in range(rng.integers(3, 8)):
                if x > width - 36:
                    break
                letter = 0.8 * H if rng.random() > 0.25 else 1.15 * H
                at = np.arange(int(x), int(x) + 4)
                if gap is None or not gap[0] < x < gap[1]:
                    # Share of every pixel that lies between the letter's head and the line that it stands on.
                    inside = np.clip(base[at] - (y - 0.5), 0, 1) * np.clip(
                        y + 0.5 - (base[at] - letter), 0, 1
                    )
                    dark[:, at] = np.maximum(dark[:, at], 0.9 * inside)
                x += 6
            x += 6
    return dark


def flat_of(darkness: Floats, offset: tuple[float, float] = (0.0, 0.0)) -> FlatGray:
    return FlatGray(np.asarray(darkness, np.float32), SCALE, offset, H)


def level(count: int, spacing: float = 24.0, slope: Vector | float = 0.0) -> Floats:
    """Baselines (N, W) at fractions of pixels; `slope` is what they go down, (W,) pixels."""
    places = 40.3 + spacing * np.arange(count)
    return np.asarray(places[:, None] + np.broadcast_to(slope, (SIZE[0],)))


def pixels(lines: LineObservations, flat: FlatGray) -> Points:
    return np.asarray(lines.points * SCALE - flat.offset)


def baseline_errors(lines: LineObservations, flat: FlatGray, baselines: Floats) -> Vector:
    """Distances (M,) down from the true baseline of every point of a lower edge, the line's own constant left out."""
    at = pixels(lines, flat)
    found = []
    for line in np.unique(lines.index[lines.index % 2 == 0]):
        points = at[lines.index == line]
        x = np.clip(np.round(points[:, 0]).astype(int), 0, SIZE[0] - 1)
        off = points[:, 1][:, None] - baselines[:, x].T
        nearest = int(np.argmin(np.abs(off).mean(axis=0)))
        found.append(off[:, nearest])
    return np.concatenate(found)


WAYS = {
    "level": 0.0,
    "sloping": 0.03 * np.arange(SIZE[0]),
    "rising": -0.05 * np.arange(SIZE[0]) + 20,
    "wavy": 6 * np.sin(np.arange(SIZE[0]) / 70),
    "creased": 0.06 * np.abs(np.arange(SIZE[0]) - 250.0),
}


@pytest.mark.parametrize("name", WAYS)
def test_baselines_are_found_to_a_fraction_of_a_pixel(name: str) -> None:
    truth = level(10, slope=WAYS[name])
    flat = flat_of(words(truth))
    lines = trace_profiles(flat, FLAT)
    assert lines.count == 20
    off = baseline_errors(lines, flat, truth)
    # The pixel above the baseline is the last dark one: its edge lies half a pixel below its centre.
    assert abs(np.median(off)) < 0.6
    assert np.quantile(np.abs(off - np.median(off)), 0.9) < 0.4


def test_every_line_has_its_two_edges_a_text_height_apart() -> None:
    flat = flat_of(words(level(8)))
    lines = trace_profiles(flat, FLAT)
    at = pixels(lines, flat)
    for k in range(8):
        base, crown = at[lines.index == 2 * k], at[lines.index == 2 * k + 1]
        assert np.allclose(base[:, 0], crown[:, 0])
        assert 0.6 * H < np.median(base[:, 1] - crown[:, 1]) < 1.2 * H
    assert lines.text_height == pytest.approx(0.9 * H / SCALE, rel=0.2)
    assert (lines.deviations > 0).all()


@pytest.mark.parametrize("gap", [(200.0, 236.0), (240.0, 280.0)])
def test_lines_go_on_across_a_gap(gap: tuple[float, float]) -> None:
    truth = level(8, slope=0.03 * np.arange(SIZE[0]))
    flat = flat_of(words(truth, gap=gap))
    lines = trace_profiles(flat, FLAT)
    assert lines.count == 16
    at = pixels(lines, flat)
    for k in range(16):
        reach = at[lines.index == k, 0]
        assert reach.min() < 80
        assert reach.max() > 420


def test_two_columns_are_lines_of_their_own() -> None:
    truth = level(8)
    lines = trace_profiles(flat_of(words(truth, gap=(200.0, 320.0))), FLAT)
    assert lines.count == 32


def test_spacing_paragraphs_and_margins_are_observed() -> None:
    places = np.concatenate([np.arange(5), np.arange(5) + 6.2]) * 24.0 + 40.3
    truth = np.repeat(places[:, None], SIZE[0], axis=1)
    flat = flat_of(words(truth))
    lines = trace_profiles(flat, FLAT)
    assert lines.count == 20
    assert sorted(len(run.lines) for run in lines.runs) == [5, 5]
    for run in lines.runs:
        assert (run.lines % 2 == 0).all()
        y = np.array([pixels(lines, flat)[lines.index == k, 1].mean() for k in run.lines])
        assert np.polyfit(run.order, y, 1)[0] == pytest.approx(24.0, abs=0.2)
    assert [sorted(group) for group in lines.alike] == [[0, 1]]
    left = [m for m in lines.margins if m[:, 0].mean() * SCALE < 100]
    assert len(left) == 1
    assert np.abs(left[0][:, 0] * SCALE - 30).max() < 2


def test_the_view_may_begin_anywhere() -> None:
    darkness = words(level(6))
    here, there = (trace_profiles(flat_of(darkness, offset), FLAT) for offset in ((0.0, 0.0), (120.0, -40.0)))
    assert there.count == here.count == 12
    assert np.allclose(there.points - here.points, np.array([120.0, -40.0]) / SCALE)


def test_points_are_seen_through_the_page_map() -> None:
    map_ = PlaneMap(np.array([[0.9, 0.1, 0.1], [-0.05, 1.1, -0.2], [0.05, 0.1, 1.0]]))
    flat = flat_of(words(level(6)))
    plain, leaning = trace_profiles(flat, FLAT), trace_profiles(flat, map_)
    assert np.allclose(leaning.points, map_.to_photo(plain.points))
    assert np.array_equal(leaning.index, plain.index)


def test_blank_paper_and_grain_have_no_lines() -> None:
    assert trace_profiles(flat_of(np.zeros((200, 300))), FLAT).count == 0
    rng = np.random.default_rng(1)
    grain = cv2.GaussianBlur(rng.random((300, 400)).astype(np.float32), (0, 0), 3)
    grain = (grain - grain.min()) / np.ptp(grain)
    # By chance ridges may follow one another for a few windows, but not across the view.
    lines = trace_profiles(flat_of(grain), FLAT)
    whole = trace_profiles(flat_of(words(level(8))), FLAT)
    share = len(lines.points) / (300 * 400), len(whole.points) / (SIZE[0] * SIZE[1])
    assert share[0] < 0.5 * share[1]
    assert (
        max((np.ptp(lines.points[lines.index == k, 0]) * SCALE for k in np.unique(lines.index)), default=0)
        < 200
    )
    assert trace_profiles(flat_of(np.full((200, 300), 0.7)), FLAT).count == 0


def test_a_few_windows_are_no_line() -> None:
    darkness = words(level(4))
    darkness[:, 55:] = 0
    assert trace_profiles(flat_of(darkness), FLAT).count == 0


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_the_view_of_a_photo_shows_its_text_at_the_height_asked_for(scale: float) -> None:
    truth = level(10)
    darkness = words(truth)
    gray = cv2.resize(
        255 - np.round(255 * darkness).astype(np.uint8),
        None,
        fx=scale,
        fy=scale,
        interpolation=cv2.INTER_AREA,
    )
    gray = np.asarray(gray, np.uint8)
    unit = 300.0 * scale
    centre = np.array([gray.shape[1] / 2, gray.shape[0] / 2])
    H_gray_centred = np.array([[unit, 0, centre[0]], [0, unit, centre[1]], [0, 0, 1.0]])
    x, y = np.meshgrid(np.linspace(40, 460, 20) * scale, (truth[:, 0] - 5) * scale)
    text = (np.stack([x.ravel(), y.ravel()], axis=1) - centre) / unit
    area = np.zeros(gray.shape, bool)
    area[round(30 * scale) : round(290 * scale), round(20 * scale) : round(480 * scale)] = True
    flat = flatten_darkness(gray, area, H_gray_centred, FLAT, text, H * scale / unit)
    assert flat is not None
    assert flat.height_px == pytest.approx(10.0, rel=1e-6)
    lines = trace_profiles(flat, FLAT)
    assert lines.count == 20
    seen = lines.points[lines.index % 2 == 0] * unit + centre
    off = (seen[:, 1:] + 0.5) / scale - 0.5 - truth[:, 0]
    least = off[np.arange(len(off)), np.argmin(np.abs(off), axis=1)]
    assert np.abs(np.median(least)) < 1.0
    assert np.quantile(np.abs(least - np.median(least)), 0.9) < 0.6


def test_without_text_there_is_no_view() -> None:
    gray = np.full((100, 100), 255, np.uint8)
    area = np.ones(gray.shape, bool)
    assert flatten_darkness(gray, area, np.eye(3), FLAT, np.zeros((3, 2)), 0.02) is None
    assert flatten_darkness(gray, area, np.eye(3), FLAT, np.full((50, 2), np.nan), 0.02) is None


@pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
@pytest.mark.parametrize("spacing_px", [3.0, 8.0, 20.0])
@pytest.mark.parametrize("noise_px", [0.0, 0.5, 4.0])
@pytest.mark.parametrize("gap", [1, 2, 3])
def test_the_kernel_links_the_same_ridges(spacing_px: float, noise_px: float, gap: int) -> None:
    rng = np.random.default_rng([round(spacing_px), round(10 * noise_px), gap])
    counts = rng.integers(0, 30, 50) * (rng.random(50) < 0.8)
    window = np.repeat(np.arange(50), counts)
    rows = [np.sort(spacing_px * rng.choice(30, count) + rng.normal(0, noise_px, count)) for count in counts]
    y = np.round(np.concatenate(rows), 1)  # some are as good as others
    ridges, parameters = Ridges(window, y, y, y), ProfileParameters(gap=gap, min_windows=3)
    linked, plain = link_ridges(ridges, 8.0, parameters), link_ridges_plain(ridges, 8.0, parameters)
    assert [line.tolist() for line in linked] == [line.tolist() for line in plain]
    assert len(linked) > 3


def test_ridges_that_come_in_no_order_are_refused() -> None:
    y = np.zeros(3)
    with pytest.raises(ValueError, match="windows"):
        link_ridges(Ridges(np.array([0, 2, 1]), y, y, y), 8.0, ProfileParameters())
    assert link_ridges(Ridges(np.zeros(0, np.intp), y[:0], y[:0], y[:0]), 8.0, ProfileParameters()) == []
