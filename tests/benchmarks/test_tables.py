"""Tables in the dissertation's form, figures as JSON, and the baseline's judgement."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.baseline import Metric, compare, judge
from benchmarks.common.figures import CaseFigures, Score, groups, mean_std, score_of, to_json, write_json
from benchmarks.common.sheet_errors import SheetErrors
from benchmarks.common.stopwatch import Usage, measured
from benchmarks.rectify import dissertation
from benchmarks.rectify.cases import EXPERIMENTS, all_cases, load_own_pages, load_pages
from benchmarks.rectify.simulated_report import GROUPED_BY, METRICS, TABLES, figures_by_case, report, summary
from benchmarks.rectify.tables import format_table, format_usage

CASES = [
    CaseFigures(
        "a", 1, 1, 1, 0, classified=True, major_deg=0.2, minor_deg=1.0, fov_deg=1.0, residual_percent=0.1
    ),
    CaseFigures(
        "b", 1, 1, 2, 15, classified=True, major_deg=0.4, minor_deg=float("nan"), residual_percent=0.3
    ),
    CaseFigures("c", 2, 1, 1, -15, failure="no-text: blank", scores={"photo": Score(50.0, 40.0)}),
]
BY_PAGE_POSE_AND_SKEW = (
    dissertation.TABLE_2_1,
    dissertation.TABLE_2_2,
    dissertation.TABLE_3_1,
    dissertation.TABLE_3_2,
    dissertation.TABLE_3_3,
    dissertation.TABLE_3_8,
    dissertation.TABLE_3_9,
)
PRINTED_POSES_DIFFER_BY = {id(dissertation.TABLE_3_3): 0.2, id(dissertation.TABLE_3_9): 3.0}
"""In two tables the dissertation's own means by pose do not agree with its totals."""


def _all_figures(experiment: str) -> list[CaseFigures]:
    cases = all_cases(EXPERIMENTS[experiment], ("a", "b", "c", "d", "e"), degraded=False)
    return [
        CaseFigures(case.name, case.page_number, case.shape + 1, case.pose + 1, case.skew_deg)
        for case in cases
    ]


@pytest.mark.parametrize("experiment", TABLES)
def test_rows_are_the_dissertations(experiment: str) -> None:
    by = GROUPED_BY.get(experiment, ("page", "pose", "skew"))
    rows = set(groups(_all_figures(experiment), by))
    for table in TABLES[experiment]:
        if table.printed:
            assert set(table.printed) | {"All"} == rows
            assert {len(row) for row in table.printed.values()} <= set(range(1, len(table.columns) + 1))


def test_shapes_have_rows_where_there_are_several() -> None:
    assert [row for row in groups(_all_figures("curved")) if row.startswith("Shape")] == [
        "Shape no.1",
        "Shape no.2",
    ]
    assert not [row for row in groups(_all_figures("cone")) if row.startswith("Shape")]


def test_the_dissertations_groups_agree_with_its_totals() -> None:
    # A mistyped number would show: the mean over pages, poses or skews is the total, up to its rounding.
    for table in BY_PAGE_POSE_AND_SKEW:
        for column, (total, _) in enumerate(table["All"]):
            for prefix in ("Page", "Pose"):
                means = [row[column][0] for label, row in table.items() if label.startswith(prefix)]
                within = PRINTED_POSES_DIFFER_BY.get(id(table), 0.04) if prefix == "Pose" else 0.04
                assert np.mean(means) == pytest.approx(total, abs=within)
            skews = [row[column][0] for label, row in table.items() if label.endswith("skew")]
            assert np.mean(skews) == pytest.approx(total, abs=0.04)


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


def test_fewer_columns_are_printed_than_there_are_of_ours() -> None:
    columns = {"major": lambda case: case.major_deg, "other": lambda case: case.fov_deg}
    text = format_table("Table", columns, CASES, {"All": ((0.5, 0.1),)}, ()).splitlines()
    assert text[1].split() == ["(mean/std)", "major", "other", "|", "major", "(dissertation)"]
    assert text[2].split() == ["All", "0.30/0.10", "1.00/0.00", "|", "0.50/0.10"]
    assert len(text) == 3


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_report_counts_and_names_refusals(experiment: str) -> None:
    text = report(CASES, experiment)
    assert "classified 2/3" in text
    assert "c: no-text: blank" in text
    assert "median 0.200" in text


def test_pages_far_below_the_true_map_are_named() -> None:
    def case(name: str, ours: float) -> CaseFigures:
        return CaseFigures(
            name, 1, 1, 1, 0, scores={"rectified": Score(ours, 0.0), "true map": Score(98.0, 0.0)}
        )

    cases = [case("good", 93.5), case("bad", 92.5)]
    text = report(cases, "curved")
    assert "more than 5 points below the true map: 1\n  bad 5.5" in text
    assert "good: the other kind" in text


