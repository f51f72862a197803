"""Evidence of words: what is seen over what is expected, shrunk."""

import numpy as np
import pytest

from services.layout.graph.zone_words import WORD_ASPECTS, page_tokens
from services.layout.learning.initialization import initialize_model
from services.layout.model.compiled_model import compile_model
from services.layout.model.model_document import model_from_document, model_to_document
from services.layout.model.word_counts import count_words, dearest_tokens, no_words, word_costs
from services.layout.page import Page, Zone

LEFT = WORD_ASPECTS.index("words-left")


def row(key: str, value: str, top: float, label: str | None) -> tuple[Zone, Zone]:
    return (
        Zone(f"k{top}", (10, top, 80, top + 10), text=key, lines=1),
        Zone(f"v{top}", (200, top, 260, top + 10), text=value, lines=1, label=label),
    )


def receipt(total: str, seed: int = 0) -> Page:
    """Amounts in a column, the total at any place."""
    rows = [
        ("Subtotal", "9.00", None),
        (total, "9.50", "total"),
        ("Cash", "10.00", None),
        ("Change", "0.50", None),
    ]
    rows = rows[seed % 4 :] + rows[: seed % 4]
    return Page(
        300,
        400,
        tuple(zone for k, each in enumerate(rows) for zone in row(each[0], each[1], 100 + 20 * k, each[2])),
    )


def test_evidence_by_hand() -> None:
    page = receipt("Total")
    words = count_words(page_tokens(page), np.array([bool(zone.label) for zone in page.zones]).astype(int), 2)
    assert words.counts[LEFT, "total"].tolist() == [0.0, 1.0]
    cost = word_costs(page_tokens(page), len(page.zones), words)[3, :, LEFT]
    # "total" and "total$" left of the total: one seen, 7/8 and 1/8 of one expected of the two labels.
    expected = -np.sqrt(2) * np.log([0.25 / (0.875 + 0.25), 1.25 / (0.125 + 0.25)])
    np.testing.assert_allclose(cost, expected)


def test_what_no_sample_has_says_nothing() -> None:
    page, other = receipt("Total"), receipt("Gesamt")
    words = count_words(page_tokens(page), np.zeros(8, np.intp), 1)
    cost = word_costs(page_tokens(other), 8, words)
    value = next(k for k, zone in enumerate(other.zones) if zone.label)
    assert not cost[value, :, LEFT].any()
    assert not word_costs(page_tokens(other), 8, no_words(3)).any()


def test_a_page_can_be_taken_away_again() -> None:
    first, second = (
        count_words(page_tokens(receipt(key)), np.arange(8) % 2, 2) for key in ("Total", "Summe")
    )
    left = first + second - second
    assert left.counts.keys() == first.counts.keys()
    np.testing.assert_allclose(left.zones, first.zones)
    half = (first + second) / 2
    assert half.counts[LEFT, "cash"].sum() == pytest.approx(1.0)
    assert first.with_labels(4).counts[LEFT, "cash"].shape == (4,)


def test_of_too_many_tokens_those_of_labels_stay() -> None:
    page = receipt("Total")
    words = count_words(page_tokens(page), np.array([bool(zone.label) for zone in page.zones]).astype(int), 2)
    kept = set(dearest_tokens(words, 12))
    assert (LEFT, "total") in kept
    assert (LEFT, "change") not in kept


def test_a_model_learns_its_keys_from_samples_whose_places_differ() -> None:
    """Four rows look alike and change their places: only the word on the left tells the total."""
    model = initialize_model("receipt", [receipt("Total", seed) for seed in range(4)])
    assert model.nodes[1].words["words-left"].tokens["total"] > 0
    again = model_from_document(model_to_document(model))
    assert again.nodes[1].words == model.nodes[1].words
    compiled = compile_model(again, ("date",))
    page = receipt("Total", 2)
    costs = word_costs(page_tokens(page), len(page.zones), compiled.words)[:, 1, LEFT]
    assert page.zones[int(costs.argmin())].label == "total"
