"""Patterns of a settings file: those that may take long are refused, those that are taken are quick."""

import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.contract.bounded_patterns import UnboundedPattern, compile_bounded

SLOW = [
    r"(a+)+$",
    r"(a|aa){1,60}b",
    r"(.*)(.*)x",
    r"\w+\s+\w+",
    r"(a)\1",
    r"((a?){20}){20}b",
    r"(?:a{0,50}){0,9}b",
    "a" * 3000,
]
SLOW += [r"(?P<n>a)(?P=n)", r"(a)(?(1)b|c)"]
QUICK = [
    r"\b[A-Z]{2} [0-9]{5}\b",
    r"(?i)(?:jan|feb)[a-z]{0,7}+ \d{1,2}",
    r"[]\]()]{1,3}",
    r"(?>\w+) x",
    r"\w++ \w++",
    r"a{,3}b{2}",
]


@pytest.mark.parametrize("pattern", SLOW)
def test_patterns_that_may_take_long_are_refused(pattern: str) -> None:
    with pytest.raises(UnboundedPattern):
        compile_bounded(pattern)


@pytest.mark.parametrize("pattern", QUICK)
def test_bounded_patterns_are_taken(pattern: str) -> None:
    assert compile_bounded(pattern).pattern == pattern


PIECES = [
    "a",
    "b",
    "(",
    ")",
    "(?:",
    "(?=",
    "[ab]",
    "[^a]",
    "*",
    "+",
    "?",
    "{1,3}",
    "{2,}",
    "|",
    "\\w",
    "\\b",
    "*+",
    "$",
    "(?i:",
]


@given(st.lists(st.sampled_from(PIECES), max_size=9).map("".join))
@settings(max_examples=300, deadline=None)
def test_what_is_taken_is_quick(pattern: str) -> None:
    try:
        compiled = compile_bounded(pattern)
    except UnboundedPattern:
        return
    began = time.process_time()
    compiled.match("ab" * 1000 + "c")
    compiled.match("a" * 2000 + "c")
    assert time.process_time() - began < 0.25
