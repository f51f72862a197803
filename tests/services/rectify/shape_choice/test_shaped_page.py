"""What a view of a shaped page must show."""

from types import SimpleNamespace

import numpy as np
import pytest

from services.arrays import Points
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import PagePlane
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.sheet.outline.results import SheetOutline, SheetSide
from services.sheet.plane.planar_page import PlanarPage

CORNERS = np.array([[300.0, 200.0], [900.0, 200.0], [900.0, 1000.0], [300.0, 1000.0]])


@pytest.mark.parametrize(
    ("characters", "extent"),
    [
        (np.array([[500.0, 500.0], [100.0, 100.0]]), np.array([[500.0, 500.0]])),
        (np.array([[100.0, 100.0], [50.0, 300.0]]), CORNERS),
    ],
    ids=["print on the sheet", "grain of the desk only"],
)
def test_a_sheet_without_print_is_shown_itself(characters: Points, extent: Points) -> None:
    side = SheetSide(np.zeros((0, 2)), np.zeros(0), 0.0, 0.0)
    outline = SheetOutline(CORNERS, (side, side, side, side), 0.9, CORNERS)
    plane = PlanarPage(PagePlane(np.eye(3), 1.3), "assumed", sources=("outline",), sides_believed=True)
    analysis = SimpleNamespace(characters=characters)
    page = ShapedPage(PhotoFrame(1200, 1600), plane, (), outline, analysis)  # type: ignore[arg-type]
    assert np.array_equal(page.extent, extent)
