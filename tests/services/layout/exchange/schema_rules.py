"""What the schemas of PAGE-XML (2019-07-15) and ALTO (4.4) demand of the elements that we write.

`benchmarks/layout_schemas.py` validates by the schemas themselves; these rules, in words of our own, stand guard
where they are not at hand.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from xml.etree.ElementTree import Element, fromstring

from services.layout.exchange import alto, page_xml

Check = Callable[[str], bool]
NAME = re.compile(r"[A-Za-z_][\w.-]*", re.ASCII)


def matches(pattern: str) -> Check:
    return lambda value: re.fullmatch(pattern, value, re.ASCII) is not None


def one_of(*values: str) -> Check:
    return lambda value: value in values


def anything(_: str) -> bool:
    return True


def is_float(value: str) -> bool:
    return matches(r"-?\d+(\.\d+)?([eE][+-]?\d+)?")(value)


def is_share(value: str) -> bool:
    return is_float(value) and 0.0 <= float(value) <= 1.0


whole, is_name, moment = matches(r"-?\d+"), matches(NAME.pattern), matches(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")
names = matches(rf"{NAME.pattern}( {NAME.pattern})*")


@dataclass(frozen=True)
class Rule:
    """`children` are (names, least, most) in their order; `text` None where only elements are allowed."""

    required: dict[str, Check]
    optional: dict[str, Check]
    children: tuple[tuple[str, int, float], ...] = ()
    text: Check | None = None


MANY = float("inf")
_REGIONS = "TextRegion ImageRegion GraphicRegion SeparatorRegion NoiseRegion TableRegion"
_REGION = {"id": is_name}
_TEXT_TYPES = matches(
    "paragraph|heading|caption|header|footer|page-number|drop-capital|credit|floating|signature-mark|catch-word"
    "|marginalia|footnote|footnote-continued|endnote|TOC-entry|list-label|other"
)
_GRAPHIC_TYPES = matches(
    "logo|letterhead|decoration|frame|handwritten-annotation|stamp|signature|barcode|paper-grow|punch-hole|other"
)
_PLAIN_REGION = Rule(_REGION, {"custom": anything}, (("Coords", 1, 1), (_REGIONS, 0, MANY)))
PAGE_RULES = {
    "PcGts": Rule({}, {}, (("Metadata", 1, 1), ("Page", 1, 1))),
    "Metadata": Rule(
        {}, {}, (("Creator", 1, 1), ("Created", 1, 1), ("LastChange", 1, 1), ("Comments", 0, 1))
    ),
    "Creator": Rule({}, {}, text=anything),
    "Created": Rule({}, {}, text=moment),
    "LastChange": Rule({}, {}, text=moment),
    "Comments": Rule({}, {}, text=anything),
    "Page": Rule(
        {"imageFilename": anything, "imageWidth": whole, "imageHeight": whole},
        {"custom": anything},
        (("ReadingOrder", 0, 1), (_REGIONS, 0, MANY)),
    ),
    "ReadingOrder": Rule({}, {}, (("OrderedGroup", 1, 1),)),
    "OrderedGroup": Rule({"id": is_name}, {}, (("RegionRefIndexed", 1, MANY),)),
    "RegionRefIndexed": Rule({"index": whole, "regionRef": is_name}, {}),
    "TextRegion": Rule(
        _REGION,
        {"custom": anything, "type": _TEXT_TYPES, "align": one_of("left", "centre", "right", "justify")},
        (("Coords", 1, 1), ("Roles", 0, 1), ("TextLine", 0, MANY), ("TextEquiv", 0, MANY)),
    ),
    "TableRegion": Rule(
        _REGION,
        {"custom": anything, "rows": whole, "columns": whole},
        (("Coords", 1, 1), (_REGIONS, 0, MANY)),
    ),
    "Roles": Rule({}, {}, (("TableCellRole", 0, 1),)),
    "TableCellRole": Rule({"rowIndex": whole, "columnIndex": whole}, {}),
    "TextLine": Rule(_REGION, {}, (("Coords", 1, 1), ("Word", 0, MANY), ("TextEquiv", 0, MANY))),
    "Word": Rule(_REGION, {}, (("Coords", 1, 1), ("TextEquiv", 0, MANY))),
    "ImageRegion": _PLAIN_REGION,
    "SeparatorRegion": _PLAIN_REGION,
    "NoiseRegion": _PLAIN_REGION,
    "GraphicRegion": Rule(_REGION, {"custom": anything, "type": _GRAPHIC_TYPES}, _PLAIN_REGION.children),
    "Coords": Rule({"points": matches(r"(\d+,\d+ )+\d+,\d+")}, {}),
    "TextEquiv": Rule({}, {"conf": is_share}, (("Unicode", 1, 1),)),
    "Unicode": Rule({}, {}, text=anything),
}

_PLACE = {name: is_float for name in ("HEIGHT", "WIDTH", "HPOS", "VPOS")}
_BLOCK = {**_PLACE, "STYLEREFS": names, "TAGREFS": names}
_BLOCKS = "TextBlock Illustration GraphicalElement ComposedBlock"
_TAG = Rule({"ID": is_name, "LABEL": anything}, {"TYPE": anything})
ALTO_RULES = {
    "alto": Rule(
        {},
        {"SCHEMAVERSION": one_of("4.4")},
        (("Description", 0, 1), ("Styles", 0, 1), ("Tags", 0, 1), ("ReadingOrder", 0, 1), ("Layout", 1, 1)),
    ),
    "Description": Rule(
        {}, {}, (("MeasurementUnit", 1, 1), ("sourceImageInformation", 0, 1), ("Processing", 0, MANY))
    ),
    "MeasurementUnit": Rule({}, {}, text=one_of("pixel", "mm10", "inch1200")),
    "sourceImageInformation": Rule({}, {}, (("fileName", 0, 1),)),
    "fileName": Rule({}, {}, text=anything),
    "Processing": Rule(
        {"ID": is_name},
        {},
        (
            ("processingCategory", 0, 1),
            ("processingDateTime", 0, 1),
            ("processingStepDescription", 0, MANY),
            ("processingSoftware", 0, 1),
        ),
    ),
    "processingCategory": Rule(
        {},
        {},
        text=one_of("contentGeneration", "contentModification", "preOperation", "postOperation", "other"),
    ),
    "processingDateTime": Rule({}, {}, text=moment),
    "processingStepDescription": Rule({}, {}, text=anything),
    "processingSoftware": Rule({}, {}, (("softwareName", 0, 1),)),
    "softwareName": Rule({}, {}, text=anything),
    "Styles": Rule({}, {}, (("ParagraphStyle", 0, MANY),)),
    "ParagraphStyle": Rule(
        {"ID": is_name}, {"ALIGN": one_of("Left", "Right", "Center", "Block"), "LINESPACE": is_float}
    ),
    "Tags": Rule({}, {}, (("LayoutTag OtherTag", 0, MANY),)),
    "LayoutTag": _TAG,
    "OtherTag": _TAG,
    "ReadingOrder": Rule({}, {}, (("OrderedGroup", 1, MANY),)),
    "OrderedGroup": Rule({"ID": is_name}, {}, (("ElementRef", 1, MANY),)),
    "ElementRef": Rule({"ID": is_name, "REF": names}, {}),
    "Layout": Rule({}, {}, (("Page", 1, MANY),)),
    "Page": Rule(
        {"ID": is_name, "PHYSICAL_IMG_NR": is_float},
        {"WIDTH": is_float, "HEIGHT": is_float, "PROCESSING": is_name, "PAGECLASS": anything},
        (("PrintSpace", 0, 1),),
    ),
    "PrintSpace": Rule({}, {**_PLACE, "ID": is_name}, ((_BLOCKS, 0, MANY),)),
    "TextBlock": Rule({"ID": is_name}, _BLOCK, (("TextLine", 0, MANY),)),
    "Illustration": Rule({"ID": is_name}, {**_BLOCK, "TYPE": anything}),
    "ComposedBlock": Rule({"ID": is_name}, {**_BLOCK, "TYPE": anything}, ((_BLOCKS, 0, MANY),)),
    "GraphicalElement": Rule({"ID": is_name}, _BLOCK),
    "TextLine": Rule({}, _PLACE, (("String SP", 1, MANY),)),
    "String": Rule({"CONTENT": anything}, {**_PLACE, "WC": is_share}),
    "SP": Rule({}, {}),
}


def faults_of_page_xml(data: bytes) -> list[str]:
    return _faults(fromstring(data), page_xml.NAMESPACE, PAGE_RULES, ("id",), ("regionRef",))


def faults_of_alto(data: bytes) -> list[str]:
    root = fromstring(data)
    found = _faults(root, alto.NAMESPACE, ALTO_RULES, ("ID",), ("REF", "TAGREFS", "STYLEREFS", "PROCESSING"))
    for line in root.iter(f"{{{alto.NAMESPACE}}}TextLine"):
        parts = [str(part.tag).rpartition("}")[2] for part in line]
        if not re.fullmatch(r"String( (SP )?String)*( SP)?", " ".join(parts)):
            found.append(f"TextLine: {parts}")
    return found


def _faults(
    root: Element, namespace: str, rules: dict[str, Rule], ids: tuple[str, ...], references: tuple[str, ...]
) -> list[str]:
    """Everything about the document that breaks a rule."""
    found: list[str] = []
    given: list[str] = []
    wanted: list[str] = []
    for element in root.iter():
        space, _, tag = str(element.tag)[1:].partition("}")
        if space != namespace or tag not in rules:
            found.append(f"unknown {element.tag}")
            continue
        rule = rules[tag]
        own = {name: value for name, value in element.attrib.items() if not name.startswith("{")}
        found += [f"{tag}: no {name}" for name in rule.required.keys() - own.keys()]
        checks = {**rule.optional, **rule.required}
        found += [
            f"{tag}: {name}={own[name]!r}" for name in own if not checks.get(name, lambda _: False)(own[name])
        ]
        given += [own[name] for name in ids if name in own]
        wanted += [value for name in references if name in own for value in own[name].split()]
        text = element.text or ""
        if not (rule.text(text) if rule.text else not text.strip()):
            found.append(f"{tag}: text {text!r}")
        found += _order_faults(tag, [str(child.tag).rpartition("}")[2] for child in element], rule)
    found += [f"two of the id {name}" for name in set(given) if given.count(name) > 1]
    return found + [f"nothing of the id {name}" for name in set(wanted) - set(given)]


def _order_faults(tag: str, children: list[str], rule: Rule) -> list[str]:
    at, found = 0, []
    for group, least, most in rule.children:
        start = at
        while at < len(children) and children[at] in group.split():
            at += 1
        if not least <= at - start <= most:
            found.append(f"{tag}: {at - start} of {group}")
    return found + [f"{tag}: {child} out of place" for child in children[at:]]
