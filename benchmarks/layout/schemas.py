"""Whether what recognition writes as PAGE-XML and ALTO is valid by the schemas themselves.

python -m benchmarks layout_schemas --page pagecontent.xsd --alto alto-4-4.xsd

The schemas are not ours to bring along: PAGE's is in github.com/PRImA-Research-Lab/PAGE-XML (2019-07-15), ALTO's
in github.com/altoxml/schema (v4/alto-4-4.xsd; its import of xlink.xsd must lead to a file).
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime

from lxml import etree

from benchmarks.layout.truth import SETS, load_set
from services.layout.exchange.alto import write_alto
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_xml import write_page_xml
from services.layout.exchange.zones_file import read_zones_file
from services.layout.page import ALIGNMENTS, KINDS, Page, Zone
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone

_AWKWARD_NAMES = ("z1", "1", "z-1", "page", "reading-order", "a b", "ß;}{:,\\", "<&\"'>", "😀")
_AWKWARD_TEXT = ("", "a\r\nb\tc", "\x00\x1f]]>&lt;", "\ufffe", "  ", "один 二")


def recognitions(data: str | None) -> Iterator[Recognition]:
    """Every page of the truth as if it were recognized, an empty page, and one of awkward zones."""
    now = ClassMatch("letter", 1, 1.0, 0.98765)
    for name in SETS:
        for labelled in load_set(name, data):
            yield _recognized(labelled.page, ClassMatch(labelled.class_name, 1, 1.0, 0.5))
    yield _recognized(Page(10, 10, ()), None)
    yield _recognized(
        Page(
            1000.5,
            0.75,
            tuple(
                Zone(
                    id=name,
                    box=(0.25 * index, 0.1, 0.25 * index + 1000 * (index % 2) + 1e-3, 0.7),
                    kind=KINDS[index % len(KINDS)],
                    lines=index or None,
                    font_size=1e-6 * 10**index,
                    line_spacing=1e5 / (index + 1),
                    weight=0.123456789,
                    alignment=ALIGNMENTS[index // 2 % len(ALIGNMENTS)],
                    text=_AWKWARD_TEXT[index % len(_AWKWARD_TEXT)],
                    label=None if index == 0 else name,
                )
                for index, name in enumerate(_AWKWARD_NAMES)
            ),
        ),
        now,
    )


def _recognized(page: Page, chosen: ClassMatch | None) -> Recognition:
    zones = tuple(
        RecognizedZone(zone, zone.label, 1 / 3, zone.label, at) for at, zone in enumerate(page.zones)
    )
    return Recognition(page, zones, chosen)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write every page in every format and print which files are not valid."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks layout_schemas", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--page", help="pagecontent.xsd of PAGE-XML 2019-07-15")
    parser.add_argument("--alto", help="alto-4-4.xsd")
    parser.add_argument("--data", help="folder of the shared data")
    options = parser.parse_args(arguments)
    limits, created = ExchangeLimits(), datetime.now(UTC)
    asked: list[tuple[str, str, Callable[..., bytes]]] = [
        (name, path, write)
        for name, path, write in (
            ("PAGE-XML", options.page, write_page_xml),
            ("ALTO", options.alto, write_alto),
        )
        if path
    ]
    if not asked:
        parser.error("give --page or --alto")
    good = True
    for name, path, write in asked:
        schema = etree.XMLSchema(etree.parse(path))
        pages = invalid = changed = 0
        for recognition in recognitions(options.data):
            written = write(recognition, "page.png", created)
            pages += 1
            back = read_zones_file(written, limits)
            told = [(zone.id, zone.label, zone.kind) for zone in recognition.page.zones]
            changed += told != [(zone.id, zone.label, zone.kind) for zone in back.zones]
            if not schema.validate(etree.fromstring(written)):
                invalid += 1
                print(schema.error_log.last_error)
        print(f"{name}: {pages} documents, {invalid} invalid, {changed} do not read back")
        good &= not invalid and not changed
    return 0 if good else 1
