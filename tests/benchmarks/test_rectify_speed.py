"""Times are judged as ratios to the floor of the same run."""

import cv2
import numpy as np
import pytest

from benchmarks.common.stopwatch import Usage
from benchmarks.rectify.floor import run_floor
from benchmarks.rectify.speed import SpeedFigures, format_speed, make_upload, unmet_wishes


def figures(
    case: str, floor_s: float, ours_s: float, peak_mb: float = 200.0, wall_share: float = 0.6
) -> SpeedFigures:
    floor, ours = Usage(floor_s, floor_s, 100.0), Usage(ours_s, ours_s, peak_mb)
    return SpeedFigures(case, floor, ours, wall_share, {"text": 7.0})


def test_the_floor_gives_back_a_photo_of_the_same_size() -> None:
    photo = np.full((300, 420, 3), (40, 120, 200), np.uint8)
    _, upload = cv2.imencode(".jpg", photo)
    view = cv2.imdecode(np.frombuffer(run_floor(upload.tobytes()), np.uint8), cv2.IMREAD_COLOR)
    assert view is not None
    assert view.shape == photo.shape
    assert np.abs(view[20:-20, 20:-20].astype(int) - photo[20:-20, 20:-20]).max() <= 4


def test_what_is_wanted_does_not_depend_on_the_machine() -> None:
    for machine in (1.0, 7.0):
        good = [
            figures("planar-12", 0.3 * machine, 0.6 * machine),
            figures("planar-3", 0.1, 0.2 * machine),
        ]
        assert unmet_wishes(good) == []
        slow = [figures("planar-12", 0.3 * machine, 1.2 * machine)]
        assert unmet_wishes(slow) == ["planar-12 takes 4.00 times the floor; at most 2.2 are wanted"]


def test_every_wish_is_named() -> None:
    entry = figures("bent-12", 0.3, 3.0, 400.0, 0.9)
    entry.peers["UVDoc"] = Usage(3.3, 3.3, 1700.0)
    told = unmet_wishes([entry, figures("planar-12", 0.3, 0.6), figures("planar-3", 0.1, 0.5)])
    assert [line.split()[0] for line in told] == ["bent-12", "bent-12", "bent-12", "UVDoc", "3"]


def test_the_table_has_a_column_a_case_and_a_dash_where_a_peer_did_not_run() -> None:
    entry = figures("planar-12", 0.25, 1.0)
    entry.peers["UVDoc"] = Usage(3.0, 3.0, 1700.0)
    rows = {
        line[:26].strip(): line[26:].split()
        for line in format_speed([entry, figures("planar-3", 0.1, 0.3)]).splitlines()
    }
    assert rows["ours"] == ["4.00", "3.00"]
    assert rows["UVDoc"] == ["12.00", "-"]
    assert rows["wall of two threads / CPU"] == ["0.60", "0.60"]
    assert rows["text"] == ["0.03", "0.07"]


@pytest.mark.parametrize("shape", ["planar", "bent", "folded"])
def test_uploads_have_the_asked_size(shape: str) -> None:
    upload = make_upload(f"{shape}-0.5", degraded=False)
    picture = cv2.imdecode(np.frombuffer(upload, np.uint8), 1)
    assert picture is not None
    assert picture.shape[0] * picture.shape[1] == pytest.approx(0.5e6, rel=0.01)
