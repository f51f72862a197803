"""What errors are measured against is not our own output: the estimates differ from it, if only by a little.

Other tests bound errors from above alone, so that better estimates pass. An error of exactly nothing would mean
that an estimate has seen its truth. That is tested here for simulated photos, and with the noise that went in for
sheets (`test_fitting`) and mosaics (`test_adjustment`).
"""

import numpy as np
import pytest

from tests.services.scenes import Album, errors_deg


@pytest.mark.parametrize("name", ["plain", "book"])
def test_flows_are_estimated_from_pixels(album: Album, name: str) -> None:
    shot = album[name]
    assert shot.analysis.minor is not None
    for found, truth in (
        (shot.analysis.major, shot.truth.major_flow),
        (shot.analysis.minor, shot.truth.minor_flow),
    ):
        assert np.nanmedian(errors_deg(found.angles, truth(found.points))) > 1e-4
