"""Text lines on synthetic ink whose places are known: traced to a fraction of a pixel, and nothing else traced."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from services.arrays import Floats, Mask, Points, Vector
from services.geometry.homographies import jacobians, resizing, scaling, transform_points, translation
from services.geometry.page_map import PlaneMap
from services.sheet.developable.observations import NO_LINES, LineObservations
from services.sheet.tracing.baselines import group_alike
from services.sheet.tracing.line_tracing import (
    FlatInk,
    flatten_ink,
    left_by_bends,
    measure_bend,
    measure_straightness,
    sampling_maps,
    trace_lines,
)
from tests.services.sheet.developable.sheets import Bent

X_HEIGHT, PITCH, SPACING = 12, 11, 34
LEFT = 60


@dataclass(frozen=True, slots=True)
class Print:
    """Paragraphs of lines, as (first baseline, number of lines), 90 boxes to the line, on a wave of `amplitude` px."""

    paragraphs: tuple[tuple[int, int], ...] = ((100, 8), (430, 6))
    amplitude: float = 5.0
    short: int = 30
    """Boxes that a paragraph's last line lacks."""
    descenders: bool = True

    def wave(self, x: Vector, line: int) -> Vector:
        """How far below its level line number `line` runs at x."""
        return np.asarray(self.amplitude * np.sin(2 * np.pi * x / 900 + 0.15 * line))

    @property
    def levels(self) -> Vector:
        """Heights of all baselines."""
        return np.concatenate([first + SPACING * np.arange(n) for first, n in self.paragraphs])

    def ink(self) -> Mask:
        """The print: x-high boxes with word spaces, a sixth of them with ascenders, an eighth with descenders."""
        ink = np.zeros((760, 1150), bool)
        last = np.cumsum([n for _, n in self.paragraphs]) - 1
        for line, level in enumerate(self.levels):
            for k in range(90 - (self.short if line in last else 0)):
                if k % 7 == 6:
                    continue
                x = LEFT + PITCH * k
                base = round(float(level + self.wave(np.array([x + 4.0]), line)[0]))
                up, down = k % 6 == 2, self.descenders and k % 8 == 3
                ink[base - X_HEIGHT - (5 if up else 0) : base + (5 if down else 0), x : x + 8] = True
        return ink


def identity(scale: float = 1.0) -> PlaneMap:
    """Photo coordinates are those of the page times `scale`."""
    return PlaneMap(scaling(scale))


def trace(print_: Print, page_map: PlaneMap | None = None) -> LineObservations:
    """Observations of ink in the flat view itself."""
    return trace_lines(FlatInk(print_.ink(), 1.0, (0.0, 0.0)), page_map or identity())


@pytest.mark.parametrize("amplitude", [0.0, 5.0, -4.0])
def test_points_lie_on_their_lines(amplitude: float) -> None:
    print_ = Print(amplitude=amplitude)
    lines = trace(print_)
    assert lines.count == 2 * 14
    found = set()
    for number in range(lines.count):
        x, y = lines.points[lines.index == number].T
        # Each box is a whole number of pixels: means of nine know better.
        level = print_.levels if number % 2 == 0 else print_.levels - X_HEIGHT
        k = int(np.argmin(np.abs(level - (y - amplitude * np.sin(2 * np.pi * x / 900)).mean())))
        assert np.abs(y - level[k] - print_.wave(x, k)).max() < 0.6
        assert np.sqrt(np.mean((y - level[k] - print_.wave(x, k)) ** 2)) < 0.35
        found.add((k, number % 2))
        short = k in (7, 13)
        # A piece is nine text heights long.
        assert len(x) == pytest.approx((90 - (30 if short else 0)) * PITCH / (9 * X_HEIGHT), abs=2.1)
        assert x.min() < LEFT + 80
        assert x.max() > LEFT + PITCH * (60 if short else 90) - 100
    assert found == {(k, side) for k in range(14) for side in (0, 1)}


