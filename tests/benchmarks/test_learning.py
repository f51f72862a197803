"""What the learning benchmarks count, on simulated pages."""

from collections import Counter
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from benchmarks.layout.jobs import Job, KeptResults, measure_all
from benchmarks.layout.part import Part, Result
from benchmarks.layout.specimens import Specimen
from benchmarks.learning import adaptation
from benchmarks.learning.classes import FEEDBACK_CLASSES, follow
from benchmarks.learning.once import ONCE, confused, repeated
from benchmarks.learning.pages import NONE, begin, drop_percent, see, verdict
from benchmarks.learning.rounds import ROUNDS, corrected, draw_rounds, practised
from benchmarks.learning.speed import ADAPTATION_SPEED
from benchmarks.learning.storm import Clients, Storm
from benchmarks.learning.streams import METHODS, STREAMS, draw_streams, in_windows
from benchmarks.learning.streams import follow as follow_stream
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_from_document
from services.layout.learning.learners import wrong_zones
from services.layout.page import Page
from services.layout.pipeline import content_features, initialize_model
from simulation.labelled_pages import letter_page, memo_page


def _pages(draw: type | object, count: int, seed: int = 3) -> list[Page]:
    rng = np.random.default_rng(seed)
    assert callable(draw)
    return [
        content_features().measure_page(
            page_from_document(draw(rng, draw=False).document(), ExchangeLimits())
        )
        for _ in range(count)
    ]


@pytest.fixture(scope="module")
def letters() -> list[Page]:
    return _pages(letter_page, 9)


@pytest.fixture(scope="module")
def specimens(letters: list[Page]) -> list[Specimen]:
    memos = _pages(memo_page, 6)
    named = [("letter", page) for page in letters[:6]] + [("memo", page) for page in memos]
    return [
        Specimen(f"{name}{number}", "letters/made", name, Path(f"{name}{number}"), page)
        for number, (name, page) in enumerate(named)
    ]


def test_rounds_of_practice_leave_no_more_errors_on_the_samples(letters: list[Page]) -> None:
    samples = see(letters[:4])
    model = begin(samples[:1])
    first = sum(wrong_zones(model, views[0].labelled) for views in samples)
    last = list(islice(corrected(model, samples, [0], "passive-aggressive"), 4))[-1]
    assert sum(wrong_zones(last, views[0].labelled) for views in samples) < first


def test_a_model_that_learns_no_more_stays_the_same(letters: list[Page]) -> None:
    samples = see(letters[:2])
    rounds = list(islice(practised(begin(samples), samples, "counting"), 3))
    assert rounds[0] is rounds[1] is rounds[2]
    rounds = list(islice(corrected(begin(samples[:1]), samples, [0], "counting"), 4))
    assert rounds[0].samples == 2
    assert rounds[1] is rounds[2] is rounds[3]


def test_a_stream_is_judged_before_it_teaches(letters: list[Page]) -> None:
    seen = see(letters)
    errors = {method: follow_stream(seen[:1], seen[1:], method) for method in METHODS}
    assert {row[0] for row in errors.values()} == {errors[NONE][0]}
    assert sum(errors["passive-aggressive"]) < sum(errors[NONE])


def test_windows_take_what_is_left_at_the_end() -> None:
    assert in_windows([[1, 1, 0, 0, 2]], [[2, 2, 2, 2, 2]], 2) == [50.0, pytest.approx(0.0), 100.0]
    assert in_windows([[1] * 9], [[10] * 9], 4) == [10.0, 10.0]
    assert in_windows([[3]], [[10]], 10) == [30.0]


def test_the_same_errors_are_those_of_the_same_labels() -> None:
    corrected_page = confused(["date", "body", None], ["body", "body", "date"])
    assert corrected_page == Counter({("date", "body"): 1, (None, "date"): 1})
    truth, found = [["date", "date"], [None, "cc"]], [["body", "cc"], ["date", "body"]]
    assert repeated(corrected_page, truth, found) == (2, 4)
    assert repeated(corrected_page, truth, truth) == (0, 0)


def test_feedback_on_the_class_brings_pages_home(specimens: list[Specimen]) -> None:
    by_name = {
        name: [each.true for each in specimens if each.class_name == name] for name in ("letter", "memo")
    }
    models = {name: initialize_model(name, pages[:1]) for name, pages in by_name.items()}
    told = follow("memo", models, by_name["memo"][1:], {"letter": by_name["letter"]}, by_name["memo"][:2])
    assert (told["stream"], told["others"], told["same"]) == (5, 6, 2)
    assert sum(told["afterwards"]) >= sum(told["unlearned"])
    assert told["learned"][0] == told["unlearned"][0]


