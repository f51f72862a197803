"""Steps run side by side where a processor is spare, and give and raise the same where none is."""

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from services.side_by_side import SideStep, cpu_seconds, spare_processors


def spare(count: int) -> Callable[[], int]:
    return lambda: count


@pytest.mark.parametrize("count", [0, 1])
def test_a_step_gives_its_result_once(count: int) -> None:
    calls: list[int] = []
    with spare_processors(spare(count)):
        step = SideStep(lambda: calls.append(threading.get_ident()) or "done")
        assert step.is_beside == bool(count)
        assert [step.result(), step.result()] == ["done", "done"]
    assert len(calls) == 1
    assert (calls[0] != threading.get_ident()) == bool(count)


@pytest.mark.parametrize("count", [0, 1])
def test_a_steps_error_is_its_callers(count: int) -> None:
    def fail() -> None:
        raise ValueError("no")

    with spare_processors(spare(count)), pytest.raises(ValueError, match="no"):
        SideStep(fail).result()


def test_nothing_runs_beside_without_a_spare_processor() -> None:
    assert not SideStep(int).is_beside
    with spare_processors(spare(1)):
        pass
    assert not SideStep(int).is_beside, "after the block neither"


def test_processors_are_spare_again_when_steps_have_ended() -> None:
    go, left = threading.Event(), [1]
    with spare_processors(lambda: left[0]):
        first, second = SideStep(lambda: go.wait(20.0)), SideStep(int)
        assert first.is_beside
        assert not second.is_beside
        assert second.result() == 0, "a step that waits runs in the thread that asks for its result"
        assert not second.is_beside
        go.set()
        assert first.result()
        with SideStep(int) as third:
            assert third.is_beside
        left[0] = 0  # the other workers are busy now
        assert not SideStep(int).is_beside


def test_a_step_waits_for_the_processor_of_another() -> None:
    go, threads = threading.Event(), list[int]()
    with spare_processors(spare(1)):
        first = SideStep(lambda: go.wait(20.0))
        second, third = (SideStep(lambda: threads.append(threading.get_ident())) for _ in range(2))
        third.end()  # it has not begun, and will not
        go.set()
        assert first.result()
        second.result()
        assert second.is_beside
        third.result()
    assert len(threads) == 1
    assert threads[0] != threading.get_ident()


def test_a_step_that_waits_does_not_begin_beside_where_others_need_the_processor() -> None:
    go, left = threading.Event(), [1]
    with spare_processors(lambda: left[0]):
        first, second = SideStep(lambda: go.wait(20.0)), SideStep(threading.get_ident)
        left[0] = 0
        go.set()
        assert first.result()
        assert second.result() == threading.get_ident()


def test_a_step_beside_starts_no_other() -> None:
    with spare_processors(spare(2)):
        assert not SideStep(lambda: SideStep(int).is_beside).result()


def test_a_block_that_is_left_waits_for_its_step_and_drops_one_that_has_not_begun() -> None:
    go, ended = threading.Event(), []

    def work() -> None:
        assert go.wait(20.0)
        ended.append(True)

    with spare_processors(spare(1)), SideStep(work):
        go.set()
    assert ended == [True]
    with SideStep(lambda: ended.append(False)):
        pass
    assert ended == [True]


def test_cpu_time_of_a_step_counts_when_its_caller_waits() -> None:
    def work() -> None:
        end_s = time.thread_time() + 0.02
        while time.thread_time() < end_s:
            np.arange(1000).sum()

    with spare_processors(spare(1)):
        begin_s = cpu_seconds()
        step = SideStep(work)
        step.result()
        assert 0.02 <= cpu_seconds() - begin_s < 0.2
        before_s = cpu_seconds()
        step.end()
        assert cpu_seconds() - before_s < 0.01, "once"