def test_descenders_do_not_move_a_line() -> None:
    with_, without = trace(Print(amplitude=0.0)), trace(Print(amplitude=0.0, descenders=False))
    y = with_.points[with_.index == 0, 1]
    assert np.abs(y - without.points[without.index == 0, 1].mean()).max() < 0.1


def test_deviations_tell_how_well_a_piece_is_known() -> None:
    lines = trace(Print())
    # Pixels, design, and the wave within a piece: 0.02 of a text height at least, less than a pixel.
    assert (lines.deviations > 0.0199 * X_HEIGHT).all()
    assert (lines.deviations < 0.8).all()


def test_runs_are_the_paragraphs_baselines_in_order() -> None:
    lines = trace(Print())
    assert sorted(len(run.lines) for run in lines.runs) == [6, 8]
    for run in lines.runs:
        assert (run.lines % 2 == 0).all()
        y = np.array([lines.points[lines.index == number, 1].mean() for number in run.lines])
        assert np.allclose(np.diff(y) / np.diff(run.order), SPACING, atol=2.5)
        assert run.order[0] == 0
    # Both have one spacing.
    assert [sorted(group) for group in lines.alike] == [[0, 1]]


def test_runs_stay_in_their_column() -> None:
    ink = np.zeros((500, 1150), bool)
    for line in range(7):
        for k in range(40):
            # Lines of the left column begin higher than those of the right one, and end lower.
            for x, base in ((60 + PITCH * k, 100 + k / 4.0), (600 + PITCH * k, 104.0)):
                if x >= 600 and line >= 5:
                    continue
                y = round(base + SPACING * line)
                ink[y - X_HEIGHT : y, x : x + 8] = True
    lines = trace_lines(FlatInk(ink, 1.0, (0.0, 0.0)), identity())
    assert sorted(len(run.lines) for run in lines.runs) == [5, 7]
    for run in lines.runs:
        x, y = np.array([lines.points[lines.index == number].mean(axis=0) for number in run.lines]).T
        assert np.ptp(x) < 20
        assert np.allclose(np.diff(y) / np.diff(run.order), SPACING, atol=0.5)


def test_paragraphs_of_other_spacing_are_not_alike() -> None:
    ink = Print(paragraphs=((100, 8),)).ink()
    wide = Print(paragraphs=((430, 1), (475, 1), (520, 1), (565, 1), (610, 1)), short=0).ink()
    lines = trace_lines(FlatInk(ink | wide, 1.0, (0.0, 0.0)), identity())
    assert sorted(len(run.lines) for run in lines.runs) == [5, 8]
    assert lines.alike == []


def test_margins_are_the_flush_ends() -> None:
    lines = trace(Print(amplitude=2.0))
    sizes = sorted(len(m) for m in lines.margins)
    # All lines begin flush, and all but two end flush.
    assert sizes == [12, 14]
    left = next(m for m in lines.margins if len(m) == 14)
    right = next(m for m in lines.margins if len(m) == 12)
    assert np.allclose(left[:, 0], LEFT, atol=0.5)
    assert np.allclose(right[:, 0], LEFT + PITCH * 89 + 8, atol=0.5)
    levels = Print().levels
    assert np.abs(np.sort(left[:, 1]) - levels).max() < 4


