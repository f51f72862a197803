"""Where a focal length is said to come from."""

import pytest

from services.geometry.focal_prior import FocalPrior, typical_focal_prior


def test_an_assumed_focal_length_that_the_page_shows_is_called_estimated() -> None:
    assumed = typical_focal_prior()
    found = [assumed.source_beside(deviation) for deviation in (0.05, 2.0, float("inf"))]
    assert found == ["estimated", "assumed", "assumed"]


@pytest.mark.parametrize("source", ["exif", "given", "remembered"])
def test_a_known_focal_length_keeps_its_source(source: str) -> None:
    prior = FocalPrior(0.3, 0.03, source)  # type: ignore[arg-type]
    assert {prior.source_beside(deviation) for deviation in (0.05, 2.0)} == {source}
