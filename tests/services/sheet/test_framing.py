"""Views of a bent page hold its text and its sheet, are bounded, and their maps are inverse."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from services.arrays import Floats, Points
from services.geometry.page_frame import MAX_GROWTH, mesh_of, resize_frame, turn_frame
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet import framing
from services.sheet.developable.surface import DevelopableSurface, bend_basis
from services.sheet.framing import CurvedFrame, frame_curved_page
from tests.services.sheet.curved_views import BentView
from tests.services.sheet.developable.sheets import FLAT, Bent, box

SEEN = BentView()
VIEWS = {
    "bent": SEEN,
    "flat": replace(SEEN, bent=replace(FLAT, anchor=(0.0, 0.0))),
    "rolled": replace(SEEN, bent=Bent(skew=1.5, slopes=(0.0, 0.0), bends=(0.9,) * 8, anchor=(0.0, 0.0))),
    "wide": replace(SEEN, half=(0.45, 0.1)),
}


@pytest.mark.parametrize("name", VIEWS)
@pytest.mark.parametrize("paper", [False, True])
def test_all_text_is_in_the_frame_with_its_margin(name: str, paper: bool) -> None:
    seen = VIEWS[name]
    frame = seen.frame(seen.outline() if paper else None)
    flat = frame.to_flat(seen.characters)
    scale = frame.H_page_flat[0, 0]  # page units to the output pixel
    # 2.5 text heights of 5 px in the photo, at about a pixel to the pixel.
    margin = 2.5 * 5.0 / seen.view.unit_px / scale * 0.6
    assert (flat.min(axis=0) > margin).all()
    assert (flat.max(axis=0) < [frame.width - margin, frame.height - margin]).all()
    # The page's axes are the picture's.
    H = frame.H_page_flat
    assert np.allclose(H[:, :2], np.diag([scale, scale, 1.0])[:, :2])
    assert H[2, 2] == pytest.approx(1.0)


@pytest.mark.parametrize("name", VIEWS)
def test_photo_and_view_are_inverse(name: str) -> None:
    seen = VIEWS[name]
    frame = seen.frame()
    flat = frame.to_flat(seen.characters)
    assert np.allclose(frame.to_photo(flat), seen.characters, atol=1e-6)
    page = seen.surface.to_page((seen.characters - seen.view.centre) / seen.view.unit_px)
    # The first pixel's left edge is the box' edge: pixels are centred.
    assert np.allclose(flat * frame.H_page_flat[0, 0] + frame.H_page_flat[:2, 2], page, atol=1e-9)


def test_the_resolution_is_that_of_the_sharper_text() -> None:
    frame = SEEN.frame()
    J = SEEN.surface.jacobians((SEEN.characters - SEEN.view.centre) / SEEN.view.unit_px)
    # Output pixels to the photo pixel at each character: most are drawn larger than seen, 15 % a little smaller.
    growth = np.sqrt(np.linalg.det(J)) / frame.H_page_flat[0, 0] / SEEN.view.unit_px
    assert (growth >= 1).mean() == pytest.approx(0.85, abs=0.02)


def test_the_sheet_is_shown_whole_and_little_beyond() -> None:
    for margin in (0.06, 0.1):
        frame = SEEN.frame(SEEN.outline(margin))
        sheet = frame.to_flat(SEEN.outline(margin))
        size = np.array([frame.width, frame.height])
        assert (sheet.min(axis=0) > -0.5).all()
        assert (sheet.max(axis=0) < size - 0.5).all()
        # One percent of the text's size on each side.
        rim = 0.011 * size.max()
        assert (sheet.min(axis=0) < rim).all()
        assert (sheet.max(axis=0) > size - 1 - rim).all()


def test_the_pictures_edges_are_the_sheets_rim() -> None:
    flat = replace(SEEN, bent=replace(FLAT, anchor=(0.0, 0.0), turn=(0.0, 0.0, 0.0)))
    frame = flat.frame(flat.outline(0.06))
    text_margin = 2.5 * 5.0 / flat.view.unit_px
    rim = 0.01 * 2 * (flat.half[1] + text_margin)
    corner = np.array(flat.half) + 0.06 + rim
    edges = frame.to_flat(flat.in_photo(np.stack([-corner, corner])))
    # Pixels are half a pixel from their centre to their edge.
    assert np.allclose(edges[0], -0.5, atol=1e-6)
    assert np.allclose(edges[1], [frame.width - 0.5, frame.height - 0.5], atol=0.51)


def test_without_a_sheet_the_view_ends_near_the_text() -> None:
    small = replace(SEEN, half=(0.1, 0.13), bent=replace(FLAT, anchor=(0.0, 0.0), turn=(0.0, 0.0, 0.0)))
    frame = small.frame()
    core = np.array(small.half) + 2.5 * 5.0 / small.view.unit_px
    half = core + 0.3 * 2 * core.max()
    scale = frame.H_page_flat[0, 0]
    # To the step of the look-out's lattice.
    assert np.array([frame.width, frame.height]) * scale == pytest.approx(2 * half, rel=0.04)
    middle = frame.to_flat(np.array([small.view.centre]))[0]
    assert middle == pytest.approx([(frame.width - 1) / 2, (frame.height - 1) / 2], abs=0.51)


def test_without_a_sheet_the_view_ends_with_the_photo() -> None:
    whole = replace(SEEN, half=(0.55, 0.7), bent=replace(FLAT, anchor=(0.0, 0.0), turn=(0.0, 0.0, 0.0)))
    frame = whole.frame()
    assert [frame.width, frame.height] == pytest.approx([whole.width, whole.height], rel=0.06)
    corners = frame.to_photo(np.array([[-0.5, -0.5], [frame.width - 0.5, frame.height - 0.5]]))
    assert np.abs(corners - [[-0.5, -0.5], [whole.width - 0.5, whole.height - 0.5]]).max() < 14


def stretches(frame: CurvedFrame, text: Points) -> Floats:
    """Enlargement (20, 20) over the view in photo pixels per pixel, over what is usual at the text's pixels."""
    x, y = np.meshgrid(np.linspace(0, frame.width - 1, 20), np.linspace(0, frame.height - 1, 20))

    def enlargement(pixels: Points) -> Floats:
        d = 0.1 * np.eye(2)
        ways = [(frame.to_photo(pixels + e) - frame.to_photo(pixels - e)) / 0.2 for e in d]
        return np.asarray(np.sqrt(np.abs(np.linalg.det(np.stack(ways, axis=-1)))))

    everywhere = enlargement(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(20, 20)
    return np.asarray(everywhere / np.median(enlargement(text)))


@pytest.mark.parametrize("turn", [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)])
def test_margins_end_where_they_would_be_stretched(
    turn: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The page leans: its one side is near, its other far.
    bent = replace(FLAT, anchor=(0.0, 0.0), turn=turn, skew=0.0, focal=1.0)
    seen = replace(SEEN, bent=bent, half=(0.12, 0.12))
    monkeypatch.setattr(framing, "REACH", 2.0)
    for limit in (1.3, 1e9):
        monkeypatch.setattr(framing, "MAX_STRETCH", limit)
        frame = frame_curved_page(seen.surface, seen.view, seen.characters, 5.0, None)
        found = stretches(frame, frame.to_flat(seen.characters))
        if limit == 1.3:
            assert 0.95 / 1.3 < found.min() < 0.85
            assert 1.15 < found.max() < 1.3 / 0.95
        else:
            assert found.min() < 0.6
            assert found.max() > 1.7


def test_the_output_is_bounded_by_the_photo() -> None:
    near = replace(SEEN, bent=replace(SEEN.bent, focal=0.9, turn=(0.6, 0.5, 0.0)), half=(0.25, 0.25))
    for seen in (SEEN, near):
        frame = frame_curved_page(seen.surface, seen.view, seen.characters, 5.0, None)
        assert frame.width * frame.height <= MAX_GROWTH * seen.width * seen.height * 1.01


def test_the_output_is_bounded_for_any_map() -> None:
    view = PhotoFrame(400, 300)
    text = box(180.0, 130.0) + np.array(view.centre)
    for scale in (1e-6, 1.0, 1e6):
        frame = frame_curved_page(PlaneMap(np.diag([scale, scale, 1.0])), view, text, 5.0, None)
        assert frame.width * frame.height <= 1.6 * 400 * 300 * 1.01
        # The page's unit is nobody's: the same picture for each.
        assert (frame.width, frame.height) == pytest.approx((400, 300), abs=22)
    thread = frame_curved_page(PlaneMap(np.diag([1.0, 1e-4, 1.0])), view, text, 5.0, None)
    assert max(thread.width, thread.height) <= 20000


def test_margins_end_before_rulings_cross() -> None:
    # The rulings meet a little above the text.
    bent = Bent(skew=0.0, slopes=(1.6, 0.0), turn=(0.0, 0.0, 0.0), anchor=(0.0, 0.0), bends=(0.6,) * 8)
    seen = replace(SEEN, bent=bent, half=(0.12, 0.4))
    frame = seen.frame()
    page_top = frame.H_page_flat[1, 2]
    assert -1 / 1.6 < page_top < -0.4
    photo = mesh_of(frame)
    # Nothing is folded or stretched over four times.
    across, down = np.diff(photo, axis=1)[:-1], np.diff(photo, axis=0)[:, :-1]
    area = across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0]
    middle = float(np.median(area))
    assert (area > middle / 20).all()
    assert (area < middle * 20).all()