def test_what_is_traced_is_told_in_the_photo() -> None:
    """The same ink on a page that is seen at another scale, turned and in perspective."""
    c, s = np.cos(0.2), np.sin(0.2)
    H = (
        np.array([[c, -s, 0.0], [s, c, 0.0], [1e-4, 5e-5, 1.0]])
        @ scaling(1 / 700)
        @ translation(-500.0, -350.0)
    )
    plain = trace(Print())
    scale, offset = 2.0, (30.0, -40.0)
    # Pixel p shows the page at (p + offset) / scale.
    page_map = PlaneMap(H @ translation(-offset[0], -offset[1]) @ scaling(scale))
    seen = trace_lines(FlatInk(Print().ink(), scale, offset), page_map)
    assert np.array_equal(seen.index, plain.index)
    assert np.allclose(seen.points, transform_points(H, plain.points))
    for a, b in zip(seen.margins, plain.margins, strict=True):
        assert np.allclose(a, transform_points(H, b))
    # How many pixels one unit of the photo is across the line.
    grow = np.linalg.norm(jacobians(np.linalg.inv(H), seen.points)[:, 1], axis=1)
    assert np.allclose(seen.deviations, plain.deviations / grow)
    assert seen.text_height == pytest.approx(X_HEIGHT / 700, rel=0.1)
    assert plain.text_height == pytest.approx(X_HEIGHT, rel=0.05)


def noise(share: float) -> Mask:
    """Specks of some pixels."""
    rng = np.random.default_rng(8)
    ink = np.zeros((700, 900), bool)
    for _ in range(int(share * 700 * 900 / 25)):
        x, y = int(rng.integers(0, 890)), int(rng.integers(0, 690))
        ink[y : y + int(rng.integers(2, 9)), x : x + int(rng.integers(2, 9))] = True
    return ink


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("share", [0.0, 0.002, 0.02])
def test_there_are_no_lines_in_specks(share: float) -> None:
    assert trace_lines(FlatInk(noise(share), 1.0, (0.0, 0.0)), identity()) is NO_LINES


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("share", [0.05, 0.2, 0.5])
def test_dense_specks_end_finite(share: float) -> None:
    lines = trace_lines(FlatInk(noise(share), 1.0, (0.0, 0.0)), identity())
    assert np.isfinite(lines.points).all()
    assert (lines.deviations > 0).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", [(1, 1), (5, 400), (400, 5)])
def test_tiny_views_have_no_lines(shape: tuple[int, int]) -> None:
    assert trace_lines(FlatInk(np.zeros(shape, bool), 1.0, (0.0, 0.0)), identity()) is NO_LINES
    assert trace_lines(FlatInk(np.ones(shape, bool), 1.0, (0.0, 0.0)), identity()) is NO_LINES


def test_values_are_grouped_within_the_tolerance_of_the_least() -> None:
    values = np.array([1.0, 2.0, 1.04, 5.0, 2.05, 1.049, 1.06, 2.11])
    groups = [sorted(g.tolist()) for g in group_alike(values)]
    # 1.06 is more than 5 % above 1, and stays alone, as do 5 and 2.11.
    assert groups == [[0, 2, 5], [1, 4]]
    assert group_alike(np.zeros(0)) == []
    assert group_alike(np.array([3.0])) == []


def test_the_flat_view_shows_the_ink_where_it_is() -> None:
    surface = Bent(anchor=(0.0, 0.0)).surface()
    u, v = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.5, 0.5, 11))
    page = np.stack([u.ravel(), v.ravel()], axis=1)
    H_reduced_centred = resizing(0.7) @ translation(499.5, 599.5) @ scaling(780.0)
    spots = np.round(transform_points(H_reduced_centred, surface.to_photo(page))).astype(int)
    page = np.asarray(surface.to_page(transform_points(np.linalg.inv(H_reduced_centred), spots)), np.float64)
    ink = np.zeros((840, 700), bool)
    for x, y in spots:
        ink[y - 2 : y + 3, x - 2 : x + 3] = True
    flat = flatten_ink(ink, H_reduced_centred, surface, surface.to_photo(page), 0.02)
    count, _, stats, centres = cv2.connectedComponentsWithStats(flat.ink.astype(np.uint8))
    assert count == 1 + len(page)
    found = flat.to_page(np.asarray(centres[1:], np.float64))
    distance = np.linalg.norm(found[:, None] - page[None], axis=2)
    assert sorted(distance.argmin(axis=1)) == list(range(len(page)))
    # A pixel of the reduced photo is 1 / 546 of a unit.
    assert distance.min(axis=1).max() < 0.4 / 546
    # 1.2 pixels of the view to one of the photo, three text heights round the text.
    area = stats[1:, cv2.CC_STAT_AREA].mean() / 25
    assert area == pytest.approx(1.44, rel=0.15)
    height, width = flat.ink.shape
    density = 546 * float(np.sqrt(np.median(1 / np.linalg.det(surface.jacobians(surface.to_photo(page))))))
    margin = 3 * 0.02 * 546 / density
    assert width / flat.scale == pytest.approx(0.8 + 2 * margin, rel=0.01)
    assert height / flat.scale == pytest.approx(1.0 + 2 * margin, rel=0.01)


