"""What other photos show of a creased sheet: exact derivatives, and what they add to the first photo."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.common.residuals import similarity_residual
from services.geometry.camera import rotation_from_vector
from services.sheet.developable.observations import NO_LINES
from services.sheet.ridged.blocks import stacked
from services.sheet.ridged.fitting import fit_mesh
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged.observations import SheetObservations
from services.sheet.ridged.parameters import RidgedParameters, Stage
from services.sheet.ridged.residuals import SheetResiduals
from services.sheet.ridged.views import OtherCamera, OtherView
from tests.services.sheet.ridged.sheets import CURVED, FOCAL, FOLDED, HEIGHT, PIXEL, WIDTH, Sheet, observe

PAGE = np.stack(np.meshgrid(np.linspace(-0.46, 0.46, 15), np.linspace(-0.46, 0.46, 17)), axis=-1)
PAGE = PAGE.reshape(-1, 2) * [WIDTH, HEIGHT]
MIDDLE = np.array([0.02, 0.01, FOCAL])


def second_camera(focal: float = 1.9) -> OtherCamera:
    """A camera that looks at the middle of the sheet from 25 degrees to the right, nearer by a tenth."""
    rotation = rotation_from_vector(np.array([0.1, np.deg2rad(25.0), 0.05]))
    return OtherCamera(rotation, np.array([0.0, 0.0, 0.9 * FOCAL]) - rotation @ MIDDLE, focal)


def view_of(sheet: Sheet, camera: OtherCamera, start: OtherCamera, noise: float = 0.0) -> OtherView:
    seen = camera.project(sheet.place(PAGE))
    seen = seen + np.random.default_rng(2).normal(0, noise, seen.shape)
    return OtherView(sheet.see(PAGE), seen, 0.2 * PIXEL, start, float(np.log(camera.focal)), 0.25)


def observations(view: OtherView) -> SheetObservations:
    return SheetObservations(NO_LINES, None, (None,) * 4, float(np.log(FOCAL)), 0.25, views=(view,))


@pytest.mark.parametrize("sheet", [CURVED, FOLDED])
def test_derivatives_are_exact(sheet: Sheet) -> None:
    camera = second_camera()
    residuals = SheetResiduals(
        sheet.mesh(9), observations(view_of(sheet, camera, camera)), RidgedParameters(), Stage(8, 1, 1, 1)
    )
    rng = np.random.default_rng(0)
    x = residuals.x0 + rng.normal(0, 2e-3, len(residuals.x0))
    block = residuals.blocks(x)[9]
    for _ in range(6):
        way, step = rng.normal(0, 1, len(x)), 1e-6
        ahead, behind = (residuals.blocks(x + sign * step * way)[9].values for sign in (1, -1))
        slow, fast = (ahead - behind) / (2 * step), stacked([block.jacobian], len(x)) @ way
        # A point that crosses a node's row has two derivatives.
        assert np.quantile(np.abs(slow - fast), 0.98) < 1e-4 * np.abs(fast).max()


def test_the_true_camera_sees_the_true_sheet_where_it_is() -> None:
    camera = second_camera()
    view = view_of(CURVED, camera, camera)
    mesh = camera.see(CURVED.mesh(49))
    page = mesh.to_page(view.seen)
    assert np.abs(page - CURVED.mesh(49).to_page(view.points)).max() < 1e-3 * WIDTH


def test_a_second_photo_shows_the_depth_that_one_leaves_open() -> None:
    sheet, camera = CURVED, second_camera()
    # Deeper by a quarter and seen by as much longer a lens, the sheet looks the same to the first camera.
    start = sheet.mesh(13).deepened(1.25)
    own = observe(sheet, np.random.default_rng(0), focal_deviation=0.25)
    observed = replace(own, sides=(None,) * 4, views=(view_of(sheet, camera, camera, 0.1 * PIXEL),))
    p = RidgedParameters(schedule=(Stage(12, 10.0, 3.0, 3.0), Stage(16, 1.0, 1.0, 1.0)), evaluations=40)
    fitted, alone = fit_mesh(start, observed, p), fit_mesh(start, replace(observed, views=()), p)
    assert abs(np.log(fitted.mesh.focal / FOCAL)) < 0.01
    assert abs(np.log(fitted.views[0].camera.focal / camera.focal)) < 0.01
    assert error_percent(sheet, fitted.mesh) < 0.06
    assert error_percent(sheet, alone.mesh) > 0.3


def error_percent(sheet: Sheet, mesh: SheetMesh) -> float:
    """RMS error of the flat page within the margins, percent of its width."""
    found = mesh.to_page(sheet.see(PAGE))
    known = np.isfinite(found).all(axis=1)
    assert known.mean() > 0.95
    return 100 * similarity_residual(found[known], PAGE[known]) / WIDTH