def test_summary_has_a_line_a_run() -> None:
    scored = CaseFigures(
        "d", 1, 1, 1, 0, ruling_2d_deg=1.5, scores={"rectified": Score(90.0, 0), "true map": Score(96.0, 0)}
    )
    lines = summary({"planar": CASES[:2], "curved_degraded": [scored]}).splitlines()
    assert lines[1].split() == (
        [
            "planar",
            "2/2",
            "0.30",
            "1.00",
            "-",
            "-",
            "1.00",
            "-",
            "0.200",
            "0.290",
            "|",
            "-",
            "-",
            "-",
            "-",
            "-",
        ]
    )
    assert lines[2].split() == (
        [
            "curved_degraded",
            "0/1",
            "-",
            "-",
            "1.50",
            "-",
            "-",
            "-",
            "-",
            "-",
            "|",
            "-",
            "90.00",
            "96.00",
            "-",
            "1",
        ]
    )


def test_usage_is_averaged_by_step() -> None:
    cases = [
        CaseFigures("a", 1, 1, 1, 0, usage={"rectify": Usage(1.0, 1.0, 100.0)}, stages_ms={"flow": 500.0}),
        CaseFigures("b", 1, 1, 1, 0, usage={"rectify": Usage(3.0, 3.0, 300.0)}),
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
    worse = {case: {**row, "classified": 0.0} for case, row in figures.items()}
    verdict, good = judge(path, worse, METRICS, update=False)
    assert not good
    assert "classified" in verdict


def test_cases_are_the_dissertations_and_the_first_are_varied(tmp_path: Path) -> None:
    pages, given = load_pages(tmp_path)
    assert not given
    counts = {"planar": 60, "curved": 120, "curvature": 35, "tilt": 35, "cone": 60}
    assert set(counts) == {name for name in EXPERIMENTS if not EXPERIMENTS[name].once}
    for name, count in counts.items():
        cases = all_cases(EXPERIMENTS[name], tuple(page.name for page in pages), degraded=True)
        assert len({case.name for case in cases}) == count
        assert {case.number for case in cases} == set(range(count))
        assert [case.rank for case in cases] == list(range(count))
        assert {case.is_planar for case in cases} == {name == "planar"}
        assert len({case.page for case in cases[:12]}) >= 4
    first = all_cases(EXPERIMENTS["planar"], tuple(page.name for page in pages), degraded=True)[:12]
    assert len({case.pose for case in first}) == 4
    assert {case.skew_deg for case in first} == {0, 15, -15}


@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if EXPERIMENTS[name].once])
def test_experiments_on_sheets_photograph_each_shape_once_and_varied(name: str) -> None:
    cases = all_cases(EXPERIMENTS[name], ("a", "b", "c", "d", "e"), degraded=True)
    assert 10 <= len(cases) <= 16
    assert len({case.name for case in cases}) == len(cases)
    assert [case.rank for case in cases] == list(range(len(cases)))
    assert len({case.pose for case in cases}) >= 4


def test_a_books_two_pages_are_of_one_photo() -> None:
    pages = ("a", "b", "c", "d", "e")
    cases = sorted(all_cases(EXPERIMENTS["spread"], pages, degraded=True), key=lambda case: case.number)
    for left, right in zip(cases[::2], cases[1::2], strict=True):
        assert (left.page, left.facing) == (right.facing, right.page)
        assert left.page != right.page
        assert left.pose == right.pose
        assert left.experiment.shapes[left.shape] == right.experiment.shapes[right.shape]


def test_pages_that_experiments_name_are_there_without_data(tmp_path: Path) -> None:
    music, two_columns = load_own_pages(tmp_path, ("music", "revtex"))
    assert (music.name, two_columns.name) == ("music", "revtex")
    assert not music.lines
    assert len(two_columns.lines) > 40


def test_the_report_says_where_views_are_cut() -> None:
    near = SheetErrors(0.2, 0.5, -0.1, 0.2, 1.01, 1.1, -0.5)
    far = SheetErrors(0.4, 1.5, -0.2, 2.0, 1.3, 0.9, 4.0)
    cases = [replace(CASES[0], name=name, sheet=sheet) for name, sheet in (("a", near), ("b", far))]
    text = report(cases, "folded")
    assert "all sides within 0.3 % on average: 2/2" in text
    assert "all sides within 0.3 % at their worst: 1/2" in text
    row = next(line for line in text.splitlines() if line.startswith("aspect error %"))
    assert row.split()[3:5] == ["2.250", "2.250"]
    assert figures_by_case(cases)["b"]["aspect_error_percent"] == 4.0
