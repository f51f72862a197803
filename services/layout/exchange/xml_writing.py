"""Writing PAGE-XML and ALTO: names that are ids, text that XML can hold, whole documents."""

import re
from collections.abc import Sequence
from itertools import groupby
from xml.etree.ElementTree import Element, indent, tostring

from services.layout.page import Box, Zone, ZoneWord
from services.layout.recognition.results import Recognition, RecognizedZone

SOFTWARE = "document-rectification"
XSI = "http://www.w3.org/2001/XMLSchema-instance"

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9._-]*")
"""NCName (Namespaces in XML 1.0) within ASCII, so that no reader is surprised."""
_NO_XML = re.compile("[^\t\n\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""All but the production Char of XML 1.0; carriage returns are made line ends before."""


class Names:
    """Ids of one document, each given once."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def give(self, wanted: str) -> str:
        """`wanted` where it is a free name of XML, else the like."""
        name = wanted if _NAME.fullmatch(wanted) else "z-" + re.sub(r"[^A-Za-z0-9._-]", "-", wanted)
        free, number = name, 2
        while free in self._taken:
            free, number = f"{name}-{number}", number + 1
        self._taken.add(free)
        return free


def clean(text: str) -> str:
    """`text` without what XML cannot hold."""
    return _NO_XML.sub("", text.replace("\r\n", "\n").replace("\r", "\n"))


def ordered(recognition: Recognition) -> list[RecognizedZone]:
    """The zones in reading order."""
    return sorted(recognition.zones, key=lambda zone: zone.order)


def zone_lines(zone: Zone) -> list[list[ZoneWord]]:
    """The words of a zone by their lines."""
    return [list(words) for _, words in groupby(zone.words, key=lambda word: word.line)]


def union_box(words: Sequence[ZoneWord]) -> Box:
    """The box round one word or more."""
    x0, y0, x1, y1 = zip(*(word.box for word in words), strict=True)
    return min(x0), min(y0), max(x1), max(y1)


def document(root: Element) -> bytes:
    """The document in UTF-8, indented."""
    indent(root, " ")
    return bytes(tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"


def decimal(value: float) -> str:
    """A number as `xsd:float`, to 8 digits: a hundredth of a pixel on every page."""
    return f"{value:.8g}"


def turned_note(turned_deg: int) -> str:
    """A sentence for people, since neither PAGE-XML nor ALTO has a place for it."""
    return f"Coordinates are pixels of the image turned clockwise by {turned_deg} degrees."
