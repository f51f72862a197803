"""Safe parsing of XML from clients: no DOCTYPE, no declared entities, no network access, bounded size."""

import math
from collections.abc import Iterable, Iterator
from operator import sub
from statistics import median
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from services.layout.exchange.limits import ExchangeLimits
from services.layout.graph.font_sizes import LINE_HEIGHT
from services.layout.page import InvalidLayout

FIELD = "zones_file"
"""The field of the request that a file comes in."""


def read_xml(data: bytes, limits: ExchangeLimits) -> Element:
    """The root of the document; names of elements without their namespaces, attributes that have none.

    Raises `InvalidLayout` for what is not well-formed, has a DOCTYPE (and so could declare entities) or crosses a
    limit.
    """
    if len(data) > limits.max_bytes:
        raise InvalidLayout(
            f"The file has {len(data)} bytes and may have {limits.max_bytes}; leave words and glyphs away.",
            FIELD,
        )
    tree = _Tree(limits)
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = tree.doctype
    parser.StartElementHandler = tree.start
    parser.EndElementHandler = tree.end
    parser.CharacterDataHandler = tree.data
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        if isinstance(error, InvalidLayout):
            raise
        # LookupError and ValueError: an encoding that Python does not know, or has no table of.
        raise InvalidLayout(f"The file is no well-formed XML: {error}.", FIELD) from error
    return tree.builder.close()


class _Tree:
    """A target of the XML parser that builds a tree and counts its elements."""

    def __init__(self, limits: ExchangeLimits) -> None:
        self.builder = TreeBuilder()
        self._limits = limits
        self._depth = 0
        self._elements = 0

    def doctype(self, *_: object) -> None:
        raise InvalidLayout("The file has a DOCTYPE, which is not read; remove it.", FIELD)

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._elements += 1
        if self._depth > self._limits.max_depth:
            raise InvalidLayout(f"The file nests elements deeper than {self._limits.max_depth}.", FIELD)
        if self._elements > self._limits.max_elements:
            raise InvalidLayout(
                f"The file has more than {self._limits.max_elements} elements; leave words and glyphs away.",
                FIELD,
            )
        self.builder.start(_local(name), {key: value for key, value in attributes.items() if " " not in key})

    def end(self, name: str) -> None:
        self._depth -= 1
        self.builder.end(_local(name))

    def data(self, text: str) -> None:
        self.builder.data(text)


def _local(name: str) -> str:
    return name.rpartition(" ")[2]


def children(element: Element, *names: str) -> Iterator[Element]:
    """The children of these names, in document order."""
    return (child for child in element if child.tag in names)


def number(value: str | None) -> float | None:
    """A finite number of an attribute; None when there is none."""
    try:
        found = float(value or "")
    except ValueError:
        return None
    return found if math.isfinite(found) else None


def polygon_box(points: str) -> list[float] | None:
    """Bounding box of `x,y x,y ...` (also `x y x y ...`, which ALTO allows); None when it is no such list.

    A polygon without an extent, such as a line, is 1 pixel wide.
    """
    values = [number(value) for value in points.replace(",", " ").split()]
    known = [value for value in values if value is not None]
    if len(known) < 4 or len(known) % 2 or len(known) != len(values):
        return None
    return box_of(known[0::2], known[1::2])


def box_of(x: list[float], y: list[float]) -> list[float]:
    """Bounding box of the points, at least 1 pixel wide and high."""
    x0, y0 = min(x), min(y)
    return [x0, y0, max(*x, x0 + 1.0), max(*y, y0 + 1.0)]


def in_reading_order(zones: list[Element], id_name: str, order: list[str]) -> list[int]:
    """Indices of `zones` as `order` names them, or parts of them, by their ids; what it does not name follows."""
    index: dict[str, int] = {}
    for at, zone in enumerate(zones):
        for part in zone.iter():
            index.setdefault(part.get(id_name, ""), at)  # of equal ids the first is meant
    named = list(dict.fromkeys(index[name] for name in order if name in index))
    return named + sorted(set(range(len(zones))) - set(named))


def hull_of(boxes: Iterable[list[float] | None]) -> list[float] | None:
    """The box round those boxes that are known; None without one."""
    known = [box for box in boxes if box is not None]
    if not known:
        return None
    return box_of([x for box in known for x in box[0::2]], [y for box in known for y in box[1::2]])


def measure_lines(boxes: list[list[float] | None]) -> tuple[float | None, float | None]:
    """Font size and line spacing, in the units of the boxes of a zone's lines; None where too few are known."""
    known = [box for box in boxes if box is not None and box[3] - box[1] > 1.0]
    if not known:
        return None, None
    size = median(box[3] - box[1] for box in known) / LINE_HEIGHT
    middles = sorted((box[1] + box[3]) / 2 for box in known)
    steps = [step for step in map(sub, middles[1:], middles) if step > size / 2]  # else parts of one line
    return size, median(steps) if steps else None
