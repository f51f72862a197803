"""Other mosaics place what they can place, and their failures are told."""

import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.mosaic.hugin import Project
from benchmarks.mosaic.peers import PeerMosaic, chain, chain_by_lightglue
from services.arrays import RgbImage
from simulation.letter_pages import letter_pages


@pytest.fixture(scope="module")
def photos() -> list[RgbImage]:
    """Two cuts of a page, the second 600 px further down."""
    page = letter_pages(1275, 1650)[2].image
    cuts = [page[:950], page[600:]]
    return [np.ascontiguousarray(np.repeat(cut[..., None], 3, axis=2)) for cut in cuts]


def _check(answer: PeerMosaic) -> None:
    assert answer.placed == 2
    assert answer.image is not None
    assert answer.image.shape[0] == pytest.approx(1650, abs=6)
    assert answer.meshes is not None
    first, second = answer.meshes
    assert first is not None
    assert second is not None
    assert np.abs(second[0, 0] - first[0, 0]) == pytest.approx([0, 600], abs=2)


def test_the_chain_places_upright_photos_of_scale_one(photos: list[RgbImage]) -> None:
    _check(chain(photos))


def test_matches_of_another_process_are_chained_in_the_same_way(
    photos: list[RgbImage], tmp_path: Path
) -> None:
    # A Python that answers like the one that has LightGlue: points of the first photo's foot in both.
    rng = np.random.default_rng(0)
    at_a = rng.random((40, 2)) * [1270, 340] + [0, 605]
    np.savez(tmp_path / "given.npz", **{"0,1": np.hstack([at_a, at_a - [0, 600]])})
    _check(chain_by_lightglue(photos, _python(tmp_path, "shutil.copy(given, folder + '/matches.npz')")))


def test_without_matches_there_is_no_page(photos: list[RgbImage], tmp_path: Path) -> None:
    answer = chain_by_lightglue(photos, _python(tmp_path, "sys.exit(1)"))
    assert (answer.image, answer.placed, answer.meshes) == (None, 0, None)


def test_photos_without_control_points_are_left_out_of_a_project(
    photos: list[RgbImage], tmp_path: Path
) -> None:
    project = Project([photos[0]] * 5, tmp_path)
    Path(project.file).write_text("i w10 h10\nc n0 N3 x1 y1 X2 Y2 t0\nc n1 N4 x1 y1\nc n4 N2 x3 y3\n")
    assert project.joined() == [1, 2, 4]


def _python(folder: Path, body: str) -> str:
    script = folder / "python"
    script.write_text(
        f"#!{sys.executable}\nimport shutil, sys\n_, script, option, folder, *photos = sys.argv\n"
        f"assert (script.rpartition('/')[2], option) == ('lightglue_process.py', '-o')\n"
        f"given = {str(folder / 'given.npz')!r}\n{body}\n"
    )
    script.chmod(0o755)
    return str(script)
