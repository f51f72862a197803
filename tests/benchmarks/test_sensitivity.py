"""The study of parameters: fields are found and changed, and replayed answers are those of the code itself."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.sensitivity import study
from benchmarks.sensitivity.fields import Field, Watch, find_fields, watching
from benchmarks.sensitivity.replay import Replay, replaying
from benchmarks.sensitivity.report import FieldRecord, format_study, load_study
from benchmarks.sensitivity.steps import Case, Outcome, Step

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ToyParameters:
    """Of a step that scales an array, and adds a constant where it is large."""

    scale: float = 2.0
    offset_px: float = 1.0
    enough: int = 3
    unread: float = 5.0
    bounds: tuple[float, float] = (-1e9, 1e9)
    named: bool = True


@dataclass(frozen=True, slots=True)
class WiderParameters(ToyParameters):
    """Of a step that builds on the other: what is inherited belongs to the base class."""

    wider_px: float = 4.0


PARAMETERS = ToyParameters()
"""An instance that is there before the study begins."""
CALLS: list[str] = []


def scaled(values: FloatArray, parameters: ToyParameters) -> FloatArray:
    CALLS.append("scaled")
    return values * parameters.scale


def shifted(values: FloatArray, parameters: ToyParameters) -> FloatArray:
    CALLS.append("shifted")
    return values + parameters.offset_px if len(values) > parameters.enough else values


def spoiled(values: FloatArray) -> float:
    """Changes its argument: a second call gives another answer."""
    values[0] += 1.0
    return float(values[0])


def run_toy(values: FloatArray) -> Outcome:
    here = sys.modules[__name__]  # As a caller's module would name them.
    answer = here.shifted(here.scaled(values, PARAMETERS), PARAMETERS)
    low, high = PARAMETERS.bounds
    return Outcome(float(np.clip(answer.sum(), low, high)), answer.tobytes())


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """This module in place of a package of the product."""
    here = sys.modules[__name__]
    for module in ("fields", "replay"):
        monkeypatch.setattr(f"benchmarks.sensitivity.{module}.modules_of", lambda _: [here])
    CALLS.clear()
    return here


def test_numeric_fields_are_found_with_their_units(toy: ModuleType) -> None:
    found = {each.name: each for each in find_fields([toy.__name__])}
    assert set(found) == {"scale", "offset_px", "enough", "unread", "bounds", "wider_px"}
    assert found["scale"].owner is ToyParameters
    assert [found[name].unit for name in ("scale", "offset_px", "enough")] == ["1", "px", "count"]


def test_whole_numbers_move_by_one_and_stay_positive(toy: ModuleType) -> None:
    found = {each.name: each for each in find_fields([toy.__name__])}
    assert (found["enough"].changed(0.8), found["enough"].changed(1.2)) == (2, 4)
    assert found["enough"].changed(0.1) == 1
    assert found["scale"].changed(1.2) == pytest.approx(2.4)


def test_ratios_and_percentiles_keep_their_meaning() -> None:
    step = Field("p.P.size_step", ToyParameters, "size_step", 1.1)
    percentile = Field("p.P.detail_percentile", ToyParameters, "detail_percentile", 85.0)
    assert step.changed(0.8) == pytest.approx(1.08)
    assert percentile.changed(1.2) == pytest.approx(82.0)
    windows = Field("p.P.windows", ToyParameters, "windows", ((2.0, 4.0), (1.0, 8.0)))
    assert windows.changed(0.5) == ((1.0, 2.0), (0.5, 4.0))


def test_one_field_is_changed_in_instances_that_exist(toy: ModuleType) -> None:
    watch = Watch()
    found = {each.name: each for each in find_fields([toy.__name__])}
    with watching(list(found.values()), watch):
        with watch.changing(found["scale"], 3.0):
            assert (PARAMETERS.scale, PARAMETERS.offset_px) == (3.0, 1.0)
            assert ToyParameters(scale=7.0).scale == 7.0, "chosen by the code"
            assert WiderParameters().scale == 3.0
        assert PARAMETERS.scale == 2.0
    assert watch.reads[-1] == {found["scale"].key, found["offset_px"].key}
    assert PARAMETERS.scale == 2.0


def test_replayed_answers_are_the_codes_own(toy: ModuleType) -> None:
    """Every field up and down, with and without replay; what does not read a field is not run again."""
    values = np.arange(5.0)
    found = find_fields([toy.__name__])
    watch = Watch()
    replay = Replay(watch)

    def outcomes(functions: list[Callable[..., object]]) -> list[Outcome]:
        made = []
        with watching(found, watch), replaying(functions, [toy.__name__], replay):
            run_toy(values)
            for field in found:
                for factor in (0.8, 1.2):
                    value = field.changed(factor)
                    assert value is not None
                    with watch.changing(field, value):
                        made.append(run_toy(values))
                replay.forget_changes()
        return made

    plain = outcomes([])
    CALLS.clear()
    assert outcomes([scaled, shifted]) == plain
    # Once with the defaults; `scaled` for two values of its field, `shifted` for those and two each of its own fields.
    assert CALLS.count("scaled") == 1 + 2
    assert CALLS.count("shifted") == 1 + 2 + 4


def test_what_changes_its_arguments_is_not_replayed() -> None:
    replay = Replay(Watch())
    call = replay.wrapped(spoiled)
    assert [call(np.zeros(1)), call(np.zeros(1))] == [1.0, 1.0]
    values = np.zeros(1)
    assert [call(values), call(values)] == [1.0, 2.0]


def test_a_callers_drawing_does_not_reach_later_answers(toy: ModuleType) -> None:
    call = Replay(Watch()).wrapped(scaled)
    values = np.ones(2)
    call(values, PARAMETERS)[:] = 9.0
    assert call(values, PARAMETERS).tolist() == [2.0, 2.0]


def test_a_study_tells_what_moves_and_goes_on_where_it_stopped(
    toy: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "find_slow", lambda *_: [scaled, shifted])
    cases: dict[str, Case] = {"five": lambda: run_toy(np.arange(5.0)), "two": lambda: run_toy(np.arange(2.0))}
    step = Step("toy", (toy.__name__,), (toy.__name__,), "sum", lambda _: cases)
    file = tmp_path / "toy.json"
    first = study.run_study(step, tmp_path, file, only="scale")
    assert [each.key.rsplit(".", 1)[-1] for each in first.fields] == ["scale"]
    whole = study.run_study(step, tmp_path, file)
    by_name: dict[str, FieldRecord] = {each.key.rsplit(".", 1)[-1]: each for each in whole.fields}
    assert by_name["scale"].trials[0].error_change == pytest.approx(-0.2 * 2.0 * (10.0 + 1.0) / 2)
    assert (by_name["scale"].readers, by_name["offset_px"].readers) == (2, 1)
    assert (by_name["unread"].readers, by_name["unread"].trials) == (0, [])
    assert [trial.factor for trial in by_name["bounds"].trials] == [0.8, 1.2, 0.5, 2.0]
    assert not by_name["bounds"].moves_at((0.8, 1.2, 0.5, 2.0))
    assert load_study(file) == whole
    table = format_study(whole)
    assert "`ToyParameters` bounds" in table
    assert "Read by no case (2): `ToyParameters` unread; `WiderParameters` wider_px." in table
