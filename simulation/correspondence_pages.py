"""Business letters, memos and fax sheets with the truth of their zones."""

import numpy as np

from simulation import invented
from simulation.labelled_zones import LabelledPage, ZoneSetter, broken, height

LETTER_PX = (1275, 1650)
"""US letter at 150 dpi."""
A4_PX = (1240, 1754)
MOST_PARAGRAPHS = 12


def letter_page(
    rng: np.random.Generator, *, scale: float = 1.0, draw: bool = True, ends: bool = True
) -> LabelledPage:
    """A business letter: block or modified block form, its optional parts present by chance.

    One that does not end on this page has no closing and nothing of what follows it, and body to the foot.

    Labels: letterhead reference date receiver subject salutation body closing signature typist-initials
    enclosure cc ps footer page-number stamp handwriting.
    """
    setter, size, left = sheet(rng, scale, draw)
    measure = setter.width - 2 * left
    modified = rng.random() < 0.4
    # In modified block form date and closing begin at the middle of the page.
    inner = left + measure * rng.uniform(0.45, 0.6) if modified else left
    house, sender = invented.firm(rng), invented.person(rng)
    y = _letterhead(rng, setter, size, left, house) if rng.random() < 0.85 else rng.uniform(110, 260)
    if rng.random() < 0.12:
        reference = f"Our ref: {invented.initials(sender)}/{int(rng.integers(100, 9999))}"
        setter.text("reference", [reference], left, y, size)
        y += 2 * size
    setter.text("date", [invented.date(rng)], inner, y, size)
    y += size * rng.uniform(2.5, 5.0)
    receiver = invented.person(rng, courtesy=True)
    y = setter.text("receiver", _address(rng, receiver), left, y, size) + size * rng.uniform(0.9, 2.0)
    subject = (
        f"{invented.pick(rng, ('Re: ', 'RE: ', 'Subject: ', ''))}{invented.pick(rng, invented.SUBJECTS)}"
    )
    subject_place = rng.random()
    if subject_place < 0.2:
        y = setter.text("subject", [subject], left, y, size, bold=rng.random() < 0.4) + size * 1.1
    y = setter.text("salutation", [_salutation(rng, receiver)], left, y, size) + size * rng.uniform(0.6, 1.2)
    if 0.2 <= subject_place < 0.3:
        y = setter.text("subject", [subject.upper()], left, y, size) + size * 1.1
    if not ends:
        paragraphs(rng, setter, size, left, measure, y, setter.height - 150, fill=True)
        return setter.page("letter")
    tail = tail_of(rng, sender)
    room = setter.height - 170 - size * (11 + sum(1.25 * len(lines) + 1.2 for _, lines in tail))
    y = paragraphs(rng, setter, size, left, measure, y, room)
    y = set_ending(rng, setter, size, left, inner, y, sender, tail)
    if rng.random() < 0.15:
        foot = f"{invented.street(rng)} - {invented.town(rng)} - {invented.phone(rng)}"
        setter.text("footer", [foot], setter.width / 2, setter.height - 80, 0.75 * size, align="centre")
    elif rng.random() < 0.08:
        setter.text("page-number", ["1"], setter.width / 2, setter.height - 80, size, align="centre")
    if rng.random() < 0.2 and y < setter.height - 330:
        x = left + rng.uniform(0.2, 0.5) * measure
        setter.stamp(f"RECEIVED {invented.date(rng).upper()}", x, setter.height - 200, 1.1 * size)
    if rng.random() < 0.1 and y < setter.height - 400:
        setter.handwriting("handwriting", (left, setter.height - 260, left + 180, setter.height - 215))
    return setter.page("letter")


