"""Zones that a person has drawn over found ones: what was measured of the found zones passes on to them."""

from collections.abc import Sequence
from dataclasses import replace

from services.contract.boxes import are_one_place, area, common_area, holds_middle
from services.layout.page import Box, Page, Zone, ZoneWord

_COVERED = 0.5
"""Least share of a line's width within the drawn zone."""


def revise_zones(page: Page, drawn: Page) -> Page:
    """The drawn zones, with the properties of the found zones that they cover.

    A drawn zone at the place of a found one has all its properties. Other zones take means of font size, line spacing
    and stroke weight over the found zones, weighted by area, and the words that lie in them; of found zones whose words
    are not known, the lines. What the person gave (text, kind, and so on) has priority.

    Parameters
    ----------
    page
        The page with its found zones.
    drawn
        The page with the person's zones and labels.
    """
    return replace(drawn, zones=tuple(_revised(zone, page) for zone in drawn.zones))


def zone_at(box: Sequence[float], found: Sequence[Zone]) -> Zone | None:
    """The found zone whose place a box has; None where it has that of none."""
    return next((zone for zone in found if are_one_place(zone.box, box)), None)


def is_text_known(page: Page, box: Box) -> bool:
    """Whether the zones of a page say what is read in a box: not where they have a text and its words have no place."""
    under = [zone for zone in page.zones if zone.text and common_area(zone.box, box) > 0]
    if not under or zone_at(box, page.zones) is not None:
        return True
    return any(zone.words or any(_lines_within(zone, box)) for zone in under)


def _revised(drawn: Zone, page: Page) -> Zone:
    under = [(zone, common) for zone in page.zones if (common := common_area(zone.box, drawn.box)) > 0]
    same = zone_at(drawn.box, page.zones)
    if same is not None:
        return _with_given(replace(same, id=drawn.id, label=drawn.label), drawn)
    if not under:
        rows = _rows_within(page.loose, drawn.box)
        return _with_given(replace(drawn, text=_text(rows), words=_words(rows)), drawn)
    nearest = max(under, key=lambda each: each[1] / (area(each[0].box) + area(drawn.box) - each[1]))[0]
    rows = [row for zone, _ in under for row in _rows_within(zone.words, drawn.box)]
    lines = [line for zone, _ in under if not zone.words for line in _lines_within(zone, drawn.box)]
    if not rows and not any(lines):
        rows = _rows_within(page.loose, drawn.box)
    printed = sum(len(_lines_within(zone, drawn.box)) for zone, _ in under)
    texts = [*filter(None, (_text(rows), *lines))]
    measured = Zone(
        id=drawn.id,
        box=drawn.box,
        kind="text" if rows else nearest.kind,
        lines=max(printed, len(rows) + len(lines)) or None,
        font_size=_mean(under, "font_size"),
        line_spacing=_mean(under, "line_spacing"),
        weight=_mean(under, "weight"),
        alignment=nearest.alignment if len(under) == 1 else None,
        appearance=nearest.appearance if len(under) == 1 else None,
        text="\n".join(texts),
        label=drawn.label,
        words=() if lines else _words(rows),
    )
    return _with_given(measured, drawn)


def _with_given(measured: Zone, drawn: Zone) -> Zone:
    """The measured zone with everything that the person gave; another text has other features and no read words."""
    given = {
        name: getattr(drawn, name)
        for name in ("lines", "font_size", "line_spacing", "weight", "alignment", "appearance")
        if getattr(drawn, name) is not None
    }
    if drawn.kind != "text":
        given["kind"] = drawn.kind
    if drawn.text and drawn.text != measured.text:
        given |= {"text": drawn.text, "content": {}, "words": ()}
    return replace(measured, **given)


def _rows_within(words: Sequence[ZoneWord], box: Box) -> list[list[ZoneWord]]:
    """The words whose centres lie in a box, by rows; a value in a line is a part of the zone."""
    rows: dict[int, list[ZoneWord]] = {}
    for word in words:
        if holds_middle(box, word.box):
            rows.setdefault(word.line, []).append(word)
    return list(rows.values())


def _text(rows: Sequence[Sequence[ZoneWord]]) -> str:
    return "\n".join(" ".join(word.text for word in row) for row in rows)


def _words(rows: Sequence[Sequence[ZoneWord]]) -> tuple[ZoneWord, ...]:
    return tuple(replace(word, line=number) for number, row in enumerate(rows) for word in row)


def _lines_within(zone: Zone, box: Box) -> list[str]:
    """The lines of a found zone whose middle lies in a box; the zone's height is divided among its lines equally."""
    x0, y0, x1, y1 = zone.box
    if min(x1, box[2]) - max(x0, box[0]) < _COVERED * (x1 - x0):
        return []
    texts = zone.text.split("\n") if zone.text else []
    count = zone.lines or len(texts) or 1
    if (
        len(texts) != count
    ):  # the text is not divided into the zone's lines: it goes with the middle of the zone
        texts = ["" for _ in range(count)]
        texts[(count - 1) // 2] = zone.text
    middles = [y0 + (y1 - y0) * (line + 0.5) / count for line in range(count)]
    return [text for text, middle in zip(texts, middles, strict=True) if box[1] <= middle < box[3]]


def _mean(under: Sequence[tuple[Zone, float]], name: str) -> float | None:
    """Mean of a property over the found zones that have it, weighted by common area."""
    known = [(getattr(zone, name), common) for zone, common in under if getattr(zone, name) is not None]
    return (
        sum(value * common for value, common in known) / sum(common for _, common in known) if known else None
    )
