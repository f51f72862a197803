"""Tokens of zones: their own text, and the words beside and above."""

from hypothesis import given
from hypothesis import strategies as st

from services.layout.graph.zone_words import (
    LONGEST_TOKEN,
    MOST_TOKENS,
    NOTHING,
    WORD_ASPECTS,
    key_zones,
    page_tokens,
    zone_tokens,
)
from services.layout.page import Page, Zone, ZoneWord


def receipt(*texts: tuple[str, tuple[float, float, float, float]]) -> Page:
    return Page(400.0, 600.0, tuple(Zone(f"z{k}", box, text=text) for k, (text, box) in enumerate(texts)))


def of(page: Page, zone: int, aspect: str) -> tuple[str, ...]:
    return zone_tokens(page)[zone][WORD_ASPECTS.index(aspect)]


KEYED = receipt(
    ("Invoice", (10, 10, 90, 25)),
    ("TOTAL due", (10, 100, 90, 115)),
    ("1,234.50", (200, 101, 260, 116)),
    ("12/01/2018", (200, 130, 280, 145)),
    ("", (300, 300, 320, 320)),
)


def test_a_value_has_its_key_on_its_left_and_what_stands_above() -> None:
    assert of(KEYED, 2, "words-left") == ("total", "due", "due$")
    assert of(KEYED, 1, "words-left") == (NOTHING,)
    assert of(KEYED, 1, "words-above") == ("invoice",)
    assert of(KEYED, 3, "words-left") == (NOTHING,), "in another row"


def test_the_zone_that_is_the_key_of_a_value_is_known() -> None:
    assert key_zones(KEYED)[2] == {"words-left": 1}, "nothing stands above it"
    assert key_zones(KEYED)[3] == {"words-above": 2}
    assert key_zones(KEYED)[0] == {}


def test_a_number_above_tells_its_kind() -> None:
    assert of(KEYED, 3, "words-above") == ("=amount",)


def test_forms_tell_what_a_value_looks_like() -> None:
    assert {"=amount", "0,000.00"} <= set(of(KEYED, 2, "own-forms"))
    assert {"=date", "00/00/0000"} <= set(of(KEYED, 3, "own-forms"))
    assert "=date" not in of(KEYED, 2, "own-forms")


def test_a_misread_letter_leaves_other_pieces() -> None:
    read, misread = (receipt((text, (0, 0, 90, 9))) for text in ("Payable", "Payoble"))
    same = set(of(read, 0, "own-letters")) & set(of(misread, 0, "own-letters"))
    assert {"^pa", "pay", "ble", "le$"} <= same
    assert set(of(read, 0, "own-words")).isdisjoint(of(misread, 0, "own-words"))


def test_of_a_neighbour_only_the_words_in_the_row_count() -> None:
    words = tuple(
        ZoneWord(text, (10.0, y, 60.0, y + 10.0), 0.9, row)
        for row, (text, y) in enumerate((("subtotal", 100.0), ("rounding", 115.0), ("total", 130.0)))
    )
    keys = Zone("k", (10.0, 100.0, 60.0, 140.0), text="subtotal\nrounding\ntotal", words=words)
    page = Page(400.0, 600.0, (keys, Zone("v", (200.0, 114.0, 240.0, 126.0), text="0.01")))
    assert of(page, 1, "words-left") == ("rounding", "rounding$")


def test_a_page_that_was_not_read_says_nothing_and_a_blank_zone_that_it_is_blank() -> None:
    assert page_tokens(receipt(("", (0, 0, 9, 9)), ("", (0, 20, 9, 29)))).tokens == ()
    assert of(KEYED, 4, "own-words") == (NOTHING,)


@given(st.lists(st.text(max_size=300), min_size=1, max_size=4))
def test_tokens_of_any_text_are_few_short_and_printable(texts: list[str]) -> None:
    page = receipt(*((text, (0.0, 20.0 * k, 90.0, 20.0 * k + 9)) for k, text in enumerate(texts)))
    for own in zone_tokens(page):
        for tokens in own:
            assert len(tokens) == len(set(tokens)) <= MOST_TOKENS
            assert all(token.isprintable() and 0 < len(token) <= LONGEST_TOKEN + 1 for token in tokens)
    found = page_tokens(page)
    assert len(set(found.tokens)) == len(found.tokens)
    assert (found.columns < max(len(found.tokens), 1)).all()