def memo_page(
    rng: np.random.Generator, *, scale: float = 1.0, draw: bool = True, ends: bool = True
) -> LabelledPage:
    """An office memo: its fields TO, FROM, DATE and SUBJECT one below the other in a changing order.

    One that does not end on this page has body to the foot.

    Labels: letterhead title date receiver sender subject body signature typist-initials enclosure cc.
    """
    setter, size, left = sheet(rng, scale, draw)
    measure = setter.width - 2 * left
    y = rng.uniform(90, 150)
    if rng.random() < 0.4:
        y = _letterhead(rng, setter, size, left, invented.firm(rng))
    heading = invented.pick(rng, ("MEMORANDUM", "Memorandum", "INTEROFFICE MEMO", "Memo"))
    place = invented.pick(rng, ("left", "centre"))
    x = left if place == "left" else setter.width / 2
    y = setter.text(
        "title", [heading], x, y, 1.4 * size, align="left" if place == "left" else "centre", bold=True
    )
    y += size
    sender = invented.person(rng)
    fields = [
        ("receiver", "TO:", invented.person(rng, courtesy=rng.random() < 0.5)),
        ("sender", "FROM:", sender),
        ("subject", invented.pick(rng, ("SUBJECT:", "RE:", "SUBJ:")), invented.pick(rng, invented.SUBJECTS)),
    ]
    day = ("date", "DATE:", invented.date(rng))
    fields = [day, *fields] if rng.random() < 0.5 else [*fields[:2], day, *fields[2:]]
    step = rng.uniform(1.6, 2.1) * size
    for label, key, value in fields:
        setter.text(label, [f"{key} {value}"], left, y, size)
        y += step
    if rng.random() < 0.6:
        setter.rule(left, left + measure, y + 2)
        y += size
    if not ends:
        paragraphs(rng, setter, size, left, measure, y + 0.5 * size, setter.height - 150, fill=True)
        return setter.page("memo")
    tail = [part for part in tail_of(rng, sender) if part[0] != "ps"]
    room = setter.height - 150 - size * (8 + sum(1.25 * len(lines) + 1.2 for _, lines in tail))
    y = paragraphs(rng, setter, size, left, measure, y + 0.5 * size, room)
    if rng.random() < 0.25:
        scribble = 2.2 * size
        y = setter.text("signature", [sender], left, y + scribble, size, ink_above=scribble)
    for label, lines in tail:
        y = setter.text(label, lines, left, y + size * 1.2, size)
    return setter.page("memo")


def fax_page(rng: np.random.Generator, *, scale: float = 1.0, draw: bool = True) -> LabelledPage:
    """A fax cover sheet: its fields in one or two columns, a short message.

    Labels: other letterhead title receiver sender date field subject body signature footer.
    """
    setter, size, left = sheet(rng, scale, draw)
    measure = setter.width - 2 * left
    if rng.random() < 0.7:
        line = f"{invented.date(rng)}  14:{int(rng.integers(10, 60))}  ID: {invented.phone(rng)}  PAGE 1"
        setter.text("other", [line], 60, 24, 0.75 * size)
    y = rng.uniform(90, 140)
    if rng.random() < 0.6:
        y = _letterhead(rng, setter, size, left, invented.firm(rng))
    heading = invented.pick(rng, ("FAX", "Fax Message", "FACSIMILE TRANSMITTAL SHEET", "Telefax"))
    y = setter.text("title", [heading], setter.width / 2, y, 1.6 * size, align="centre", bold=True) + size
    sender = invented.person(rng)
    fields = [
        ("receiver", "TO:", invented.person(rng, courtesy=True)),
        ("sender", "FROM:", sender),
        ("receiver", "COMPANY:", invented.firm(rng)),
        ("date", "DATE:", invented.date(rng)),
        ("receiver", "FAX NUMBER:", invented.phone(rng)),
        ("field", invented.pick(rng, ("PAGES:", "NO. OF PAGES:")), str(int(rng.integers(1, 20)))),
        ("sender", "PHONE:", invented.phone(rng)),
        ("subject", "RE:", invented.pick(rng, invented.SUBJECTS)),
    ]
    two_columns, stacked = rng.random() < 0.5, rng.random() < 0.4
    step, room = (3.4 if stacked else 2.0) * size, (0.46 if two_columns else 1.0) * measure
    for number, (label, key, value) in enumerate(fields):
        x = left + (0.52 * measure if two_columns and number % 2 else 0.0)
        lines = [key, value] if stacked else broken(f"{key} {value}", size, room)
        setter.text(label, lines, x, y, size)
        if not two_columns or number % 2:
            y += step + (1.25 * size if two_columns and not stacked else 0.0)
    setter.rule(left, left + measure, y)
    y += size
    if rng.random() < 0.4:
        y = setter.text("other", ["URGENT     FOR REVIEW     PLEASE COMMENT"], left, y, 0.9 * size) + size
    if rng.random() < 0.9:
        y = paragraphs(rng, setter, size, left, measure, y, setter.height - 400)
    if rng.random() < 0.2:
        setter.text("signature", [sender], left, y + 2.4 * size, size, ink_above=2.2 * size)
    if rng.random() < 0.6:
        notice = (
            "The information in this message is confidential and meant only for the person named above. If you "
            "have received it in error, please call us at once and destroy every copy."
        )
        setter.paragraph("footer", notice, left, setter.height - 130, 0.8 * size, measure)
    return setter.page("fax")


def sheet(rng: np.random.Generator, scale: float, draw: bool) -> tuple[ZoneSetter, float, float]:
    """An empty sheet, the size of its print and its left margin."""
    width, high = LETTER_PX if rng.random() < 0.75 else A4_PX
    setter = ZoneSetter(width, high, scale=scale, draw=draw)
    return setter, rng.uniform(20.0, 24.0), rng.uniform(120.0, 190.0)


