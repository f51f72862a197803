"""Tables in the dissertation's form, figures as JSON, and the baseline's judgement."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import dissertation
from benchmarks.baseline import Metric, compare, judge
from benchmarks.cases import all_cases, load_pages
from benchmarks.figures import CaseFigures, Score, groups, mean_std, score_of, to_json, write_json
from benchmarks.simulated_report import METRICS, figures_by_case, report
from benchmarks.stopwatch import Usage, measured
from benchmarks.tables import format_table, format_usage

CASES = [
    CaseFigures("a", 1, 1, 0, planar=True, major_deg=0.2, minor_deg=1.0, fov_deg=1.0, residual_percent=0.1),
    CaseFigures("b", 1, 2, 15, planar=True, major_deg=0.4, minor_deg=float("nan"), residual_percent=0.3),
    CaseFigures("c", 2, 1, -15, failure="no-text: blank", scores={"photo": Score(50.0, 40.0)}),
]


def test_rows_are_the_dissertations() -> None:
    labels = itertools.product(range(1, 6), range(1, 5), (0, 15, -15))
    rows = list(groups([CaseFigures("x", page, pose, skew) for page, pose, skew in labels]))
    assert rows == list(dissertation.TABLE_2_1)
    assert rows == list(dissertation.TABLE_3_1)
    assert rows == list(dissertation.TABLE_3_8)


def test_the_dissertations_groups_agree_with_its_totals() -> None:
    # A mistyped number would show: the mean over pages, poses or skews is the total, up to its rounding.
    for table in (dissertation.TABLE_2_1, dissertation.TABLE_3_1, dissertation.TABLE_3_8):
        for column, (total, _) in enumerate(table["All"]):
            for prefix in ("Page", "Pose"):
                means = [row[column][0] for label, row in table.items() if label.startswith(prefix)]
                assert np.mean(means) == pytest.approx(total, abs=0.02)
            skews = [row[column][0] for label, row in table.items() if label.endswith("skew")]
            assert np.mean(skews) == pytest.approx(total, abs=0.02)


def test_mean_std_skips_what_is_missing() -> None:
    assert mean_std([1.0, 3.0, float("nan")]) == (2.0, 1.0)
    assert np.isnan(mean_std([float("nan")])).all()


def test_table_prints_ours_beside_theirs() -> None:
    columns = {"major": lambda case: case.major_deg, "minor": lambda case: case.minor_deg}
    text = format_table("Table 2.1", columns, CASES, dissertation.TABLE_2_1).splitlines()
    assert text[0] == "Table 2.1"
    assert text[2].split() == ["All", "0.30/0.10", "1.00/0.00", "|", "0.31/0.04", "0.90/0.34"]
    assert text[4].split() == ["Page", "2", "-", "-", "|", "0.30/0.03", "0.66/0.21"]
    assert [line.split("  ")[0] for line in text[2:]] == [
        "All", "Page 1", "Page 2", "Pose no.1", "Pose no.2", "0° skew", "15° skew", "-15° skew",
    ]  # fmt: skip


def test_report_counts_and_names_refusals() -> None:
    text = report(CASES)
    assert "classified planar 2/3" in text
    assert "c: no-text: blank" in text
    assert "median 0.200" in text


def test_usage_is_averaged_by_step() -> None:
    cases = [
        CaseFigures("a", 1, 1, 0, usage={"rectify": Usage(1.0, 1.0, 100.0)}, stages_ms={"flow": 500.0}),
        CaseFigures("b", 1, 1, 0, usage={"rectify": Usage(3.0, 3.0, 300.0)}),
    ]
    lines = format_usage(cases).splitlines()
    assert lines[1].split() == ["rectify", "2.00", "3.00", "300"]
    assert lines[2].split() == ["rectify:", "flow", "0.50", "0.50"]


def test_measured_sees_work_and_memory() -> None:
    with measured() as small:
        pass
    with measured() as large:
        block = np.ones(30_000_000)
        block *= 2
    del block
    assert large.cpu_s > small.cpu_s
    assert large.peak_mb > small.peak_mb + 150


def test_json_has_no_nan(tmp_path: Path) -> None:
    write_json(tmp_path / "run.json", to_json(CASES))
    read = json.loads((tmp_path / "run.json").read_text())
    assert read[1]["minor_deg"] is None
    assert read[2]["scores"]["photo"] == {"characters": 50.0, "words": 40.0}


def test_scores_by_image() -> None:
    assert score_of("photo", "words")(CASES[2]) == 40.0
    assert np.isnan(score_of("rectified")(CASES[2]))


def test_baseline_flags_what_got_worse_and_only_that() -> None:
    metrics = {"error": Metric(0.1), "score": Metric(0.5, True)}
    then = {"a": {"error": 1.0, "score": 90.0}, "b": {"error": 2.0, "score": 80.0}}
    assert compare({"a": {"error": 1.1, "score": 89.6}}, then, metrics) == []
    assert compare({"a": {"error": 0.1, "score": 99.0}}, then, metrics) == []
    assert compare({"a": {"error": 1.2, "score": 90.0}}, then, metrics)[0].startswith("error: 1.200")
    assert compare({"a": {"error": 1.0, "score": 89.0}}, then, metrics)[0].startswith("score: 89.000")
    assert "no figure any more for a" in compare({"a": {"score": 90.0}}, then, metrics)[0]
    assert compare({"new": {"error": 9.0}}, then, metrics) == []


def test_judge_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "baseline.json"
    figures = figures_by_case(CASES)
    assert figures["a"]["major_deg"] == 0.2
    assert "minor_deg" not in figures["b"]
    assert judge(path, figures, METRICS, update=False)[1]
    assert judge(path, figures, METRICS, update=True)[1]
    assert judge(path, figures, METRICS, update=False) == ("no worse than the baseline on 3 cases", True)
    worse = {case: {**row, "planar": 0.0} for case, row in figures.items()}
    verdict, good = judge(path, worse, METRICS, update=False)
    assert not good
    assert "planar" in verdict


def test_cases_are_sixty_and_the_first_are_varied(tmp_path: Path) -> None:
    pages, given = load_pages(tmp_path)
    assert not given
    cases = all_cases(tuple(page.name for page in pages), degraded=True)
    assert len({case.name for case in cases}) == 60
    assert len({case.number for case in cases}) == 60
    first = cases[:12]
    assert len({case.page for case in first}) >= 4
    assert len({case.pose for case in first}) == 4
    assert {case.skew_deg for case in first} == {0, 15, -15}