def test_the_flat_view_is_bounded() -> None:
    text = np.random.default_rng(1).uniform(-0.5, 0.5, (50, 2))
    flat = flatten_ink(np.zeros((50, 40), bool), scaling(1e6), identity(30.0), text, 0.01)
    assert flat.ink.size < 1.01 * 8e6


def test_the_sampling_map_is_near_the_exact_one() -> None:
    surface = Bent().surface()
    scale, offset = 300.0, (-130.0, -160.0)
    image = np.array([[40.0, 0.0, 7.0], [0.0, 40.0, -3.0], [0.0, 0.0, 1.0]])
    dense = np.concatenate([seen for _, seen in sampling_maps(surface, 250, 331, scale, offset, image)])
    assert dense.shape == (331, 250, 2)
    rows, columns = np.mgrid[0:331, 0:250]

    exact = surface.to_photo((np.stack([columns.ravel(), rows.ravel()], axis=1) + offset) / scale)
    # A sheet that bends with a radius of 250 of this view's pixels.
    away = (dense.reshape(-1, 2) - image[:2, 2]) / 40.0 - exact
    assert np.abs(away).max() * scale < 0.15


def straight(v: Points) -> LineObservations:
    """Lines of 20 points at heights `v` (L, 20)."""
    u = np.linspace(-0.4, 0.4, 20)
    points = np.stack([np.tile(u, len(v)), v.ravel()], axis=1)
    return LineObservations(points, np.repeat(np.arange(len(v)), 20), np.full(v.size, 1e-3), [], [], [], 0.02)


def test_straightness_is_in_text_heights() -> None:
    level = np.linspace(-0.4, 0.4, 9)[:, None] + np.zeros(20)
    assert measure_straightness(identity(), straight(level)) == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(measure_straightness(identity(), NO_LINES))
    saw = 0.003 * np.tile([1.0, -1.0], 10)
    assert measure_straightness(identity(), straight(level + saw)) == pytest.approx(0.003 / 0.02)
    # Whatever the page's unit.
    assert measure_straightness(identity(0.1), straight(level + saw)) == pytest.approx(0.003 / 0.02)
    # Single points are no straight lines.
    broken = replace(straight(level), index=np.arange(level.size))
    assert np.isnan(measure_straightness(identity(), broken))
    # The worst tenth is left out: two points of each line, and what they do to the mean.
    spoiled = level + saw
    spoiled[:, 3] -= 0.0025
    spoiled[:, 4] += 0.0025
    assert measure_straightness(identity(), straight(spoiled)) == pytest.approx(0.003 / 0.02, rel=1e-9)


@dataclass(frozen=True, slots=True)
class Known:
    """A map that knows the photo to the left of `end` alone, as maps of strips do."""

    whole: PlaneMap
    end: float

    def to_photo(self, page: Points) -> Points:
        """NaN beyond."""
        seen = self.whole.to_photo(page)
        return np.where(seen[:, :1] > self.end, np.nan, seen)

    def to_page(self, centred: Points) -> Points:
        """NaN beyond."""
        return np.where(centred[:, :1] > self.end, np.nan, self.whole.to_page(centred))

    def jacobians(self, centred: Points) -> Floats:
        """NaN beyond."""
        return np.where(centred[:, :1, None] > self.end, np.nan, self.whole.jacobians(centred))


