"""What samples with images teach of pieces: log odds for each label, surer with more samples."""

from services.layout.grouping.joining import find_groups
from services.layout.grouping.piece_pairs import MOST_ZONES
from services.layout.learning.learned_joining import learn_joining
from services.layout.page import Page
from tests.services.layout.grouping.test_joining import BODY, HEAD, MORE, UNDER, labelled, page, zone


def test_samples_teach_which_labels_come_in_pieces() -> None:
    verified = page(zone("h", (90, 95, 510, 155), "head"), BODY, MORE)
    found = page(HEAD, UNDER, BODY, MORE)
    once, often = learn_joining([(verified, found)]), learn_joining([(verified, found)] * 8)
    assert once["head"] > 0 > once["text"]
    assert often["head"] > once["head"]
    assert often["text"] < once["text"]
    assert learn_joining([]) == {}


def test_what_was_learned_separates_the_pieces_of_the_next_page() -> None:
    verified = page(zone("h", (90, 95, 510, 155), "head"), BODY, MORE)
    found = page(HEAD, UNDER, BODY, MORE)
    learned = learn_joining([(verified, found)] * 5)
    assert find_groups(labelled(*found.zones), found, learned) == ((0, 1), (2,), (3,))


def test_crowded_pages_teach_nothing() -> None:
    crowd = Page(1000.0, 1400.0, (HEAD, UNDER) * MOST_ZONES)
    assert learn_joining([(crowd, crowd)]) == {}