def set_ending(
    rng: np.random.Generator,
    setter: ZoneSetter,
    size: float,
    left: float,
    inner: float,
    y: float,
    sender: str,
    tail: list[tuple[str, list[str]]],
) -> float:
    """Closing and signature of a letter, at `inner`, and its tail."""
    y = setter.text("closing", [invented.pick(rng, invented.CLOSINGS)], inner, y, size)
    scribble = size * rng.uniform(2.0, 3.2)
    signed = [sender, *([invented.pick(rng, invented.POSITIONS)] if rng.random() < 0.6 else [])]
    y = setter.text("signature", signed, inner, y + scribble + 8, size, ink_above=scribble)
    for label, lines in tail:
        y = setter.text(label, lines, left, y + size * 1.2, size)
    return y


def _letterhead(rng: np.random.Generator, setter: ZoneSetter, size: float, left: float, house: str) -> float:
    centred = rng.random() < 0.6
    x = setter.width / 2 if centred else left
    name = house.upper() if rng.random() < 0.5 else house
    where = [f"{invented.street(rng)}, {invented.town(rng)}"]
    if rng.random() < 0.5:
        where.append(f"Phone {invented.phone(rng)}")
    y = rng.uniform(70.0, 120.0)
    if rng.random() < 0.5:
        # The name and the address stand apart from each other.
        y = setter.text(
            "letterhead", [name], x, y, 1.6 * size, align="centre" if centred else "left", bold=True
        )
        y += 0.3 * size
        y = setter.text("letterhead", where, x, y, 0.8 * size, align="centre" if centred else "left")
    else:
        y = setter.text("letterhead", [name, *where], x, y, size, align="centre" if centred else "left")
    if rng.random() < 0.4:
        setter.rule(left, setter.width - left, y + 0.6 * size)
    return y + size * float(rng.uniform(1.5, 4.0))


def _address(rng: np.random.Generator, receiver: str) -> list[str]:
    lines = [receiver]
    if rng.random() < 0.3:
        lines.append(invented.pick(rng, invented.POSITIONS))
    if rng.random() < 0.6:
        lines.append(invented.firm(rng))
    return [*lines, invented.street(rng), invented.town(rng)]


def _salutation(rng: np.random.Generator, receiver: str) -> str:
    courtesy, first, *_, last = receiver.split()
    end = ":" if rng.random() < 0.6 else ","
    ways = (
        f"Dear {courtesy} {last}", f"Dear {courtesy} {last}", f"Dear {first}", "Dear Sir or Madam",
        "Gentlemen", "To Whom It May Concern",
    )  # fmt: skip
    return invented.pick(rng, ways) + end


def tail_of(rng: np.random.Generator, sender: str) -> list[tuple[str, list[str]]]:
    """What stands below the signature: labels and lines."""
    parts: list[tuple[str, list[str]]] = []
    if rng.random() < 0.45:
        typist = invented.initials(invented.person(rng)).lower()
        own = invented.initials(sender)
        ways = (f"{own}:{typist}", f"{own}/{typist}", f"/{typist}", typist)
        parts.append(("typist-initials", [invented.pick(rng, ways)]))
    if rng.random() < 0.45:
        kinds = (
            "Enclosure",
            "Enclosures (2)",
            "Encl.",
            "Enc.: price list",
            "Enclosures: as stated",
            "Attachment",
        )
        parts.append(("enclosure", [invented.pick(rng, kinds)]))
    if rng.random() < 0.35:
        copies = [f"{invented.pick(rng, ('cc: ', 'CC: ', 'c: '))}{invented.person(rng)}"]
        if rng.random() < 0.4:
            copies.append(f"    {invented.person(rng)}".strip())
        parts.append(("cc", copies))
    if rng.random() < 0.2:
        start = invented.pick(rng, ("P.S. ", "PS: ", "P.S.: "))
        parts.append(("ps", [start + "Please give our greetings to everybody at the branch."]))
    return parts


def paragraphs(
    rng: np.random.Generator,
    setter: ZoneSetter,
    size: float,
    left: float,
    measure: float,
    y: float,
    lowest: float,
    *,
    fill: bool = False,
) -> float:
    """One to five paragraphs of body, the first in any case, the others while they end above `lowest`.

    With `fill` there are as many as have room.
    """
    indent = size * rng.uniform(1.5, 3.0) if rng.random() < 0.3 else 0.0
    justified = rng.random() < 0.3
    gap = size * rng.uniform(0.7, 1.2)
    for number in range(MOST_PARAGRAPHS if fill else int(rng.integers(1, 6))):
        count = int(rng.integers(1, 4 if number else 3))
        text = invented.sentences(rng, invented.LETTER_SENTENCES, count)
        if number and y + height(text, size, measure, indent=indent) > lowest:
            break
        y = setter.paragraph("body", text, left, y, size, measure, indent=indent, justified=justified) + gap
    return y
