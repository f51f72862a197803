"""Where lines of words are cut: not within a number whose thousands a space parts."""

from itertools import pairwise

import pytest

from services.layout.grouping.line_cuts import places_of_cuts
from services.layout.page import ZoneWord

EM = 20.0


def parts_of(line: str, keys: frozenset[str] = frozenset()) -> list[str]:
    """The line in its parts; words are 0.3 em apart, and 0.6 em where two spaces are."""
    words: list[ZoneWord] = []
    x = 0.0
    for text in line.split(" "):
        if not text:
            x += 0.3 * EM
            continue
        width = 0.5 * EM * len(text)
        words.append(ZoneWord(text, (x, 0.0, x + width, EM), 0.9, 0))
        x += width + 0.3 * EM
    cuts = [0, *places_of_cuts(words, EM, keys), len(words)]
    return [" ".join(word.text for word in words[a:b]) for a, b in pairwise(cuts)]


@pytest.mark.parametrize(
    ("line", "parts"),
    [
        ("Total TTC 16 323,46 €", ["Total TTC", "16 323,46", "€"]),
        ("1 234 567,80 2,50", ["1 234 567,80", "2,50"]),
        ("3  250,00", ["3", "250,00"]),
        ("1 € 399,00", ["1", "€ 399,00"]),
        ("Subtotal €  399,00", ["Subtotal €", "399,00"]),
        ("Pos 12 250,00", ["Pos", "12 250,00"]),
        ("24 7,80", ["24", "7,80"]),
        ("Facture n° F2025-17", ["Facture n°", "F2025-17"]),
        ("Date: 12/01/2018 16:57", ["Date:", "12/01/2018", "16:57"]),
    ],
)
def test_parts_of_lines(line: str, parts: list[str]) -> None:
    assert parts_of(line) == parts


def test_lines_are_cut_behind_the_keys_of_a_class() -> None:
    line = "Rechnung Nr. 2026-0140 vom 3. März"
    assert parts_of(line) == [line]
    assert parts_of(line, frozenset({"nr"})) == ["Rechnung Nr.", "2026-0140 vom 3. März"]
    assert parts_of("Rechnungsnr. 2026-0140", frozenset({"nr"})) == ["Rechnungsnr. 2026-0140"]
