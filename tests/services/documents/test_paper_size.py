"""Sheets of known proportions, seen through known maps."""

import numpy as np
import pytest

from services.arrays import Points
from services.documents.paper_size import (
    FORMATS,
    SheetSize,
    measure_size,
    parse_size,
    places_in_view,
    size_of_photo,
)
from services.geometry.sheet_aspect import SheetAspect

WIDTH, HEIGHT = 901, 1201
H = np.array([[1.2, 0.1, 50.0], [-0.05, 1.1, 30.0], [1e-4, 5e-5, 1.0]])


def photo(points: Points) -> Points:
    """A perspective map from the view to the photo."""
    mapped = np.column_stack([points, np.ones(len(points))]) @ H.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def mesh() -> np.ndarray:
    """The view's, 65 x 49."""
    x, y = np.meshgrid(np.linspace(0, WIDTH - 1, 49), np.linspace(0, HEIGHT - 1, 65))
    return photo(np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(65, 49, 2)


def sheet(width: float, height: float, left: float = 20.0, top: float = 10.0) -> Points:
    """Corners in the view."""
    return np.array([[left, top], [left + width, top], [left + width, top + height], [left, top + height]])


def size_of(corners: Points | None, paper: str = "auto", *, assumed: bool = False) -> SheetSize:
    """Of a sheet with these corners in the view."""
    seen = None if corners is None else photo(corners)
    return measure_size(paper, seen, mesh(), WIDTH, HEIGHT, camera_assumed=assumed)


def test_places_are_found_again_also_just_outside_of_the_view() -> None:
    points = np.array([[0.0, 0.0], [450.3, 600.7], [WIDTH + 3.0, HEIGHT + 2.0], [-4.0, 900.0]])
    assert places_in_view(photo(points), mesh(), WIDTH, HEIGHT) == pytest.approx(points, abs=0.1)


@pytest.mark.parametrize("name", ["a4", "letter", "legal"])
@pytest.mark.parametrize("landscape", [False, True])
def test_a_format_is_told_by_its_aspect(name: str, landscape: bool) -> None:
    width_mm, height_mm = FORMATS[name][::-1] if landscape else FORMATS[name]
    scale = 800 / max(width_mm, height_mm)
    size = size_of(sheet(width_mm * scale, height_mm * scale))
    assert (size.paper, size.source) == (name, "outline")
    assert (size.width_mm, size.height_mm) == (width_mm, height_mm)
    assert size.dpi == pytest.approx(scale * 25.4, rel=1e-3)
    assert size.aspect == pytest.approx(width_mm / height_mm, rel=1e-3)


@pytest.mark.parametrize("aspect", [1.0, 0.85, 0.74, 0.5])
def test_no_format_is_named_for_another_aspect(aspect: float) -> None:
    size = size_of(sheet(800 * aspect, 800))
    assert (size.paper, size.width_mm, size.dpi) == (None, None, None)
    assert "fits" in size.reason


def test_nothing_is_named_where_the_corners_are_not_seen_or_the_camera_is_unknown() -> None:
    a4 = sheet(560, 792)
    assert "corners" in size_of(None).reason
    unseen = a4.copy()
    unseen[2] = np.nan
    assert size_of(unseen).paper is None
    skewed = a4.copy()
    skewed[1, 0] += 60  # opposite sides differ: the map is wrong there
    assert "too little to tell" in size_of(skewed).reason
    assert size_of(a4, assumed=True).aspect_deviation == pytest.approx(0.024, abs=0.002)


def test_a_format_that_only_the_likely_focal_length_shows_is_named_if_it_is_certain() -> None:
    a4 = sheet(560, 792)

    def seen(aspect: SheetAspect) -> SheetSize:
        return measure_size("auto", photo(a4), mesh(), WIDTH, HEIGHT, camera_assumed=True, seen=aspect)

    likely = seen(SheetAspect(560 / 792, 0.012, "a4", 0.9))
    assert (likely.paper, likely.width_mm) == (None, None)
    assert "a4 is the likeliest" in likely.reason
    assert likely.aspect_deviation == pytest.approx(0.0126, abs=2e-4)
    assert seen(SheetAspect(792 / 560, 0.002, "a4", 0.98)).paper == "a4"
    # A plane whose focal length was assumed may show its aspect all the same.
    assert seen(SheetAspect(560 / 792, 0.003)).aspect_deviation == pytest.approx(0.005, abs=2e-4)
    # Lines of bent sides meet elsewhere than at the corners.
    assert seen(SheetAspect(560 / 792 * 1.02, 0.003)).aspect_deviation == pytest.approx(0.0204, abs=3e-4)


def test_a_size_that_is_given_is_taken() -> None:
    size = size_of(sheet(600, 800), "a5")
    assert (size.width_mm, size.height_mm, size.source) == (148, 210, "given")
    assert size.dpi == pytest.approx(600 / 148 * 25.4, rel=1e-3)
    own = size_of(None, "100x50.5")
    assert (own.width_mm, own.height_mm) == (100, 50.5)
    assert own.dpi == pytest.approx(WIDTH / 100 * 25.4)
    assert size_of(sheet(560, 792), "none").dpi is None


@pytest.mark.parametrize(
    ("stretch", "told"), [(None, None), (1.0004, None), (1.053, "wider by 5.3 %"), (0.95, "higher by 5.3 %")]
)
def test_it_is_told_by_how_much_a_view_was_stretched(stretch: float | None, told: str | None) -> None:
    size = measure_size(
        "a4", photo(sheet(560, 792)), mesh(), WIDTH, HEIGHT, camera_assumed=False, stretch=stretch
    )
    assert size.stretch == stretch
    assert (told or "names the size.") in size.reason
    assert ("made" in size.reason) == (told is not None)


@pytest.mark.parametrize("wrong", ["", "a6", "210", "9x100", "100x6000", "1e3x200"])
def test_other_sizes_are_refused(wrong: str) -> None:
    with pytest.raises(ValueError, match="210x297"):
        parse_size(wrong)


@pytest.mark.parametrize(
    ("size", "dpi", "named"),
    [((1653, 2339), 200.0, "a4"), ((3300, 2550), 300.0, "letter"), ((2550, 3000), 300.0, None)],
)
def test_a_scan_has_the_size_of_its_file(size: tuple[int, int], dpi: float, named: str | None) -> None:
    found = size_of_photo(*size, dpi)
    assert (found.paper, found.source, found.dpi) == (named, "file", dpi)
    assert found.width_mm == pytest.approx(size[0] / dpi * 25.4, abs=0.06)


def test_a_cropped_page_may_be_squeezed() -> None:
    found = size_of_photo(1000, 1294, None)
    assert (found.paper, found.width_mm) == (None, None)
    assert found.aspect_deviation is not None
    # The aspect of Letter, and that of a squeezed A4 within two deviations.
    assert abs(np.log(1.294 / np.sqrt(2))) < 2 * found.aspect_deviation
