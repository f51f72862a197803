"""Plans of views: what is drawn by a plan is what is drawn by the page, also turned, and after it was kept."""

import io
from dataclasses import dataclass

import numpy as np
import pytest

from services.arrays import Homography, Points
from services.geometry.homographies import transform_points
from services.geometry.page_frame import Frame, turn_frame
from services.rectify.view.drawing import draw_flat_view
from services.rectify.view.view_plan import ViewPlan, plan_view, unpack_plan
from services.sheet.plane.framing import FlatFrame

H = np.array([[1.1, 0.1, 20.0], [-0.05, 0.9, 30.0], [1e-4, 2e-5, 1.0]])


@dataclass(frozen=True)
class Wave:
    """A view of a bent page; its model ends 300 pixels to the right."""

    H: Homography
    width: int = 250
    height: int = 310
    H_photo_flat: None = None

    def to_photo(self, pixels: Points) -> Points:
        at = transform_points(self.H, pixels)
        seen = np.column_stack([at[:, 0] * 1.2 + 15, at[:, 1] + 25 + 12 * np.sin(at[:, 0] / 60)])
        seen[at[:, 0] > 300] = np.nan
        return seen

    def to_flat(self, photo: Points) -> Points:
        x = (photo[:, 0] - 15) / 1.2
        at = np.column_stack([x, photo[:, 1] - 25 - 12 * np.sin(x / 60)])
        return transform_points(np.linalg.inv(self.H), at)

    def through(self, H_old_new: Homography, width: int, height: int) -> "Wave":
        return Wave(self.H @ H_old_new, width, height)


@pytest.mark.parametrize("frame", [FlatFrame(H, 250, 310), Wave(np.eye(3))], ids=["flat", "bent"])
@pytest.mark.parametrize("turn", [0, 90])
def test_a_kept_plan_draws_what_the_page_draws(frame: Frame, turn: int) -> None:
    photo = np.random.default_rng(1).integers(0, 256, (60, 50, 3), dtype=np.uint8)
    photo = np.ascontiguousarray(np.kron(photo, np.ones((8, 8, 1), np.uint8)))
    paper = np.array([[30.0, 40.0], [280.0, 50.0], [270.0, 300.0], [40.0, 290.0]])
    text = np.array([[100.0, 120.0], [200.0, 180.0], [5000.0, 10.0]])
    view = plan_view(frame, paper, text)
    kept = unpack_plan(ViewPlan({"sheet": view, "text": view}).packed).views["text"]
    drawn = draw_flat_view(photo, turn_frame(frame, turn, mirrored=False), paper)
    again = draw_flat_view(photo, turn_frame(kept.frame, turn, mirrored=False), kept.paper)
    assert drawn.shape == again.shape
    assert np.abs(drawn.astype(int) - again).mean() < 2.0
    assert kept.characters is not None
    assert np.allclose(kept.characters, frame.to_flat(text[:2]), atol=1e-3)
    points = np.array([[120.0, 130.0], [180.0, 222.5]])
    assert np.abs(kept.frame.to_flat(kept.frame.to_photo(points)) - points).max() < 0.3


@pytest.mark.parametrize("torn", [False, True])
def test_a_plan_with_the_border_of_earlier_releases_is_read(torn: bool) -> None:
    border = np.array(
        [[30.0, 40.0], [280.0, 50.0], [150.0 if torn else 275.0, 200.0], [270.0, 300.0], [40.0, 290.0]]
    )
    buffer = io.BytesIO()
    np.savez(buffer, **{"sheet.size": np.array([250, 310]), "sheet.H": H, "sheet.border": border})
    kept = unpack_plan(buffer.getvalue()).views["sheet"]
    assert (kept.paper is None) == torn
    assert kept.characters is None
