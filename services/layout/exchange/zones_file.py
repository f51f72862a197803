"""Files of zones in any of three formats: PAGE-XML, ALTO, or the JSON of the HTTP contract."""

import codecs
import json
from collections.abc import Callable

from services.layout.exchange.alto_reading import page_of_alto
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_from_document
from services.layout.exchange.page_xml_reading import page_of_page_xml
from services.layout.exchange.xml_reading import FIELD, read_xml
from services.layout.page import InvalidLayout, Page
from services.notices import Notice

_BYTE_ORDER_MARKS = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def read_zones_file(
    data: bytes,
    limits: ExchangeLimits,
    pixels: tuple[float, float] | None = None,
    warn: Callable[[Notice], None] = lambda notice: None,
) -> Page:
    """Page of a zones file. Its first character and its root element show its format.

    `pixels` are width and height of the page's image where there is one (see `page_of_alto`). `warn` gets a warning for
    each block of an XML file that is left out. Raises `InvalidLayout`.
    """
    if len(data) > limits.max_bytes:
        raise InvalidLayout(f"The file has {len(data)} bytes and may have {limits.max_bytes}.", FIELD)
    start = data[:1000]
    for mark in _BYTE_ORDER_MARKS:
        start = start.removeprefix(mark)
    start = start.replace(b"\0", b"").lstrip()
    if start.startswith(b"<"):
        root = read_xml(data, limits)
        if root.tag == "PcGts":
            return page_of_page_xml(root, limits, warn, pixels)
        if root.tag == "alto":
            return page_of_alto(root, limits, warn, pixels)
        raise InvalidLayout(
            f"The file is XML with the root {str(root.tag)[:60]!a}; send PAGE-XML (PcGts) or ALTO (alto).",
            FIELD,
        )
    if start.startswith((b"{", b"[")):
        return page_from_document(_parse_json(data), limits)
    raise InvalidLayout("The file is neither PAGE-XML nor ALTO nor JSON; send zones in one of them.", FIELD)


def _parse_json(data: bytes) -> object:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        why = "it nests too deep" if isinstance(error, RecursionError) else str(error)
        raise InvalidLayout(f"The file is no JSON: {why}.", FIELD) from error
