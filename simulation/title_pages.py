"""Title pages of three invented publications with the truth of their zones."""

from typing import Literal

import numpy as np

from simulation import invented
from simulation.labelled_zones import LabelledPage, ZoneSetter, height

Journal = Literal["plain", "two-column", "margin"]
A4_PX = (1240, 1754)
BODY_PX = 20.0
"""10 pt at 150 dpi."""


def title_page(
    rng: np.random.Generator, journal: Journal = "plain", *, scale: float = 1.0, draw: bool = True
) -> LabelledPage:
    """The first page of a paper in the layout of one publication, which is its document class.

    `plain`: one column, a header with the volume, dates, abstract, keywords and DOI above the text. `two-column`:
    conference proceedings. `margin`: one column beside a narrow one of notes, dates, DOI and licence.
    """
    setter = ZoneSetter(*A4_PX, scale=scale, draw=draw)
    match journal:
        case "plain":
            _plain(rng, setter)
        case "two-column":
            _two_columns(rng, setter)
        case "margin":
            _margin(rng, setter)
        case _:
            raise ValueError(f"no such publication: {journal}")
    return setter.page(journal)


def _plain(rng: np.random.Generator, setter: ZoneSetter) -> None:
    left, measure, size = 170.0, 900.0, BODY_PX
    volume, year, first = int(rng.integers(1, 60)), int(rng.integers(1990, 2024)), int(rng.integers(1, 800))
    header = f"Annals of Invented Results, vol. {volume}, no. {int(rng.integers(1, 7))}, {year}"
    setter.text("header", [header], left, 80, 0.8 * size)
    y = setter.paragraph(
        "title", invented.title(rng), left, 180 + rng.uniform(0, 30), 2.0 * size, measure, bold=True
    )
    y = setter.paragraph("author", _authors(rng), left, y + size, 1.2 * size, measure)
    y = setter.text("affiliation", _affiliations(rng), left, y + 0.7 * size, 0.9 * size)
    dates = f"Received {invented.date(rng)}; accepted {invented.date(rng)}"
    if rng.random() < 0.8:
        y = setter.text("date", [dates], left, y + 0.7 * size, 0.8 * size)
    if rng.random() < 0.4:
        y = setter.text(
            "correspondence", [f"Corresponding author: {_email(rng)}"], left, y + 0.7 * size, 0.8 * size
        )
    y += rng.uniform(1.2, 2.0) * size
    setter.rule(left, left + measure, y - 0.6 * size)
    abstract = "Abstract. " + invented.sentences(rng, invented.PAPER_SENTENCES, int(rng.integers(3, 7)))
    y = setter.paragraph("abstract", abstract, left + 60, y, 0.9 * size, measure - 120, justified=True)
    if rng.random() < 0.8:
        words = f"Keywords: {_keywords(rng)}"
        y = setter.paragraph("keywords", words, left + 60, y + 0.7 * size, 0.9 * size, measure - 120)
    if rng.random() < 0.7:
        y = setter.text("doi", [f"DOI: {_doi(rng)}"], left + 60, y + 0.7 * size, 0.8 * size)
    y = (
        setter.text("section-title", ["1 Introduction"], left, y + 1.6 * size, 1.3 * size, bold=True)
        + 0.4 * size
    )
    lowest = setter.height - 200.0
    if rng.random() < 0.4:
        lowest -= 70
        note = f"* Supported by {invented.pick(rng, invented.UNIVERSITIES)} under grant {volume}-{first}."
        setter.text("footnote", [note], left, setter.height - 190, 0.75 * size)
        setter.rule(left, left + 200, setter.height - 200)
    if rng.random() < 0.2 and y < lowest - 520:
        y = set_illustration(rng, setter, left, y, measure, size)
    y = set_body(rng, setter, left, y, measure, size, lowest)
    foot = setter.height - 110.0
    if rng.random() < 0.5:
        setter.text(
            "licence", [f"Copyright {year} by the authors. All rights reserved."], left, foot, 0.7 * size
        )
    setter.text("page-number", [str(first)], left + measure, foot, 0.8 * size, align="right")


