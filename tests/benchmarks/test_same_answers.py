"""What the comparison of two checkouts calls different, and what it asks."""

from pathlib import Path

from benchmarks.rectify.answering import masked
from benchmarks.rectify.same_answers import FEW, IN_TURN, code_digest, differences, find_requests


def test_differences_name_the_place_and_both_values() -> None:
    old = {"kind": "planar", "mesh": [[1.0, 2.0]], "gone": 1}
    new = {"kind": "curved", "mesh": [[1.0, 2.5]], "new": None}
    assert differences(old, new) == ["kind: planar -> curved", "mesh[0][1]: 2.0 -> 2.5", "gone: 1 -> None"]
    assert differences([1, 2], [1]) == [": [1, 2] -> [1]"]
    assert differences(old, old) == []


def test_times_are_masked_wherever_they_are() -> None:
    document = {"pages": [{"timings_ms": {"decode": 1.0}, "kind": "planar"}], "timings_ms": {}}
    assert masked(document) == {"pages": [{"kind": "planar"}]}


def test_without_data_the_examples_are_asked_with_every_option(tmp_path: Path) -> None:
    requests = list(find_requests(tmp_path))
    assert {tuple(request.options.items()) for request in requests} >= {tuple(o.items()) for o in IN_TURN}
    assert {file.exists() for request in requests for file in request.files} == {True}
    few = list(find_requests(tmp_path, few=True))
    assert {request.name.split()[0] for request in few} == {FEW[0], "mosaic"}


def test_answers_belong_to_the_code_that_made_them(tmp_path: Path) -> None:
    (tmp_path / "services").mkdir()
    module = tmp_path / "services" / "module.py"
    module.write_text("one")
    before = code_digest(tmp_path)
    module.write_text("two")
    assert code_digest(tmp_path) != before
