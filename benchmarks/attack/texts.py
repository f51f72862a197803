"""JSON and XML that cost or lie."""

import json
from typing import Any


def zones(**changes: Any) -> str:
    """A page of one zone, as JSON."""
    zone = {"id": "z1", "box": [1, 2, 9, 8]}
    return json.dumps({"width": 20, "height": 30, "zones": [zone], **changes})


def many_zones(count: int = 5000) -> str:
    """A page of many zones."""
    return zones(zones=[{"id": f"z{number}", "box": [1, 2, 9, 8]} for number in range(count)])


def nested(depth: int = 100_000) -> str:
    """Lists within lists."""
    return '{"zones": ' + "[" * depth + "]" * depth + "}"


def long_number(digits: int = 60_000) -> str:
    """A number of many digits; converting it takes quadratic time."""
    return zones().replace("20", "1" * digits, 1)


def laughs() -> bytes:
    """Entities of entities: a billion words."""
    entities = "".join(f'<!ENTITY e{n + 1} "{f"&e{n};" * 10}">' for n in range(9))
    return f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY e0 "ha">{entities}]><PcGts>&e9;</PcGts>'.encode()


def quadratic() -> bytes:
    """One long entity, used often."""
    return f'<!DOCTYPE x [<!ENTITY a "{"a" * 50_000}">]><PcGts>{"&a;" * 50_000}</PcGts>'.encode()


def external(address: str) -> bytes:
    """An entity that is a file or an address."""
    return f'<!DOCTYPE x [<!ENTITY a SYSTEM "{address}">]><PcGts>&a;</PcGts>'.encode()


def deep_xml(depth: int = 200_000) -> bytes:
    """Elements within elements."""
    return b"<PcGts>" + b"<a>" * depth + b"</a>" * depth + b"</PcGts>"


def many_attributes(count: int = 100_000) -> bytes:
    """An element of many attributes."""
    return b"<PcGts " + b" ".join(b'a%d=""' % number for number in range(count)) + b"/>"
