"""Labels of the zones that a person drew, on zones that were found."""

from services.layout.learning.label_transfer import come_apart, merged_zones, transfer_labels
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


def test_print_within_a_border_has_the_label_of_its_own_zone() -> None:
    border = Zone("0", (0.0, 0.0, 100.0, 100.0), kind="noise")
    drawn = Zone("1", (12.0, 10.0, 40.0, 20.0), label="total")
    found = Page(100.0, 100.0, (Zone("f", (10.0, 10.0, 40.0, 20.0)), border))
    labels = [zone.label for zone in transfer_labels(Page(100.0, 100.0, (border, drawn)), found).zones]
    assert labels == ["total", None], "the border covers all of it, and the drawn zone nine tenths"


def stacked(*labels: str | None, height: float = 20.0) -> tuple[Zone, ...]:
    return tuple(
        Zone(f"t{n}", (10.0, 30.0 * n, 60.0, 30.0 * n + height), label=label, lines=1)
        for n, label in enumerate(labels)
    )


def test_a_zone_that_holds_several_labels_comes_apart() -> None:
    truth = Page(100.0, 200.0, stacked("name", "street", "street"))
    one = Zone("f", (8.0, 0.0, 62.0, 80.0), label="street", lines=3)
    other = Zone("g", (10.0, 120.0, 60.0, 140.0))
    apart = come_apart(truth, Page(100.0, 200.0, (one, other)))
    assert [(zone.id, zone.label) for zone in apart.zones] == [
        ("f.1", "name"),
        ("f.2", "street"),
        ("f.3", "street"),
        ("g", None),
    ]
    assert merged_zones(truth, Page(100.0, 200.0, (one, other))) == {0: [0, 1, 2]}


def test_what_has_one_label_or_lies_side_by_side_stays() -> None:
    whole = Zone("f", (8.0, 0.0, 62.0, 80.0))
    beside = (
        Zone("a", (10.0, 0.0, 30.0, 80.0), label="left"),
        Zone("b", (35.0, 0.0, 60.0, 80.0), label="right"),
    )
    within = (
        Zone("o", (8.0, 0.0, 62.0, 80.0), label="logo"),
        Zone("i", (10.0, 30.0, 60.0, 50.0), label="name"),
    )
    for zones in (stacked("a", "a", "a"), stacked("a"), beside, within, stacked("a", "b", height=2.0)):
        found = Page(100.0, 200.0, (whole,))
        assert come_apart(Page(100.0, 200.0, zones), found) is found
    figure = Page(100.0, 200.0, (Zone("f", whole.box, kind="figure"),))
    assert come_apart(Page(100.0, 200.0, stacked("a", "b", "c")), figure) is figure