def test_margins_end_where_the_sheet_turns_away() -> None:
    basis = bend_basis(-1.0, 1.0, 16, 0.3)
    bends = np.zeros(16)
    bends[12:] = -9.0
    surface = replace(FLAT, turn=(0.0, 0.0, 0.0), anchor=(0.0, 0.0), skew=0.0, bends=tuple(bends)).surface(
        basis
    )
    view = PhotoFrame(420, 540)
    text = surface.to_photo(box(0.35, 0.42, 24, 30)) * view.unit_px + np.array(view.centre)
    frame = frame_curved_page(surface, view, text, 5.0, None)
    x, y = np.meshgrid(np.linspace(0, frame.width - 1, 20), np.linspace(0, frame.height - 1, 20))
    assert np.isfinite(frame.to_photo(np.stack([x.ravel(), y.ravel()], axis=1))).all()


def test_turned_mirrored_and_resized_views_show_the_same() -> None:
    frame = SEEN.frame()
    pixels = np.array([[3.0, 5.0], [100.0, 20.0], [40.0, 150.0]])
    photo = frame.to_photo(pixels)
    quarter = turn_frame(frame, 90, False)
    assert (quarter.width, quarter.height) == (frame.height, frame.width)
    clockwise = np.stack([frame.height - 1 - pixels[:, 1], pixels[:, 0]], axis=1)
    assert np.allclose(quarter.to_photo(clockwise), photo)
    mirrored = turn_frame(frame, 0, True)
    assert np.allclose(
        mirrored.to_photo(np.stack([frame.width - 1 - pixels[:, 0], pixels[:, 1]], axis=1)), photo
    )
    half = resize_frame(frame, 0.5)
    assert np.allclose(half.to_photo((pixels + 0.5) / 2 - 0.5), photo)
    again = frame.to_flat(photo)
    assert np.allclose(again, pixels)
    assert isinstance(half, CurvedFrame)


