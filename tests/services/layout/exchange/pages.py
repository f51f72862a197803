"""Pages of any kind, and what recognition might say of them."""

from datetime import UTC, datetime

from hypothesis import strategies as st

from services.layout.exchange.limits import ExchangeLimits
from services.layout.page import ALIGNMENTS, KINDS, Page, Zone, ZoneWord
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone

LIMITS = ExchangeLimits()
CREATED = datetime(2026, 3, 1, 12, 30, tzinfo=UTC)

_printable = st.text(min_size=1, max_size=20).filter(str.isprintable)
_labels = st.sampled_from(
    ["title", "body", "page-number", "logo", "other", "a b;c}{:,\\", "ß"]
) | _printable.map(str.strip).filter(bool)
_sizes = st.none() | st.integers(1, 400).map(lambda value: value / 4)


@st.composite
def zones(draw: st.DrawFn, name: str, width: int, height: int) -> Zone:
    x0, y0 = draw(st.integers(0, width - 2)), draw(st.integers(0, height - 2))
    return Zone(
        id=name,
        box=(
            float(x0),
            float(y0),
            float(draw(st.integers(x0 + 1, width))),
            float(draw(st.integers(y0 + 1, height))),
        ),
        kind=draw(st.sampled_from(KINDS)),
        lines=draw(st.none() | st.integers(0, 80)),
        font_size=draw(_sizes),
        line_spacing=draw(_sizes),
        weight=draw(st.none() | st.sampled_from([0.07, 0.1251])),
        alignment=draw(st.none() | st.sampled_from(ALIGNMENTS)),
        text=draw(st.text(max_size=40)),
        label=draw(st.none() | _labels),
    )


@st.composite
def pages(draw: st.DrawFn) -> Page:
    width, height = draw(st.integers(2, 5000)), draw(st.integers(2, 5000))
    names = draw(st.lists(_printable, max_size=5, unique=True))
    return Page(float(width), float(height), tuple(draw(zones(name, width, height)) for name in names))


def read_page() -> Page:
    """A page with a zone of two lines that OCR read."""
    words = (
        ZoneWord("Dear", (10.0, 10.0, 40.0, 20.0), 0.9, 0),
        ZoneWord("Ms <&>", (45.0, 11.0, 80.0, 21.0), 0.25, 0),
        ZoneWord("Roe,", (10.0, 30.0, 35.0, 40.0), 1.0, 1),
    )
    zone = Zone(
        "a", (10.0, 10.0, 80.0, 40.0), lines=2, text="Dear Ms <&>\nRoe,", words=words, label="salutation"
    )
    return Page(100.0, 60.0, (zone,))


def printed_figure() -> Page:
    """A page with a figure in which OCR read words."""
    words = (
        ZoneWord("Axis", (10.0, 12.0, 30.0, 20.0), 0.8, 0),
        ZoneWord("0.5", (50.0, 12.0, 60.0, 20.0), 0.7, 0),
    )
    return Page(100.0, 60.0, (Zone("f", (5.0, 5.0, 80.0, 40.0), kind="figure", words=words, label="figure"),))


def recognized(page: Page, name: str | None = "letter") -> Recognition:
    """The page's own labels as if they were found, in the order of its zones but told in another."""
    labelled = [
        RecognizedZone(zone, zone.label, 0.9, zone.label, order) for order, zone in enumerate(page.zones)
    ]
    chosen = None if name is None else ClassMatch(name, 3, 1.5, 0.97)
    return Recognition(page, tuple(reversed(labelled)), chosen, () if chosen is None else (chosen,))