@pytest.mark.filterwarnings("error")
def test_what_a_map_does_not_know_is_left_out() -> None:
    flat = FlatInk(Print().ink(), 1.0, (0.0, 0.0))
    whole, half = (trace_lines(flat, Known(identity(), end)) for end in (2000.0, 600.0))
    kept = whole.points[:, 0] <= 600
    assert 0 < kept.sum() < len(kept)
    assert np.array_equal(half.points, whole.points[kept])
    assert np.array_equal(half.index, whole.index[kept])
    assert [len(run.lines) for run in half.runs] == [len(run.lines) for run in whole.runs]
    # The right margin is unknown.
    assert [len(m) for m in half.margins] == [14]
    assert half.text_height == pytest.approx(whole.text_height)
    assert 0 < measure_straightness(Known(identity(), 600.0), half) < 1
    assert trace_lines(flat, Known(identity(), -10.0)) is NO_LINES
    # Characters beyond are no part of the flat view.
    text = np.stack([np.linspace(60, 1000, 95), np.linspace(100, 600, 95)], axis=1)
    view = flatten_ink(flat.ink, np.eye(3), Known(identity(), 600.0), text, 12.0)
    assert view.ink.shape[1] / view.scale == pytest.approx(540 + 72, abs=10)
    # Runs whose lines are unknown are no runs.
    gone = trace_lines(flat, Known(identity(), 150.0))
    assert gone.count == 2 * 14
    assert np.isfinite(gone.points).all()


def turned(lines: LineObservations, angle_rad: float) -> LineObservations:
    """The same lines in a photo that was turned and pulled: straight ones stay straight."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return replace(
        lines, points=transform_points(np.array([[c, s, 0], [-s, c, 0], [0.1, 0.3, 1.0]]), lines.points)
    )


@pytest.mark.parametrize("angle_rad", [0.0, 0.4, 1.5, 2.0, 3.1])
def test_bend_is_what_no_plane_can_straighten(angle_rad: float) -> None:
    level = np.linspace(-0.4, 0.4, 9)[:, None] + np.zeros(20)
    u = np.linspace(-1, 1, 20)
    tilted = straight(level + 0.1 * u)
    assert measure_bend(tilted) == pytest.approx(0.0, abs=1e-12)
    assert measure_bend(turned(tilted, angle_rad)) == pytest.approx(0.0, abs=1e-12)
    assert measure_straightness(identity(), tilted) > 1
    # A parabola of this height leaves a line by 2 / sqrt(45) of it, root mean square; the worst tenth is left out.
    bent = turned(straight(level + 0.02 * u**2), angle_rad)
    assert 0.5 * 2 / np.sqrt(45) < measure_bend(bent) < 1.5 * 2 / np.sqrt(45)
    assert measure_bend(NO_LINES) == 0.0
    pairs = replace(tilted, index=np.arange(len(tilted.points)) // 2)
    assert measure_bend(pairs) == 0.0


def test_a_smooth_field_straightens_bends_and_leaves_noise() -> None:
    level = np.linspace(-0.4, 0.4, 9)[:, None] + np.zeros(20)
    noise = 0.003 * np.random.default_rng(3).standard_normal(level.shape)
    u = np.linspace(-1, 1, 20)
    # 17 terms for 180 points, of which every line takes one for its level: they take a tenth of the noise.
    assert 0.85 < left_by_bends(identity(), straight(level + noise)) < 1.0
    bent = level + 0.02 * u**2 * (1 + level)
    assert left_by_bends(identity(), straight(bent)) < 0.01
    assert 0.25 < left_by_bends(identity(), straight(bent + 0.7 * noise)) < 0.45
