"""The dissertation's chain from a photo to its strips: as near to the truth as it was when the product relied on it."""

import numpy as np
import pytest

from benchmarks.dissertation_chain.strip_page import find_strips
from services.geometry.focal_prior import typical_focal_prior
from tests.benchmarks.dissertation_chain.strips.bent_page import angles_between_deg, similarity_residual
from tests.services.scenes import Album


# By where the blocks of the minor flow lie, the strips of a cone are 2 to 6.5 degrees off.
@pytest.mark.parametrize(("name", "largest_deg"), [("book", 4.0), ("cone", 7.5)])
def test_strips_of_a_photo_are_near_the_truth(album: Album, name: str, largest_deg: float) -> None:
    shot = album[name]
    strips = find_strips(shot.evidence, typical_focal_prior())
    assert strips is not None
    surface = strips.surface(shot.frame)
    middles = 0.5 * (surface.points[1:] + surface.points[:-1])
    on_page = shot.truth.on_page(middles)
    assert on_page.mean() > 0.7
    errors = angles_between_deg(surface.normals[on_page], shot.truth.normals(middles[on_page]))
    assert errors.mean() < largest_deg
    page_map, page = strips.page_map, shot.truth.page
    assert page_map is not None
    found = page_map.to_page(shot.evidence.characters)
    true = shot.truth.photo_to_page(shot.analysis.characters)
    known = np.isfinite(found).all(axis=1) & np.isfinite(true).all(axis=1)
    assert known.mean() > 0.97
    assert similarity_residual(found[known], true[known] / page.width) < 0.02