def _two_columns(rng: np.random.Generator, setter: ZoneSetter) -> None:
    left, gutter, size = 110.0, 45.0, 0.92 * BODY_PX
    column = (setter.width - 2 * left - gutter) / 2
    second, middle = left + column + gutter, setter.width / 2
    if rng.random() < 0.5:
        header = f"Proceedings of the {int(rng.integers(3, 40))}th Conference on Invented Systems"
        setter.text("header", [header], middle, 70, 0.8 * size, align="centre")
    top = 140.0 + rng.uniform(0, 15)
    measure = setter.width - 2 * left
    y = setter.paragraph(
        "title", invented.title(rng), middle, top, 2.2 * size, measure, align="centre", bold=True
    )
    y = setter.paragraph("author", _authors(rng), middle, y + size, 1.3 * size, measure, align="centre")
    y = setter.text("affiliation", _affiliations(rng), middle, y + 0.6 * size, size, align="centre")
    if rng.random() < 0.3:
        y = setter.text("correspondence", [_email(rng)], middle, y + 0.4 * size, size, align="centre")
    top = y + rng.uniform(2.0, 4.0) * size
    lowest = setter.height - 170.0
    y = setter.text("section-title", ["ABSTRACT"], left, top, 1.1 * size, bold=True) + 0.4 * size
    abstract = invented.sentences(rng, invented.PAPER_SENTENCES, int(rng.integers(3, 6)))
    y = setter.paragraph("abstract", abstract, left, y, size, column, justified=True) + 1.2 * size
    if rng.random() < 0.8:
        y = setter.text("section-title", ["Keywords"], left, y, 1.1 * size, bold=True) + 0.4 * size
        y = setter.paragraph("keywords", _keywords(rng), left, y, size, column) + 1.2 * size
    heading = f"1. {invented.pick(rng, invented.SECTIONS)}"
    y = setter.text("section-title", [heading], left, y, 1.1 * size, bold=True) + 0.4 * size
    first_lowest = lowest
    if rng.random() < 0.4:
        first_lowest -= 90
        note = f"Copyright held by the authors. {_doi(rng)}"
        kind = "licence" if rng.random() < 0.5 else "footnote"
        setter.paragraph(kind, note, left, lowest - 50, 0.75 * size, column)
    set_body(rng, setter, left, y, column, size, first_lowest)
    y = top
    if rng.random() < 0.4:
        y = set_illustration(rng, setter, second, y, column, size)
    y = set_body(rng, setter, second, y, column, size, top + 0.5 * (lowest - top))
    heading = f"2. {invented.pick(rng, invented.SECTIONS[1:])}"
    y = setter.text("section-title", [heading], second, y + 0.6 * size, 1.1 * size, bold=True) + 0.4 * size
    set_body(rng, setter, second, y, column, size, lowest)
    setter.text("page-number", ["1"], middle, setter.height - 110, size, align="centre")


