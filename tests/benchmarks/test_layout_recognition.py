"""What the layout benchmark counts, on labels by hand and on simulated pages."""

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from benchmarks.layout import recognition
from benchmarks.layout.classes import CLASSES
from benchmarks.layout.labelling import LETTERS, TITLES
from benchmarks.layout.learning_curve import LEARNING, draw_curves
from benchmarks.layout.part import share, table
from benchmarks.layout.peers import ForestLabels, zone_features
from benchmarks.layout.protocols import (
    ComponentCounts,
    component_counts,
    confusions,
    draws,
    error_percent,
    floor_percent,
    folds,
    label_in_folds,
    page_labels,
    unlabelled,
)
from benchmarks.layout.specimens import (
    Lesson,
    Specimen,
    area_labelled,
    by_class,
    by_kind,
    lessons,
    with_ten_components,
)
from benchmarks.layout.speed import STEPS
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_from_document
from services.layout.graph.layout_graph import build_graph
from services.layout.page import Page, Zone
from services.layout.pipeline import content_features
from simulation.labelled_pages import letter_page, memo_page, title_page

TRUTH = [("title", "body", None), ("body", "body")]
FOUND = [("title", None, None), ("body", "title")]


def test_errors_are_counted_over_all_zones() -> None:
    assert error_percent(TRUTH, FOUND) == pytest.approx(40.0)
    assert math.isnan(error_percent([()], [()]))
    assert confusions(TRUTH, FOUND) == Counter({("body", "None"): 1, ("body", "title"): 1})


def test_components_are_counted_as_in_table_5_3() -> None:
    counts = component_counts(TRUTH, FOUND)
    assert counts == {
        "title": ComponentCounts(1, 2, 1),
        "body": ComponentCounts(3, 1, 1),
        None: ComponentCounts(1, 2, 1),
    }
    assert (counts["body"].recall, counts["body"].precision) == (pytest.approx(1 / 3), 1.0)
    assert math.isnan(ComponentCounts().recall)


def test_every_page_is_tested_once_by_a_model_without_it() -> None:
    for count, most in ((7, 3), (4, 90), (5, 5)):
        seen = []
        for learned, tested in folds(count, most):
            assert not set(learned) & set(tested)
            assert sorted(learned + tested) == list(range(count))
            seen += tested
        assert sorted(seen) == list(range(count))
    pages = [Page(10.0, 10.0, (Zone(str(k), (0.0, 0.0, 1.0, 1.0), label=str(k)),)) for k in range(5)]

    def tell_samples(samples: Sequence[Lesson], tested: Sequence[Page]) -> list[tuple[str | None, ...]]:
        learned = {zone.label for page, _ in samples for zone in page.zones}
        return [tuple("seen" if zone.label in learned else "new" for zone in page.zones) for page in tested]

    [once, twice] = label_in_folds(tell_samples, [(page, None) for page in pages], 2, pages, pages[::-1])
    assert once == [("new",)] * 5
    assert twice[2] == ("new",)


def test_draws_are_the_same_for_a_seed_and_differ_from_each_other() -> None:
    assert draws(20, 5, 4, seed=1) == draws(20, 5, 4, seed=1) != draws(20, 5, 4, seed=2)
    drawn = draws(20, 5, 4, seed=1)
    assert all(len(set(each)) == 5 and set(each) <= set(range(20)) for each in drawn)
    assert len({tuple(each) for each in drawn}) > 1


def test_the_floor_is_of_labels_that_no_sample_has() -> None:
    def page(*labels: str) -> Page:
        return Page(1.0, 1.0, tuple(Zone(label, (0.0, 0.0, 1.0, 1.0), label=label) for label in labels))

    assert floor_percent([page("a", "b")], [page("a", "c"), page("b", "b")]) == 25.0
    assert math.isnan(floor_percent([page("a")], []))


def test_area_is_right_where_zones_of_the_same_label_cover_it() -> None:
    truth = Page(100.0, 100.0, (_zone("title", 0, 0, 100, 10), _zone("body", 0, 20, 100, 100)))
    found = Page(
        100.0,
        100.0,
        (
            _zone("title", 0, 0, 100, 10),
            _zone("body", 0, 20, 100, 50),
            _zone("caption", 0, 50, 100, 100),
        ),
    )
    assert area_labelled(truth, found) == (1000.0 + 3000.0, 9000.0, 1, 2)
    assert area_labelled(truth, Page(100.0, 100.0, ())) == (0.0, 9000.0, 0, 2)


def _zone(label: str, *box: int) -> Zone:
    x0, y0, x1, y1 = map(float, box)
    return Zone(f"{label}{y0}", (x0, y0, x1, y1), label=label)


def test_ten_components_and_no_labels() -> None:
    page = Page(1.0, 1.0, tuple(_zone(label, 0, 0, 1, 1) for label in ("closing", "cc", "stamp", "date")))
    assert page_labels(with_ten_components(page)) == ("signature", "cc", None, "date")
    assert page_labels(unlabelled(page)) == (None,) * 4


