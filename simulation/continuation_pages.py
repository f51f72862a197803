"""Pages 2, 3, ... of letters, memos and papers with the truth of their zones, and whole documents of such pages."""

from typing import Literal, get_args

import numpy as np

from simulation import invented
from simulation.correspondence_pages import (
    letter_page,
    memo_page,
    paragraphs,
    set_ending,
    sheet,
    tail_of,
)
from simulation.labelled_zones import LabelledPage, ZoneSetter
from simulation.title_pages import A4_PX, BODY_PX, Journal, set_body, set_illustration, title_page

DocumentKind = Literal["letter", "memo", "plain", "two-column"]
"""Kinds of documents that go on; the last two are papers of these publications."""


def document_pages(
    rng: np.random.Generator, kind: DocumentKind, pages: int, *, scale: float = 1.0, draw: bool = True
) -> list[LabelledPage]:
    """A document of so many pages: its first page, and continuation pages of the class `<kind>-continuation`."""
    if kind not in get_args(DocumentKind) or pages < 1:
        raise ValueError(f"no such document: {kind} of {pages} pages")
    found: list[LabelledPage] = []
    for number in range(1, pages + 1):
        ends = number == pages
        match kind, number:
            case "letter", 1:
                page = letter_page(rng, scale=scale, draw=draw, ends=ends)
            case "memo", 1:
                page = memo_page(rng, scale=scale, draw=draw, ends=ends)
            case "letter", _:
                page = letter_continuation(rng, number, scale=scale, draw=draw, ends=ends)
            case "memo", _:
                page = memo_continuation(rng, number, scale=scale, draw=draw, ends=ends)
            case ("plain" | "two-column") as journal, 1:
                page = title_page(rng, journal, scale=scale, draw=draw)
            case ("plain" | "two-column") as journal, _:
                page = paper_continuation(rng, journal, number, scale=scale, draw=draw)
        found.append(page)
    return found


def letter_continuation(
    rng: np.random.Generator,
    number: int = 2,
    *,
    scale: float = 1.0,
    draw: bool = True,
    ends: bool = True,
) -> LabelledPage:
    """A later page of a letter: addressee, date and page number at the head, body, and the end of the letter.

    Labels: header (all three in one block), or receiver page-number date across the page; body closing signature
    typist-initials enclosure cc ps.
    """
    setter, size, left = sheet(rng, scale, draw)
    measure = setter.width - 2 * left
    receiver, day = invented.person(rng, courtesy=True), invented.date(rng)
    y = rng.uniform(90.0, 130.0)
    if rng.random() < 0.55:
        page = f"{invented.pick(rng, ('Page ', 'page ', 'Page No. '))}{number}"
        order = [receiver, day, page] if rng.random() < 0.6 else [receiver, page, day]
        y = setter.text("header", order, left, y, size)
    else:
        setter.text("receiver", [receiver], left, y, size)
        mark = invented.pick(rng, ("- {} -", "{}", "-{}-")).format(number)
        setter.text("page-number", [mark], setter.width / 2, y, size, align="centre")
        y = setter.text("date", [day], left + measure, y, size, align="right")
    y += size * rng.uniform(1.5, 3.0)
    if not ends:
        paragraphs(rng, setter, size, left, measure, y, setter.height - 150, fill=True)
        return setter.page("letter-continuation")
    inner = left + measure * rng.uniform(0.45, 0.6) if rng.random() < 0.4 else left
    sender = invented.person(rng)
    tail = tail_of(rng, sender)
    room = setter.height - 170 - size * (11 + sum(1.25 * len(lines) + 1.2 for _, lines in tail))
    y = paragraphs(rng, setter, size, left, measure, y, room)
    set_ending(rng, setter, size, left, inner, y, sender, tail)
    return setter.page("letter-continuation")


def memo_continuation(
    rng: np.random.Generator,
    number: int = 2,
    *,
    scale: float = 1.0,
    draw: bool = True,
    ends: bool = True,
) -> LabelledPage:
    """A later page of a memo: what it is about and the page number at the head, body.

    Labels: subject page-number body signature typist-initials enclosure cc.
    """
    setter, size, left = sheet(rng, scale, draw)
    measure = setter.width - 2 * left
    y = rng.uniform(80.0, 120.0)
    heading = (
        f"{invented.pick(rng, ('Memo', 'Memorandum', 'MEMORANDUM'))}: {invented.pick(rng, invented.SUBJECTS)}"
    )
    setter.text("subject", [heading], left, y, 0.9 * size)
    foot = rng.random() < 0.4
    at = (setter.width / 2, setter.height - 90.0) if foot else (left + measure, y)
    setter.text("page-number", [str(number)], *at, 0.9 * size, align="centre" if foot else "right")
    y += 1.6 * size
    if rng.random() < 0.5:
        setter.rule(left, left + measure, y)
    y += 1.2 * size
    if not ends:
        paragraphs(rng, setter, size, left, measure, y, setter.height - 170, fill=True)
        return setter.page("memo-continuation")
    sender = invented.person(rng)
    tail = [part for part in tail_of(rng, sender) if part[0] != "ps"]
    room = setter.height - 170 - size * (8 + sum(1.25 * len(lines) + 1.2 for _, lines in tail))
    y = paragraphs(rng, setter, size, left, measure, y, room)
    if rng.random() < 0.25:
        scribble = 2.2 * size
        y = setter.text("signature", [sender], left, y + scribble, size, ink_above=scribble)
    for label, lines in tail:
        y = setter.text(label, lines, left, y + size * 1.2, size)
    return setter.page("memo-continuation")


def paper_continuation(
    rng: np.random.Generator,
    journal: Journal = "plain",
    number: int = 2,
    *,
    scale: float = 1.0,
    draw: bool = True,
) -> LabelledPage:
    """A later page of a paper: a running head, body in the publication's columns, now and then a figure.

    Labels: header page-number section-title body figure caption.
    """
    if journal not in ("plain", "two-column"):
        raise ValueError(f"no such publication goes on: {journal}")
    setter = ZoneSetter(*A4_PX, scale=scale, draw=draw)
    narrow = journal == "two-column"
    size = 0.92 * BODY_PX if narrow else BODY_PX
    left, gutter = (110.0, 45.0) if narrow else (170.0, 0.0)
    measure = setter.width - 2 * left
    column = (measure - gutter) / 2 if narrow else measure
    running = f"{invented.pick(rng, invented.LAST_NAMES)} et al.: {invented.title(rng)}"
    setter.text("header", [running], left, 80, 0.8 * size)
    if narrow:
        setter.text("page-number", [str(number)], setter.width / 2, setter.height - 110, size, align="centre")
    else:
        setter.text("page-number", [str(number)], left + measure, 80, 0.8 * size, align="right")
    for start in (left, left + column + gutter) if narrow else (left,):
        _set_column(rng, setter, start, column, size, setter.height - 170.0)
    return setter.page(f"{journal}-continuation")


def _set_column(
    rng: np.random.Generator, setter: ZoneSetter, left: float, measure: float, size: float, lowest: float
) -> None:
    y = 140.0
    if rng.random() < 0.4:
        y = set_illustration(rng, setter, left, y, measure, size)
    if rng.random() < 0.7:
        y = set_body(rng, setter, left, y, measure, size, y + rng.uniform(0.2, 0.6) * (lowest - y))
        heading = f"{int(rng.integers(2, 7))}. {invented.pick(rng, invented.SECTIONS[1:])}"
        y = setter.text("section-title", [heading], left, y + 0.6 * size, 1.1 * size, bold=True) + 0.4 * size
    set_body(rng, setter, left, y, measure, size, lowest)
