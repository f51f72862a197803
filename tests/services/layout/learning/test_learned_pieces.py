"""What samples with images teach of pieces: log odds and sums for each label, surer with more samples."""

from dataclasses import replace

import pytest

from services.layout.grouping.joining import find_groups
from services.layout.grouping.piece_pairs import MOST_ZONES
from services.layout.grouping.regrouping_odds import merged_log_odds
from services.layout.learning.learned_pieces import learn_pieces
from services.layout.page import Page
from tests.services.layout.grouping.test_joining import BODY, HEAD, MORE, UNDER, labelled, page, zone

VERIFIED = page(zone("h", (90, 95, 510, 155), "head"), BODY, MORE)
FOUND = page(HEAD, UNDER, BODY, MORE)


def test_samples_teach_which_labels_come_in_pieces() -> None:
    once, often = learn_pieces([(VERIFIED, FOUND)]), learn_pieces([(VERIFIED, FOUND)] * 8)
    assert once["head"].joining > 0 > once["text"].joining
    assert often["head"].joining > once["head"].joining
    assert often["text"].joining < once["text"].joining
    assert (often["head"].whole, often["head"].divided) == (0, 8)
    assert (often["text"].whole, often["text"].divided) == (16, 0)
    assert often["text"].widths == pytest.approx((16, 16 * -0.32193, 16 * 0.10364), rel=1e-3)  # log2(0.8)
    assert learn_pieces([]) == {}


def test_what_was_learned_separates_the_pieces_of_the_next_page() -> None:
    learned = learn_pieces([(VERIFIED, FOUND)] * 5)
    assert find_groups(labelled(*FOUND.zones), FOUND, learned) == ((0, 1), (2,), (3,))


def test_pages_one_after_another_teach_nearly_the_same_as_together() -> None:
    together = learn_pieces([(VERIFIED, FOUND)] * 6)
    learned = learn_pieces([])
    for _ in range(6):
        learned = learn_pieces([(VERIFIED, FOUND)], learned)
    for label, each in together.items():
        assert learned[label].joining == pytest.approx(each.joining, abs=0.35)
        # A recognized page does not tell what segmentation has kept apart.
        assert replace(learned[label], joining=0.0, certainty=0.0) == replace(
            each, joining=0.0, certainty=0.0, apart=0.0
        )


def test_zones_that_were_put_together_count_as_their_pieces() -> None:
    """A wrong join teaches that the pieces are zones of their own."""
    wrong = replace(BODY, id="b", box=(100, 200, 900, 600), pieces=(BODY.box, MORE.box))
    assert learn_pieces([(VERIFIED, page(HEAD, UNDER, wrong))])["text"].joining < 0
    right = replace(HEAD, id="h", box=(100, 100, 500, 150), pieces=(HEAD.box, UNDER.box))
    learned = learn_pieces([(VERIFIED, page(right, BODY, MORE))])
    assert learned["head"].joining > 0
    assert learned["head"].divided == 1


def test_labels_that_segmentation_merges_are_known() -> None:
    """The head and the text below it in one zone; the text alone is on the page, too."""
    both = replace(BODY, id="both", box=(100, 90, 900, 460))
    learned = learn_pieces([(VERIFIED, page(both, MORE))] * 2)
    assert (learned["head"].merged, learned["head"].apart) == (2, 0)
    assert (learned["text"].merged, learned["text"].apart) == (2, 2)
    assert merged_log_odds([learned["head"]]) > merged_log_odds([learned["text"]]) > 0
    assert merged_log_odds(learned.values()) == merged_log_odds([learned["text"]])
    apart = learn_pieces([(VERIFIED, FOUND)])
    assert merged_log_odds([learned["head"], apart["head"]]) == 0.0
    assert learn_pieces([(VERIFIED, page(both, MORE))], {})["text"].apart == 0


def test_crowded_pages_teach_nothing() -> None:
    crowd = Page(1000.0, 1400.0, (HEAD, UNDER) * MOST_ZONES)
    assert learn_pieces([(crowd, crowd)]) == {}