def test_tables_show_dashes_where_there_is_nothing() -> None:
    text = table("T", ("name", "a", "b"), [["x", 1.0, None], ["y", float("nan"), "z"]])
    assert [line.split() for line in text.splitlines()] == [
        ["T"],
        ["name", "a", "b"],
        ["x", "1.00", "-"],
        ["y", "-", "z"],
    ]
    assert math.isnan(share(0, 0))


@pytest.fixture(scope="module")
def specimens() -> list[Specimen]:
    rng = np.random.default_rng(3)
    found = []
    for number in range(3):
        for source, name, draw in (
            ("titles/real/jose", "jose", lambda: title_page(rng, "plain", draw=False)),
            ("titles/real/juliacon", "juliacon", lambda: title_page(rng, "two-column", draw=False)),
            ("letters/made", "letter", lambda: letter_page(rng, draw=False)),
            ("letters/made", "memo", lambda: memo_page(rng, draw=False)),
        ):
            page = content_features().measure_page(page_from_document(draw().document(), ExchangeLimits()))
            found.append(Specimen(f"{name}{number}", source, name, Path(f"{name}{number}"), page, page))
    return found


def test_the_forest_sees_the_attributes_of_the_graph(specimens: list[Specimen]) -> None:
    pages = [specimen.true for specimen in by_class(specimens)["jose"]]
    graph = build_graph(pages[0], content_features().names)
    features = zone_features(pages[0])
    assert features.shape == (len(pages[0].zones), graph.numeric.shape[1] + graph.content.shape[1])
    assert np.isfinite(features).all()
    found = ForestLabels(pages).label([*pages, Page(1.0, 1.0, ())])
    assert found == [*(page_labels(page) for page in pages), ()]


def test_pages_by_class_and_kind(specimens: list[Specimen]) -> None:
    assert {name: len(members) for name, members in by_kind(specimens).items()} == {
        "title-page": 6,
        "letter": 3,
        "memo": 3,
    }
    assert set(by_class(specimens)) == {"jose", "juliacon", "letter", "memo"}
    assert lessons(specimens[:3], ("true",)) == [(each.true, None) for each in specimens[:3]]
    assert lessons(specimens[:1], ("true", "own")) == [(specimens[0].true, specimens[0].own)]


def test_title_pages_and_letters_are_measured_and_reported(specimens: list[Specimen]) -> None:
    assert set(TITLES.jobs(specimens)) >= {"title page, real", "titles/real/jose"}
    results = {"titles/real/jose": TITLES.measure("titles/real/jose", specimens)}
    trial = results["titles/real/jose"]["true zones"]
    # Own zones are the true ones here, so that all that is labelled rightly covers its zone.
    assert trial["found_percent"] == pytest.approx(100 - trial["error_percent"])
    assert trial["pages"] == 3
    assert "titles/real/jose" in TITLES.report(results)
    assert TITLES.figures(results)["titles/real/jose, true zones"]["error_percent"] == trial["error_percent"]
    letters = {"letters/made": LETTERS.measure("letters/made", specimens)}
    report = LETTERS.report(letters)
    zones = sum(len(each.true.zones) for each in specimens if each.class_name == "letter")
    overall = next(line for line in report.splitlines() if line.startswith("overall"))
    assert overall.split()[1:3] == [str(zones), str(zones)]


def test_classes_are_decided_with_and_without_the_pages_own(specimens: list[Specimen]) -> None:
    job = "all samples, true zones"
    result = CLASSES.measure(job, specimens)
    assert {row: counts["pages"] for row, counts in result.items()} == {
        "jose": 3,
        "juliacon": 3,
        "letters/made": 3,
        "memo": 3,
    }
    assert sum(counts["nearest right"] for counts in result.values()) >= 10
    figures = CLASSES.figures({job: result})[f"classes, {job}"]
    assert 0 <= figures["unseen_unknown_percent"] <= 100
    assert "taken for" in CLASSES.report({job: result})


def test_learning_curves_have_both_and_the_floor(specimens: list[Specimen], tmp_path: Path) -> None:
    result = {size: {"graph": [1.0, 3.0], "forest": [4.0, 2.0], "floor": [0.5, 0.5]} for size in ("1", "3")}
    results = {"set": {**result, "all": {"graph": [2.0], "forest": [1.0]}, "pages": 9}}
    report = LEARNING.report(results)
    assert "2.00 / 3.00" in report
    assert "everywhere: NO" in report
    assert "set, all samples: 2.00 > 1.00" in report
    assert LEARNING.figures(results)["set, 3 samples"] == {"learning_error_percent": 2.0}
    draw_curves(tmp_path / "curves.png", results)
    assert (tmp_path / "curves.png").stat().st_size > 1000
    assert "letters/made memo" in LEARNING.jobs(specimens)


def test_both_ways_of_matching_stand_in_one_table(specimens: list[Specimen]) -> None:
    result = STEPS.measure("titles/real/jose", specimens)
    direct = result["true"]["direct"]
    assert direct["least_cost_percent"] == 100.0
    assert 0 <= direct["optimal_percent"] <= 100
    assert "titles/real/jose, own zones" in STEPS.report({"titles/real/jose": result})


def test_without_data_nothing_is_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert recognition.main(["--data", str(tmp_path)]) == 0
    assert "nothing is measured" in capsys.readouterr().err