def _margin(rng: np.random.Generator, setter: ZoneSetter) -> None:
    aside, left, measure, size = 60.0, 350.0, 800.0, BODY_PX
    note = 0.85 * size
    setter.figure("logo", (50, 40, 330, 130))
    y = 260.0 + rng.uniform(0, 30)
    y = setter.paragraph("title", invented.title(rng), left, y, 1.8 * size, measure, bold=True) + size
    y = setter.paragraph("author", _authors(rng), left, y, 1.2 * size, measure) + 0.8 * size
    y = setter.text("affiliation", _affiliations(rng), left, y, 0.9 * size)
    side = y
    y = setter.text("section-title", ["Summary"], left, y + 2 * size, 1.4 * size, bold=True) + 0.6 * size
    lowest = setter.height - 190.0
    y = set_body(rng, setter, left, y, measure, size, y + rng.uniform(0.3, 0.5) * (lowest - y))
    if rng.random() < 0.3:
        y = set_illustration(rng, setter, left, y, measure, size)
    y = (
        setter.text("section-title", ["Statement of need"], left, y + size, 1.4 * size, bold=True)
        + 0.6 * size
    )
    set_body(rng, setter, left, y, measure, size, lowest)
    doi, author = _doi(rng), invented.pick(rng, invented.LAST_NAMES)
    side = setter.text("doi", [f"DOI: {doi}"], aside, side, note) + note
    links = ["Software", "- Review", "- Repository", "- Archive"]
    side = setter.text("margin-note", links, aside, side, note) + note
    if rng.random() < 0.7:
        side = setter.text("margin-note", ["Editor:", invented.person(rng)], aside, side, note) + note
    if rng.random() < 0.5:
        reviewers = ["Reviewers:", f"- @{invented.pick(rng, invented.LAST_NAMES).lower()}"]
        side = setter.text("margin-note", reviewers, aside, side, note) + note
    dates = [f"Submitted: {invented.date(rng)}", f"Published: {invented.date(rng)}"]
    side = setter.text("date", dates, aside, side, note) + note
    licence = "License Authors keep the copyright and release the work under a Creative Commons licence."
    setter.paragraph("licence", licence, aside, side, note, 260)
    foot = f"{author}, ({int(rng.integers(2010, 2024))}). Journal of Invented Software, 3(2), 41. https://doi.org/{doi}"
    setter.text("footer", [foot], aside + 20, setter.height - 120, 0.75 * size)
    setter.text("page-number", ["1"], setter.width - 90, setter.height - 120, size, align="right")


def set_body(
    rng: np.random.Generator,
    setter: ZoneSetter,
    left: float,
    y: float,
    measure: float,
    size: float,
    lowest: float,
) -> float:
    """Paragraphs of a paper while they end above `lowest`; one in any case, if of one sentence only."""
    for number in range(12):
        text = invented.sentences(rng, invented.PAPER_SENTENCES, int(rng.integers(2, 6)))
        if y + height(text, size, measure) > lowest:
            if number:
                break
            text = invented.sentences(rng, invented.PAPER_SENTENCES, 1)
        y = setter.paragraph("body", text, left, y, size, measure, justified=True) + 0.8 * size
    return y


def set_illustration(
    rng: np.random.Generator, setter: ZoneSetter, left: float, y: float, measure: float, size: float
) -> float:
    """A figure and its caption."""
    tall = rng.uniform(0.25, 0.45) * measure
    setter.figure("figure", (left, y, left + measure, y + tall))
    caption = f"Figure 1: {invented.sentences(rng, invented.PAPER_SENTENCES, 1)}"
    return setter.paragraph("caption", caption, left, y + tall + 0.6 * size, 0.9 * size, measure) + 1.2 * size


def _authors(rng: np.random.Generator) -> str:
    people = [f"{invented.person(rng)}{number + 1}" for number in range(int(rng.integers(1, 6)))]
    return people[0] if len(people) == 1 else f"{', '.join(people[:-1])}, and {people[-1]}"


def _affiliations(rng: np.random.Generator) -> list[str]:
    return [
        f"{number + 1} {invented.pick(rng, invented.DEPARTMENTS)}, {invented.pick(rng, invented.UNIVERSITIES)}, "
        f"{invented.pick(rng, invented.COUNTRIES)}"
        for number in range(int(rng.integers(1, 4)))
    ]


def _keywords(rng: np.random.Generator) -> str:
    chosen = rng.permutation(len(invented.KEYWORDS))[: int(rng.integers(3, 6))]
    return ", ".join(invented.KEYWORDS[int(index)] for index in chosen)


def _doi(rng: np.random.Generator) -> str:
    return f"10.{int(rng.integers(1000, 99999))}/inv.{int(rng.integers(100, 99999)):05d}"


def _email(rng: np.random.Generator) -> str:
    return f"{invented.pick(rng, invented.LAST_NAMES).lower()}@northfield.example.edu"
