"""The cylinder between four sides: lengths on the paper, depth and focal length from an analytic camera."""

import numpy as np
import pytest

from services.arrays import Points
from services.sheet.ridged.cylinder_start import cylinder_between_sides
from services.sheet.ridged.mesh import SheetMesh
from tests.services.sheet.ridged.sheets import CURVED, FLAT, FOCAL, HEIGHT, PIXEL, WIDTH, Sheet, observe

STEEP = Sheet(radius=0.8, angles_deg=(8.0, -22.0, 4.0))


def seen(sheet: Sheet, noise: float = 0.0) -> tuple[Points, tuple[Points, ...]]:
    """Corners and sides of the sheet in its photo."""
    sides = observe(sheet, np.random.default_rng(0), noise).sides
    return sheet.corners(), tuple(side.points for side in sides if side)


def assert_is(mesh: SheetMesh | None, sheet: Sheet, off: float) -> None:
    """The mesh shows the page's points where the sheet has them, within `off` of its width."""
    assert mesh is not None
    share = np.stack(np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9)), axis=-1).reshape(-1, 2)
    found = mesh.to_photo(share * mesh.size)
    truth = sheet.see((share - 0.5) * [WIDTH, HEIGHT])
    assert np.abs(found - truth).max() < off * WIDTH
    assert mesh.aspect_ratio == pytest.approx(WIDTH / HEIGHT, rel=2 * off)


@pytest.mark.parametrize("sheet", [CURVED, STEEP])
@pytest.mark.parametrize("noise", [0.0, 0.5 * PIXEL])
def test_sides_of_a_cylinder_show_all_of_it(sheet: Sheet, noise: float) -> None:
    mesh = cylinder_between_sides(*seen(sheet, noise), np.log(FOCAL), 0.02, 24)
    assert_is(mesh, sheet, 0.005)
    assert mesh is not None
    across = np.linalg.norm(np.diff(mesh.nodes, axis=1), axis=2) / mesh.step
    down = np.linalg.norm(np.diff(mesh.nodes, axis=0), axis=2) / (mesh.step * mesh.aspect)
    assert across == pytest.approx(np.ones(across.shape), abs=0.01), "paper does not stretch"
    assert down == pytest.approx(np.ones(down.shape), abs=0.01)


def test_a_bent_sheet_shows_its_focal_length() -> None:
    mesh = cylinder_between_sides(*seen(STEEP), np.log(FOCAL) + 0.15, 0.2, 24)
    assert mesh is not None
    assert mesh.focal == pytest.approx(FOCAL, rel=0.06)


def test_rulings_may_run_along_the_text() -> None:
    corners, sides = seen(CURVED)
    mesh = cylinder_between_sides(
        np.roll(corners, 1, axis=0), (sides[3], *sides[:3]), np.log(FOCAL), 0.02, 24
    )
    assert mesh is not None
    assert mesh.aspect_ratio == pytest.approx(HEIGHT / WIDTH, rel=0.01)
    straight = cylinder_between_sides(corners, sides, np.log(FOCAL), 0.02, 24)
    assert straight is not None
    middle, same = (m.to_photo(np.array([[0.5, 0.5]]) * m.size) for m in (mesh, straight))
    np.testing.assert_allclose(middle, same, atol=0.002)


def test_a_sheet_without_two_straight_sides_is_no_cylinder() -> None:
    corners, sides = seen(CURVED)
    bow = 0.05 * np.sin(np.pi * np.linspace(0, 1, len(sides[1])))
    bent = sides[1] + np.column_stack([bow, 0 * bow])
    assert cylinder_between_sides(corners, (sides[0], bent, *sides[2:]), np.log(FOCAL), 0.1, 24) is None


def test_corners_that_no_camera_sees_give_no_cylinder() -> None:
    corners, sides = seen(FLAT)
    mirrored = corners[[1, 0, 3, 2]]
    assert cylinder_between_sides(mirrored, sides, np.log(FOCAL), 0.1, 24) is None
