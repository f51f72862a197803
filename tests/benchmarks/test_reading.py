"""The character score on cases that can be told by hand."""

import math

import pytest

from benchmarks.common.reading import character_error_rate, character_score, normalise_text, word_rate

LINES = ("the quick brown fox", "jumps over the lazy dog")


def test_perfect_reading_in_any_order() -> None:
    assert character_score(LINES, "the quick brown fox\njumps over the lazy dog") == 1.0
    assert character_score(LINES, "jumps over the lazy dog   the quick brown fox") == 1.0
    assert word_rate(LINES, "dog lazy the over jumps fox brown quick the") == 1.0


def test_one_wrong_letter_costs_its_share() -> None:
    read = "the quick brown fix jumps over the lazy dog"
    assert character_score(LINES, read) == pytest.approx(1 - 1 / 42)
    assert word_rate(LINES, read) == pytest.approx(8 / 9)


def test_a_lost_line_costs_its_length() -> None:
    assert character_score(LINES, "the quick brown fox 0123456789") == pytest.approx(19 / 42, abs=1e-9)


def test_similarity_below_the_limit_counts_as_nothing() -> None:
    # 4 of 12 letters agree: 0.33 < 0.35; with a fifth, 0.42.
    assert character_score(["abcdefghijkl"], "abcd########") == 0.0
    assert character_score(["abcdefghijkl"], "abcde#######") == pytest.approx(5 / 12)


def test_nothing_read_is_nought_and_no_truth_is_nan() -> None:
    assert character_score(LINES, "") == 0.0
    assert word_rate(LINES, "") == 0.0
    assert math.isnan(character_score([], "text"))
    assert math.isnan(word_rate(["  "], "text"))


def test_less_read_than_one_line() -> None:
    assert character_score(["abcdefghij"], "abcdefg") == pytest.approx(0.7)


def test_long_lines_and_texts() -> None:
    line = " ".join(f"word{i}" for i in range(40))
    noise = " ".join(f"other{i}" for i in range(300))
    assert character_score([line], f"{noise} {line} {noise}") == pytest.approx(1.0)


def test_words_count_as_often_as_they_stand() -> None:
    assert word_rate(["a a b"], "a b b") == pytest.approx(2 / 3)


def test_quotes_dashes_ligatures_and_space_do_not_matter() -> None:
    assert normalise_text("“ﬁne” — it’s\n  so") == '"fine" - it\'s so'
    assert character_score(["“ﬁne” — it’s"], '"fine" - it\'s') == 1.0


def test_error_rate_is_in_reading_order() -> None:
    assert character_error_rate("abcd", "abcd") == 0.0
    assert character_error_rate("abcd", "abd") == 0.25
    assert character_error_rate("ab cd", "cd ab") > 0.5
    assert character_error_rate("", "") == 0.0
