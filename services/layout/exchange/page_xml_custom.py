"""The attribute `custom` of PAGE-XML: groups of properties, `structure {type:date; score:0.9;} zone {...}`."""

import re
from collections.abc import Mapping

from services.layout.exchange.xml_writing import clean

_CUSTOM_GROUP = re.compile(r"(?<![\w-])([\w-]+)\s*\{([^{}]*)\}")
_LONGEST_CUSTOM = 10_000
_TO_ESCAPE = re.compile(r"[\\{}:;,\s]")
_ESCAPED = re.compile(r"\\u([0-9a-fA-F]{4})")


def write_custom(groups: Mapping[str, Mapping[str, str]]) -> str:
    return " ".join(
        f"{name} {{" + " ".join(f"{key}:{_escape(value)};" for key, value in properties.items()) + "}"
        for name, properties in groups.items()
        if properties or name == "zone"
    )


def read_custom(custom: str) -> dict[str, dict[str, str]]:
    """`name {key:value; ...} ...`; of groups of one name the last counts."""
    groups: dict[str, dict[str, str]] = {}
    for match in _CUSTOM_GROUP.finditer(custom[:_LONGEST_CUSTOM]):
        pairs = (part.partition(":") for part in match[2].split(";"))
        groups[match[1]] = {key.strip(): _unescape(value.strip()) for key, found, value in pairs if found}
    return groups


def _escape(value: str) -> str:
    return _TO_ESCAPE.sub(lambda match: f"\\u{ord(match[0]):04x}", clean(value))


def _unescape(value: str) -> str:
    return _ESCAPED.sub(lambda match: chr(int(match[1], 16)), value)