@pytest.mark.parametrize(
    ("part", "job", "told"),
    [
        (STREAMS, "letters/made memo | 1 sample", "Mean error of the streams"),
        (ONCE, "letters/made memo", "at most half of the same errors left"),
        (FEEDBACK_CLASSES, "memo, order 1", "all with one sample"),
        (ADAPTATION_SPEED, "memo | counting", "counting: at most 50 ms"),
        (ROUNDS, "letters/made | kept | passive-aggressive", "precision %"),
        (ROUNDS, "letters/made | 1 sample | counting", "round 10"),
    ],
)
def test_parts_measure_and_tell(part: Part, job: str, told: str, specimens: list[Specimen]) -> None:
    assert job in part.jobs(specimens)
    results = {job: part.measure(job, specimens)}
    assert told in part.report(results)
    part.figures(results)


def test_pictures_have_a_panel_for_each(tmp_path: Path) -> None:
    rounds = {"rounds": [0, 1, 2, 3], "error_percent": [4.0, 3, 2, 2], "training_percent": [3.0, 1, 0, 0]}
    draw_rounds(tmp_path / "rounds.png", {"titles/real/jose | all samples | error-correction": rounds})
    windows = {method: [9.0, 5.0, float("nan")] for method in METHODS}
    draw_streams(tmp_path / "streams.png", {"letters/made | 1 sample": {"windows": windows}})
    assert all(file.stat().st_size > 1000 for file in tmp_path.iterdir())


def test_drops_and_verdicts() -> None:
    assert drop_percent(10, 4) == pytest.approx(60)
    assert np.isnan(drop_percent(0, 1))
    assert [verdict(met) for met in (True, False, None)] == ["yes", "NO", "-"]


def _count(job: str, specimens: Sequence[Specimen]) -> Result:
    return {"pages": len(specimens), "job": job}


def test_kept_results_are_found_for_the_same_pages_only(specimens: list[Specimen], tmp_path: Path) -> None:
    kept, job = KeptResults(tmp_path, specimens), Job("part", "a", _count)
    assert kept.find(job) is None
    kept.keep(job, {"pages": 7})
    assert KeptResults(tmp_path, specimens).find(job) == {"pages": 7}
    assert KeptResults(tmp_path, specimens[1:]).find(job) is None
    assert KeptResults(None, specimens).find(job) is None
    part = Part(lambda _: ["a"], _count, str, lambda _: {})
    assert measure_all({"part": part}, specimens, 1, (), kept) == {"part": {"a": {"pages": 7}}}


class Somewhere:
    """A server at an address; empty: it does not run."""

    def __init__(self, url: str) -> None:
        self.url = url


def test_feedback_is_sent_again_under_its_key_until_a_server_has_it() -> None:
    import httpx

    seen: list[tuple[str, str]] = []

    def answer(request: httpx.Request) -> httpx.Response:
        seen.append((request.url.host, request.headers["idempotency-key"]))
        if len(seen) == 1:
            raise httpx.ReadError("killed")
        if len(seen) == 2:
            return httpx.Response(503, json={"code": "busy"})
        return httpx.Response(200, json={"id": "F"})

    storm = Storm()
    servers = [Somewhere("http://a"), Somewhere(""), Somewhere("http://b")]
    with httpx.Client(transport=httpx.MockTransport(answer)) as client:
        clients = Clients(client, servers, storm)  # type: ignore[arg-type]
        assert clients.accepted(0, "/x", headers={"Idempotency-Key": "k"}) == {"id": "F"}
    assert seen == [("a", "k"), ("b", "k"), ("a", "k")]
    assert storm.refusals == {"ReadError": 1, "503 busy": 1}
    assert storm.tries == 3


@pytest.mark.parametrize(
    ("answers", "taken_back", "in_doubt"),
    [
        ((503, 200), {"k"}, set()),  # busy: nothing was written
        ((None,), set(), {"k"}),  # the server was killed before or after it wrote
        ((503, None), set(), {"k"}),
    ],
)
def test_an_undo_that_broke_off_leaves_the_feedback_in_doubt(
    answers: tuple[int | None, ...], taken_back: set[str], in_doubt: set[str]
) -> None:
    import httpx

    left = list(answers)

    def answer(request: httpx.Request) -> httpx.Response:
        status = left.pop(0)
        if status is None:
            raise httpx.ReadError("killed")
        return httpx.Response(status, json={"code": "busy"})

    storm = Storm()
    with httpx.Client(transport=httpx.MockTransport(answer)) as client:
        Clients(client, [Somewhere("http://a")], storm).take_back(0, "/x", "k")  # type: ignore[list-item]
    assert (storm.taken_back, storm.in_doubt, left) == (taken_back, in_doubt, [])


def test_without_data_nothing_is_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert adaptation.main(["--data", str(tmp_path)]) == 0
    assert "nothing is measured" in capsys.readouterr().err
