"""Joint sheets that lose paper."""

from dataclasses import replace

import numpy as np

from services.mosaic.placing.kept_paper import keeps_paper
from services.sheet.plane.framing import FlatFrame
from tests.services.mosaic.cuttings import place

WIDTH, HEIGHT = 400, 600
SHEET = np.array([[50.0, 100.0], [350.0, 100.0], [350.0, 500.0], [50.0, 500.0]])
PHOTO = replace(place(np.zeros((HEIGHT, WIDTH, 3), np.uint8), np.eye(3)).flat, sheet=SHEET)


def rows(count: int) -> FlatFrame:
    """A view that shows the first rows of the photo."""
    return FlatFrame(np.eye(3), WIDTH, count)


def test_a_sheet_may_end_where_the_paper_does() -> None:
    assert keeps_paper({0: rows(505)}, {0: PHOTO})
    assert keeps_paper({0: rows(475)}, {0: PHOTO})


def test_a_sheet_may_not_end_before_the_paper_does() -> None:
    assert not keeps_paper({0: rows(430)}, {0: PHOTO})
    # Paper that the photo's own view does not show either is not lost by the sheet.
    assert keeps_paper({0: rows(430)}, {0: replace(PHOTO, frame=rows(450))})


def test_where_no_edge_is_seen_nothing_tells_paper_from_ground() -> None:
    assert keeps_paper({0: rows(200)}, {0: replace(PHOTO, sheet=None)})
