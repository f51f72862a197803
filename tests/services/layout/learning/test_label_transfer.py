"""Labels of the zones that a person drew, on zones that were found."""

from services.layout.learning.label_transfer import transfer_labels
from services.layout.page import Page, Zone

TRUTH = Page(
    100.0,
    200.0,
    (
        Zone("0", (0.0, 0.0, 40.0, 20.0), label="logo"),
        Zone("1", (50.0, 0.0, 100.0, 20.0), label="title"),
        Zone("2", (0.0, 100.0, 100.0, 200.0), label="body"),
    ),
)


def test_labels_pass_to_what_a_true_zone_covers() -> None:
    boxes = {
        "half of the title": (50.0, 0.0, 100.0, 9.0),
        "most of the body": (0.0, 90.0, 100.0, 190.0),
        "title and logo": (0.0, 0.0, 100.0, 20.0),
        "nothing": (0.0, 50.0, 100.0, 80.0),
        "a little of the body": (0.0, 40.0, 100.0, 130.0),
    }
    found = Page(100.0, 200.0, tuple(Zone(name, box) for name, box in boxes.items()))
    labels = [zone.label for zone in transfer_labels(TRUTH, found).zones]
    assert labels == ["title", "body", "title", None, None]
    assert transfer_labels(Page(100.0, 200.0, ()), found) == found


def test_of_two_that_cover_alike_the_smaller_gives_the_label() -> None:
    inner = Zone("1", (10.0, 10.0, 20.0, 20.0), label="inner")
    outer = Zone("2", (0.0, 0.0, 100.0, 100.0), label="outer")
    found = Page(100.0, 100.0, (Zone("f", (10.0, 10.0, 20.0, 20.0)),))
    for zones in ((inner, outer), (outer, inner)):
        assert transfer_labels(Page(100.0, 100.0, zones), found).zones[0].label == "inner"
