"""Simulated over-segmentation of a labelled page: split zones, and additional specks and rules."""

from dataclasses import replace

import numpy as np

from services.layout.page import Page, Zone

_CUT = 0.3
"""Probability of a cut in a zone of two lines. In longer zones each gap is cut less often, but more zones are
cut."""
_SPECKS = 1.5
"""Specks and rules a page, on average."""
_SHARE_OF_SPECKS = 0.6
"""Among these."""
_MOST_ZONES = 500
"""Largest number of zones after cutting; the limit matters for zones with a false number of lines."""
_GAP = 0.1
"""White space on each side of a cut, as a share of the distance of lines."""


def over_segment(
    page: Page,
    rng: np.random.Generator,
) -> Page:
    """The page with some zones of several lines cut between lines, and with specks and rules that have no label."""
    zones: list[Zone] = []
    for index, zone in enumerate(page.zones):
        pieces = _cut(zone, rng)
        fits = len(zones) + len(pieces) + len(page.zones) - index - 1 <= _MOST_ZONES
        zones += pieces if fits else [zone]
    for number in range(int(rng.poisson(_SPECKS))):
        zones.append(_speck(page, f"speck-{number}", rng))
    return replace(page, zones=tuple(zones))


def _cut(zone: Zone, rng: np.random.Generator) -> list[Zone]:
    lines = min(zone.lines or 0, 200)
    if lines < 2 or zone.kind != "text":
        return [zone]
    chance = _CUT / np.sqrt(lines - 1)
    cuts = [line for line in range(1, lines) if rng.random() < chance]
    x0, y0, x1, y1 = zone.box
    pitch = (y1 - y0) / lines
    pieces = []
    for first, last in zip([0, *cuts], [*cuts, lines], strict=True):
        top = y0 + (first + (_GAP if first else 0.0)) * pitch
        bottom = y0 + (last - (_GAP if last < lines else 0.0)) * pitch
        text = _lines_of(zone.text, first, last, lines)
        pieces.append(
            replace(
                zone,
                id=f"{zone.id}.{first}",
                box=(x0, top, x1, bottom),
                lines=last - first,
                text=text,
                content={},
            )
        )
    return pieces if cuts else [zone]


def _lines_of(text: str, first: int, last: int, lines: int) -> str:
    """The text of lines `first` .. `last` - 1; by the number of words where line ends are not known."""
    known = text.split("\n")
    if len(known) == lines:
        return "\n".join(known[first:last])
    words = text.split()
    return " ".join(words[len(words) * first // lines : len(words) * last // lines])


def _speck(page: Page, name: str, rng: np.random.Generator) -> Zone:
    x, y = rng.uniform(0.05, 0.9) * page.width, rng.uniform(0.02, 0.97) * page.height
    if rng.random() < _SHARE_OF_SPECKS:
        width, height = rng.uniform(0.01, 0.03) * page.width, rng.uniform(0.005, 0.02) * page.height
        return Zone(name, (x, y, x + width, y + height), kind="noise")
    width = min(rng.uniform(0.1, 0.7), 0.98 - x / page.width) * page.width
    return Zone(name, (x, y, x + width, y + 0.002 * page.height), kind="rule")
