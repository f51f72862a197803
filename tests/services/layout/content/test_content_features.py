"""Content features: what marks a zone of a letter or a paper, in clean text and in misread text."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.content.content_features import ContentFeatures
from services.layout.page import Page, Zone
from simulation.labelled_pages import fax_page, letter_page, memo_page, title_page

FEATURES = ContentFeatures.load()
ADDRESS = "Mr. Thomas Bell\nAlder Creek Savings Bank\n12 Main Street\nCollege Park, MD 20742"
PARAGRAPH = (
    "We spoke with Mr. Bell on March 5, 1978 about the lamps, and he will write to you before the end of the month. "
    "The price includes delivery to your door, but not the unpacking or the removal of the old machine, and no "
    "payment is due before the work has been accepted by both of the inspectors."
)
CLEAR = [
    ("name", "Dr. David T. Ellery"),
    ("name", "Frank Holloway"),
    ("location", ADDRESS),
    ("location", "P.O. Box 380, Baltimore, Maryland"),
    ("organization", "Department of Physics, University of Northfield"),
    ("date", "September, 2002"),
    ("date", "October 18, 1965"),
    ("date", "17th March 1988"),
    ("date", "12/21/94"),
    ("greeting", "Dear Sir or Madam,"),
    ("greeting", "To Whom It May Concern"),
    ("closing", "Sincerely yours,"),
    ("closing", "Truly yours,"),
    ("closing", "Best regards,"),
    ("zipcode", "MD 20742"),
    ("zipcode", "00555-9642"),
    ("zipcode", "New York, New York I0019"),
    ("subject", "RE: the lamps"),
    ("subject", "Subject: the lamps"),
    ("ps", "P.S. Please write."),
    ("ps", "PS: Please write."),
    ("enclosure", "Encl."),
    ("enclosure", "Enclosures (2)"),
    ("cc", "cc: A. Bell"),
    ("cc", "CC: A. Bell"),
    ("typist-initials", "RWG/rdb"),
    ("typist-initials", "/ns"),
    ("abstract", "Abstract. Measurements have long been made"),
    ("abstract", "A B S T R A C T"),
    ("keywords", "Keywords: rivers, lamps, statistics"),
    ("keywords", "Index Terms - rivers, lamps"),
    ("references", "References"),
    ("doi", "DOI: 10.21105/inv.00041"),
    ("email", "bell@northfield.example.edu"),
    ("url", "https://doi.org/10.1000/1"),
    ("phone", "(301) 555-0188"),
    ("licence", "Copyright 2019 by the authors. All rights reserved."),
    ("publication", "Journal of Invented Software, 3(2), 41"),
    ("history", "Received 5 May 2001"),
    ("heading", "1. Introduction"),
    ("heading", "REFERENCES"),
    ("caption", "Fig. 2: Error against the number of samples"),
    ("lone-number", "17"),
    ("lone-number", "- 3 -"),
    ("lone-number", "Page 2 of 5"),
    ("to", "TO: All members"),
    ("from", "From: The office"),
    ("pages-field", "NO. OF PAGES: 4"),
    ("memo", "M E M O R A N D U M"),
    ("fax", "Facsimile transmittal"),
    ("position", "Vice President"),
    ("prose", PARAGRAPH),
    ("capitals", "QUARRY HILL & SONS"),
    ("digits", "50674981"),
    ("raised-mark", "Grace Holloway1, Louis Bell2"),
    ("sentence-end", PARAGRAPH),
    ("sentence-end", PARAGRAPH * 20),
    ("announcement", "In this paper we present a method " + PARAGRAPH),
    ("code", "$ pip install lamps"),
    ("code", "import lamps\nlamps.light(3)"),
    ("equation", "∆X = X − Y . (1)"),
    ("scraps", "| ~ 4 «\n— kG ;"),
]
MISREAD = [
    ("greeting", "Deer Mr. Price"),
    ("greeting", "Deac Dave:"),
    ("greeting", "To Whon It May Concem:"),
    ("closing", "Sineerely,"),
    ("closing", "Sincersiy yours"),
    ("closing", "Very/qruly yours,"),
    ("closing", "Wath best wishes,"),
    ("enclosure", "ene."),
    ("enclosure", "Attacbments"),
    ("cc", "ec: K, Sandler"),
    ("date", "Dacemher 9, 1977"),
    ("date", "June 19, 19B4"),
    ("keywords", "Keyvvords: rivers"),
    ("abstract", "Ahstract Measurements"),
]
NONE = [
    (
        "greeting",
        "We said so to our dear friends, and to others, in the letter that we wrote about it last year.",
    ),
    ("greeting", "He died, dear Sir"),
    (
        "closing",
        "Yours was the best letter of all that we received on this matter in the last few years, as I said.",
    ),
    ("date", PARAGRAPH),
    ("name", PARAGRAPH),
    ("date", "We march on and may meet them."),
    ("cc", "accounts of the company"),
    ("cc", "Copies of the form are in the stockroom."),
    ("typist-initials", "To: File"),
    ("typist-initials", "Sincerely"),
    ("subject", "Responsible persons are asked to reply"),
    ("subject", "Read this"),
    ("ps", "Psychology of the crowd"),
    ("enclosure", "Engineers of the plant"),
    ("zipcode", "In the year 1988 we sold 20742 lamps"),
    ("doi", "10.5 mm of rain"),
    ("heading", PARAGRAPH),
    ("lone-number", "17 lamps"),
    ("abstract", "The abstract of the paper"),
    ("prose", "Frank Holloway"),
    ("sentence-end", "On the estimation of tidal currents in estuaries"),
    ("code", PARAGRAPH),
    ("scraps", ADDRESS),
    ("scraps", PARAGRAPH),
    ("equation", PARAGRAPH),
]


@pytest.mark.parametrize(("feature", "text"), CLEAR)
def test_clear_marks_are_sure(feature: str, text: str) -> None:
    assert FEATURES.measure(text)[feature] >= 0.8


@pytest.mark.parametrize(("feature", "text"), MISREAD)
def test_misread_marks_are_found_but_less_sure(feature: str, text: str) -> None:
    assert 0.5 <= FEATURES.measure(text)[feature] <= 0.8


@pytest.mark.parametrize(("feature", "text"), NONE)
def test_other_text_has_no_such_mark(feature: str, text: str) -> None:
    assert FEATURES.measure(text)[feature] < 0.35


@pytest.mark.parametrize(
    "text", ["Dear Mr. Bell:", "Very truly yours,", "Enclosures", "Subject: lamps", "1 Introduction"]
)
def test_case_and_blanks_change_little(text: str) -> None:
    marks = ("greeting", "closing", "enclosure", "subject")
    plain = FEATURES.measure(text)
    forms = (
        text.upper(),
        text.lower(),
        f"  {text} \n\n",
        text.replace(" ", "\t  "),
        text.replace(" ", "\u00a0"),
    )
    for form in forms:
        measured = FEATURES.measure(form)
        assert {mark: measured[mark] for mark in marks} == {mark: plain[mark] for mark in marks}, form


def test_confidence_falls_with_the_length_of_a_zone() -> None:
    found = [FEATURES.measure("Dear Mr. Bell: " + "we thank you " * count)["greeting"] for count in range(8)]
    assert found[0] == 1.0
    assert found == sorted(found, reverse=True)
    assert found[-1] == 0.0


@given(st.text(max_size=300))
@settings(max_examples=150, deadline=None)
def test_any_text_has_confidences(text: str) -> None:
    measured = FEATURES.measure(text)
    assert tuple(measured) == FEATURES.names
    assert all(0.0 <= value <= 1.0 for value in measured.values())


@given(
    st.lists(
        st.sampled_from(
            ["Dear", "cc:", "\n", "1", "MD", "20742", "@", ".", "May", "Mr.", "ﷺ", "é", "x" * 40, "/"]
        )
    )
)
@settings(max_examples=100, deadline=None)
def test_any_jumble_of_marks_has_confidences(parts: list[str]) -> None:
    assert all(0.0 <= value <= 1.0 for value in FEATURES.measure(" ".join(parts)).values())


@pytest.mark.parametrize("text", ["", " \n\t ", "\x00", "\ufffd\ufffd", "—"])
def test_no_text_has_no_marks_but_scraps(text: str) -> None:
    measured = FEATURES.measure(text)
    assert measured.pop("scraps") == (1.0 if text.strip() else 0.0)
    assert max(measured.values()) == 0.0


HOSTILE = [
    "a",
    " ",
    "\n",
    "1",
    "A.",
    "A. ",
    "Aa ",
    "10.",
    "a@",
    "Mr. ",
    "1,",
    "a, ",
    "st ",
    "\n ",
    "l",
    "May 1 ",
    "ﷺ",
    ".",
]


@pytest.mark.parametrize("piece", HOSTILE)
def test_hostile_text_takes_no_longer_than_prose(piece: str) -> None:
    """Ten times as long at most (twice when this was written): a search that goes back and back takes 1000 times."""

    def spent(text: str) -> float:
        began = time.process_time()
        FEATURES.measure(text)
        return time.process_time() - began

    letter = (
        "Dear Mr Smith, we thank you for your letter of 3 May 1994 and enclose two copies of the report. "
    )
    prose, hostile = ([text * (2_000_000 // len(text))] * 3 for text in (letter, piece))
    assert min(map(spent, hostile)) < 10 * min(map(spent, prose))


def test_pages_are_measured_once() -> None:
    rng = np.random.default_rng(1)
    makers = (letter_page, memo_page, fax_page, title_page)
    pages = [
        Page(made.width, made.height, tuple(Zone(z.id, z.box, kind=z.kind, text=z.text) for z in made.zones))
        for made in (makers[number % 4](rng, draw=False) for number in range(12))
    ]
    measured = [FEATURES.measure_page(page) for page in pages]
    for before, after in zip(pages, measured, strict=True):
        assert [zone.id for zone in after.zones] == [zone.id for zone in before.zones]
        for zone in after.zones:
            assert dict(zone.content) == (FEATURES.measure(zone.text) if zone.text else {})
    known = Page(10, 10, (Zone("a", (0, 0, 1, 1), text="Dear Sir", content={"greeting": 0.25}),))
    assert FEATURES.measure_page(known) == known


@pytest.mark.pipeline
def test_marks_tell_the_zones_of_made_pages() -> None:
    """Precision and recall at 0.5 over a hundred pages of our own."""
    rng = np.random.default_rng(5)
    zones = [z for _ in range(100) for z in letter_page(rng, draw=False).zones if z.text]
    measured = [FEATURES.measure(zone.text) for zone in zones]
    of = {
        "greeting": "salutation",
        "closing": "closing",
        "date": "date",
        "enclosure": "enclosure",
        "cc": "cc",
        "ps": "ps",
    }
    for feature, label in of.items():
        found = {number for number, marks in enumerate(measured) if marks[feature] >= 0.5}
        # A stamp has a date by right.
        true = {
            n for n, z in enumerate(zones) if z.label == label or (feature == "date" and z.label == "stamp")
        }
        assert len(found & true) >= 0.98 * len(true), feature
        assert len(found & true) >= 0.95 * len(found), feature