@dataclass(frozen=True, slots=True)
class Known:
    """A map that knows the page to the left of `end` alone."""

    surface: DevelopableSurface
    end: float

    def to_photo(self, page: Points) -> Points:
        return np.where(page[:, :1] > self.end, np.nan, self.surface.to_photo(page))

    def to_page(self, centred: Points) -> Points:
        page = self.surface.to_page(centred)
        return np.where(page[:, :1] > self.end, np.nan, page)

    def jacobians(self, centred: Points) -> Floats:
        unknown = np.isnan(self.to_page(centred)[:, :1, None])
        return np.where(unknown, np.nan, self.surface.jacobians(centred))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("paper", [False, True])
def test_characters_that_the_map_does_not_know_are_left_out(paper: bool) -> None:
    known = Known(SEEN.surface, 0.3)
    page = SEEN.surface.to_page((SEEN.characters - SEEN.view.centre) / SEEN.view.unit_px)
    outline = SEEN.outline() if paper else None
    frames = [
        frame_curved_page(known, SEEN.view, text, 5.0, outline)
        for text in (SEEN.characters, SEEN.characters[page[:, 0] < 0.3])
    ]
    assert (frames[0].width, frames[0].height) == (frames[1].width, frames[1].height)
    assert np.allclose(frames[0].H_page_flat, frames[1].H_page_flat)
    mesh = mesh_of(frames[0])
    assert np.isfinite(mesh).all()


@dataclass(frozen=True, slots=True)
class Cornerless:
    """A map that knows all of the page but its first corner, above and to the left of `end`."""

    surface: DevelopableSurface
    end: Points

    def to_photo(self, page: Points) -> Points:
        unknown = (page < self.end).all(axis=1, keepdims=True)
        return np.where(unknown, np.nan, self.surface.to_photo(page))

    def to_page(self, centred: Points) -> Points:
        return self.surface.to_page(centred)

    def jacobians(self, centred: Points) -> Floats:
        return self.surface.jacobians(centred)


@pytest.mark.parametrize(("share", "same"), [(0.02, True), (0.3, False)])
def test_a_sheet_whose_corner_the_map_does_not_know_keeps_its_margin(share: float, same: bool) -> None:
    page = SEEN.surface.to_page((SEEN.characters - SEEN.view.centre) / SEEN.view.unit_px)
    low, high = page.min(axis=0), page.max(axis=0)
    known = Cornerless(SEEN.surface, np.array([low[0] + share * (high[0] - low[0]), low[1] - 0.01]))
    outline = SEEN.outline()
    whole, cut = (
        frame_curved_page(each, SEEN.view, SEEN.characters, 5.0, outline) for each in (SEEN.surface, known)
    )
    assert (cut.height == whole.height) == same
