"""Figures of a text that was read: order of blocks is free, lines are not."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.reading.cases import find_cases, printed_rows
from benchmarks.reading.measures import aligned_error, neighbours_kept, value_read

PRINTED = ["the left column begins here", "and goes on to its end", "what stands on the right side"]


def test_the_order_of_lines_costs_nothing_and_scattered_words_do() -> None:
    assert aligned_error(PRINTED, [PRINTED[2], *PRINTED[:2]]) == 0.0
    scattered = ["the left and goes column", "begins here on to its end", PRINTED[2]]
    assert 0.1 < aligned_error(PRINTED, scattered) < 0.6
    assert aligned_error(PRINTED, []) == 1.0
    assert aligned_error(PRINTED, [*PRINTED, "xq" * 10]) == pytest.approx(21 / 80)


def test_neighbours_are_kept_within_lines() -> None:
    assert neighbours_kept(PRINTED, PRINTED[::-1]) == (14, 14)
    assert neighbours_kept(PRINTED[:1], ["the left", "column begins here"]) == (3, 4)
    # A word that was misread says nothing of its line, and neither does one that was read somewhere else too.
    assert neighbours_kept(PRINTED[:1], ["the left colunm begins here"]) == (2, 2)
    assert neighbours_kept(["a b c"], ["a b c", "c"]) == (1, 1)


@pytest.mark.parametrize(
    ("value", "found"),
    [("12 Main Road", (True, True)), ("12 Main Roed", (False, True)), ("14 Side Lane", (False, False))],
)
def test_values_may_run_over_lines(value: str, found: tuple[bool, bool]) -> None:
    assert value_read(value, ["shop, 12 main", "ROAD tel. 5"]) == found


def test_texts_beside_each_other_are_one_printed_row() -> None:
    boxes = np.array([[300, 2, 400, 30], [0, 0, 100, 30], [0, 40, 100, 70]], dtype=float)
    assert printed_rows(["4.25", "total", "cash"], boxes) == ("total 4.25", "cash")


def test_without_data_there_is_nothing_to_read(tmp_path: Path) -> None:
    assert [list(find_cases(tmp_path, part)) for part in ("photos", "receipts", "pages")] == [[], [], []]
