"""Pictures of a run are written, and contact sheets keep to their width."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.figures import CaseFigures
from benchmarks.common.plots import contact_sheet, load_picture, make_strip
from benchmarks.common.workers import Progress
from benchmarks.rectify.cases import EXPERIMENTS, all_cases
from benchmarks.rectify.simulated_pictures import save_case, save_run

PAPER = np.full((60, 40, 3), 255, np.uint8)


def _strip(width: int, height: int, value: int) -> np.ndarray:
    return np.full((height, width, 3), value, np.uint8)


def test_a_contact_sheet_fills_rows_up_to_its_width() -> None:
    sheet = contact_sheet([_strip(40, 20, 10), _strip(50, 30, 20), _strip(30, 10, 30)], most_px=100)
    assert sheet.shape == (40, 90, 3)
    assert sheet[0, 0, 0] == 10
    assert sheet[0, 40, 0] == 20
    assert sheet[30, 0, 0] == 30


def test_a_strip_wider_than_the_sheet_is_reduced() -> None:
    assert contact_sheet([_strip(400, 80, 10)], most_px=100).shape == (20, 100, 3)


def test_strips_show_a_gap_for_what_is_missing_and_a_title() -> None:
    plain = make_strip([PAPER, None], ["a", "b"], height=60)
    assert plain.shape[0] == 60 + 34
    assert (plain == 200).any()
    titled = make_strip([PAPER, None], ["a", "b"], title="name", height=60)
    assert titled.shape[0] == plain.shape[0] + 20
    assert titled[:20].min() < 100


@pytest.mark.parametrize("name", ["curved", "tilt"])
def test_a_run_saves_its_pictures(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.rectify.simulated_pictures.OUTPUT", tmp_path)
    experiment = EXPERIMENTS[name]
    cases = all_cases(experiment, ("a", "b"), degraded=False)[:3]
    figures = [
        CaseFigures(
            case.name,
            case.page_number,
            case.shape + 1,
            case.pose + 1,
            case.skew_deg,
            major_deg=0.3 + case.rank,
        )
        for case in cases
    ]
    for entry in figures:
        save_case(tmp_path / "cases", entry, PAPER, None, {"true map": PAPER})
    save_run(experiment, figures, tmp_path / "cases", degraded=False)
    written = {file.name.removeprefix(f"rectify_{name}") for file in tmp_path.iterdir() if file.is_file()}
    series = {"-series.png"} if name == "tilt" else set()
    assert written == {".json", ".png", "-worst.png", "-pairs.png", *series}
    assert load_picture(tmp_path / f"rectify_{name}-pairs.png").shape[1] > 3 * 150


def test_progress_numbers_and_estimates(capsys: pytest.CaptureFixture[str]) -> None:
    progress = Progress(2)
    progress.tell("first")
    progress.tell("second")
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("[1/2 0s, 0s left] first")
    assert lines[1].startswith("[2/2 ")
