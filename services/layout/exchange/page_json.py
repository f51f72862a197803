"""Zones JSON of the HTTP contract, used in the request field `zones`, in samples, and in answers of /layout.

`{"width", "height", "zones": [{"id", "box": [x0, y0, x1, y1], "label"?, "kind"?, "lines"?, "font_size"?,
"line_spacing"?, "weight"?, "alignment"?, "appearance"?, "text"?, "content"?, "pieces"?, "printed"?}]}`; other keys are
passed over. `printed` are the words that OCR read, `[text, x0, y0, x1, y1, confidence, line]` each: what stored pages
keep, as they keep words in no zone as `loose` beside the zones. Where it is no such list, it is passed over too.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, fields, replace
from itertools import count
from typing import Any, NotRequired, TypedDict, cast

from services.contract.page_json import PageJson, ZoneJson
from services.layout.exchange.limits import ExchangeLimits
from services.layout.page import (
    ALIGNMENTS,
    KINDS,
    Alignment,
    Box,
    InkAppearance,
    InvalidLayout,
    Kind,
    Page,
    Zone,
    ZoneWord,
    is_finite_number,
)
from services.notices import Notice

_MOST_LINES = 100_000
"""As many as the page may have pixels."""
_MOST_WORDS = 5000
_LONGEST_WORD = 1000
_LARGEST_APPEARANCE = 1e6
"""All of it are shares and ratios."""
_EXAMPLE = '{"width": 2480, "height": 3508, "zones": [{"id": "z1", "box": [300, 412, 1180, 655]}]}'


class BlockJson(TypedDict):
    """A zone as another program has described it; values may be missing, and wrong."""

    id: str
    box: list[float] | None
    kind: str
    label: str | None
    lines: int | None
    font_size: float | None
    text: str
    line_spacing: NotRequired[float | None]
    alignment: NotRequired[str | None]
    weight: NotRequired[float | None]


def page_from_document(document: Any, limits: ExchangeLimits) -> Page:
    """The page that `document`, a JSON value, describes; its zones are in the given order.

    Ids may be strings or whole numbers and are kept as strings. A size of 0 means that it was not measured. Boxes
    are clipped to the page. A page without zones is one; whoever needs zones says so.
    Raises `InvalidLayout`, with the field, for everything else.
    """
    if not isinstance(document, dict):
        raise InvalidLayout(f"The zones must be an object of JSON, such as {_EXAMPLE}.", "zones")
    width, height = (_page_side(document, name, limits) for name in ("width", "height"))
    given = document.get("zones")
    if not isinstance(given, list):
        raise InvalidLayout(f"Send the page's zones as a list, such as {_EXAMPLE}.", "zones")
    check_count(len(given), limits)
    zones = tuple(_zone(zone, f"zones[{index}]", width, height, limits) for index, zone in enumerate(given))
    seen: dict[str, int] = {}
    for index, zone in enumerate(zones):
        first = seen.setdefault(zone.id, index)
        if first != index:
            raise InvalidLayout(
                f"The id {_shown(zone.id)} is that of zones[{first}] already; give every zone an id of its own.",
                f"zones[{index}].id",
            )
    return Page(width, height, zones, _printed(document.get("loose")))


def page_of_blocks(
    size: tuple[float | None, float | None],
    blocks: Sequence[BlockJson],
    limits: ExchangeLimits,
    warn: Callable[[Notice], None],
) -> tuple[Page, list[int]]:
    """The page of what another program has described, and the places of the blocks that its zones come from.

    A block that cannot be read is left out, with a warning that names it; of blocks with one id the later ones get
    another one. Raises `InvalidLayout` for the page's size, for too many blocks, and where no block can be read.
    """
    check_count(len(blocks), limits)
    sides = dict(zip(("width", "height"), size, strict=True))
    width, height = (_page_side(sides, name, limits) for name in sides)
    zones: list[Zone] = []
    places: list[int] = []
    refusal: InvalidLayout | None = None
    taken: set[str] = set()
    for place, block in enumerate(blocks):
        try:
            zone = _zone(block, f"zones[{place}]", width, height, limits)
        except InvalidLayout as error:
            refusal = refusal or error
            warn(Notice("block-left-out", f"Block {_shown(block.get('id'))} was left out: {error.detail}"))
            continue
        if zone.id in taken:
            free = (f"{zone.id[: limits.max_id_length - 8]}-{n}" for n in count(2))
            zone = replace(zone, id=next(name for name in free if name not in taken))
        taken.add(zone.id)
        zones.append(zone)
        places.append(place)
    if refusal is not None and not zones:
        raise refusal
    return Page(width, height, tuple(zones)), places


def check_count(zones: int, limits: ExchangeLimits) -> None:
    """Raises `InvalidLayout` for more zones than a page may have."""
    if zones > limits.max_zones:
        raise InvalidLayout(
            f"The page has {zones} zones and may have {limits.max_zones}; send zones at paragraph level.",
            "zones",
        )


def page_to_document(page: Page) -> PageJson:
    """The page as a JSON document. Values that were not measured are left out; an unknown label is null."""
    document: PageJson = {
        "width": plain_number(page.width),
        "height": plain_number(page.height),
        "zones": [_zone_document(zone) for zone in page.zones],
    }
    if page.loose:
        document["loose"] = _words_document(page.loose)
    return document


def _zone_document(zone: Zone) -> ZoneJson:
    names = ("lines", "font_size", "line_spacing", "weight", "alignment")
    measured = {name: value for name in names if (value := getattr(zone, name)) is not None}
    box = [plain_number(value) for value in zone.box]
    document = cast(ZoneJson, {"id": zone.id, "box": box, "label": zone.label, "kind": zone.kind, **measured})
    if zone.appearance is not None:
        document["appearance"] = asdict(zone.appearance)
    if zone.pieces:
        document["pieces"] = [[plain_number(value) for value in box] for box in zone.pieces]
    if zone.text:
        document["text"] = zone.text
    if zone.content:
        document["content"] = dict(zone.content)
    if zone.words:
        document["printed"] = _words_document(zone.words)
    return document


def _words_document(words: Sequence[ZoneWord]) -> list[list[str | float]]:
    return [[word.text, *map(round, word.box), round(word.confidence, 3), word.line] for word in words]


def plain_number(value: float) -> float:
    """Whole numbers without their fraction, as clients send them and expect them of an image's size."""
    return int(value) if float(value).is_integer() else float(value)


def _page_side(document: dict[Any, Any], name: str, limits: ExchangeLimits) -> float:
    if name not in document:
        raise InvalidLayout(
            f"Say the page's {name} in pixels of the image that the boxes are measured on.", name
        )
    value = document[name]
    if not is_finite_number(value) or not 0 < value <= limits.max_side:
        raise InvalidLayout(
            f"The page's {name} is {_shown(value)}; give pixels, more than 0 and at most {limits.max_side:g}.",
            name,
        )
    return float(value)


def _zone(given: Any, field: str, width: float, height: float, limits: ExchangeLimits) -> Zone:
    if not isinstance(given, dict):
        raise InvalidLayout(
            f'{field} must be an object such as {{"id": "z1", "box": [300, 412, 1180, 655]}}.', field
        )
    return Zone(
        id=_id(given, field, limits),
        box=_box(given.get("box"), f"{field}.box", width, height),
        kind=cast(Kind, _choice(given.get("kind"), f"{field}.kind", KINDS) or "text"),
        lines=_lines(given.get("lines"), f"{field}.lines"),
        font_size=_measure(given.get("font_size"), f"{field}.font_size", limits),
        line_spacing=_measure(given.get("line_spacing"), f"{field}.line_spacing", limits),
        weight=_measure(given.get("weight"), f"{field}.weight", limits),
        alignment=cast(Alignment | None, _choice(given.get("alignment"), f"{field}.alignment", ALIGNMENTS)),
        appearance=_appearance(given.get("appearance"), f"{field}.appearance"),
        text=_text(given.get("text"), f"{field}.text", limits),
        content=_content(given.get("content"), f"{field}.content", limits),
        label=_label(given.get("label"), f"{field}.label", limits),
        pieces=_pieces(given.get("pieces"), f"{field}.pieces", width, height, limits),
        words=_printed(given.get("printed")),
    )


def _printed(value: Any) -> tuple[ZoneWord, ...]:
    """The words of a zone; none where one of them is no word."""
    if not isinstance(value, list) or len(value) > _MOST_WORDS:
        return ()
    words = []
    for each in value:
        if not isinstance(each, list) or len(each) != 7 or not isinstance(each[0], str):
            return ()
        text, *numbers = each
        if not all(map(is_finite_number, numbers)) or not 1 <= len(text) <= _LONGEST_WORD:
            return ()
        x0, y0, x1, y1, confidence, line = map(float, numbers)
        if max(map(abs, (x0, y0, x1, y1, line))) > _MOST_LINES or not 0 <= confidence <= 1 or line < 0:
            return ()
        words.append(ZoneWord(text, (x0, y0, max(x1, x0 + 1.0), max(y1, y0 + 1.0)), confidence, int(line)))
    return tuple(words)


def _id(given: dict[Any, Any], field: str, limits: ExchangeLimits) -> str:
    value = given.get("id")
    field = f"{field}.id"
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise InvalidLayout(
            f"Give every zone an id, a string or a whole number; here it is {_shown(value)}.", field
        )
    if isinstance(value, int) and abs(value) >= 10**limits.max_id_length:
        raise InvalidLayout(f"The id may have {limits.max_id_length} digits at most.", field)
    name = str(value)
    if not 1 <= len(name) <= limits.max_id_length or not name.isprintable():
        raise InvalidLayout(
            f"The id must have 1 to {limits.max_id_length} printable characters; here it is {_shown(name)}.",
            field,
        )
    return name


def _box(value: Any, field: str, width: float, height: float) -> Box:
    if not isinstance(value, list | tuple) or len(value) != 4 or not all(map(is_finite_number, value)):
        raise InvalidLayout(
            f"The box must be four finite numbers [x0, y0, x1, y1] in pixels; here it is {_shown(value)}.",
            field,
        )
    x0, y0, x1, y1 = map(float, value)
    if x1 <= x0 or y1 <= y0:
        raise InvalidLayout(
            f"The box {_shown(value)} is empty; it is [x0, y0, x1, y1] with x0 < x1 and y0 < y1 "
            "(not [x, y, width, height]).",
            field,
        )
    page = f"the page of {width:g} x {height:g} pixels"
    if min(x1, width) <= max(x0, 0.0) or min(y1, height) <= max(y0, 0.0):
        raise InvalidLayout(f"The box {_shown(value)} lies outside {page}; measure both on one image.", field)
    # What sticks out of the page by more than its side was measured on another image.
    if min(x0 + width, 2 * width - x1, y0 + height, 2 * height - y1) < 0:
        raise InvalidLayout(
            f"The box {_shown(value)} goes far beyond {page}; measure both on one image.", field
        )
    return (max(x0, 0.0), max(y0, 0.0), min(x1, width), min(y1, height))


def _pieces(value: Any, field: str, width: float, height: float, limits: ExchangeLimits) -> tuple[Box, ...]:
    if value is None:
        return ()
    if not isinstance(value, list | tuple) or len(value) > limits.max_zones:
        raise InvalidLayout(f"The pieces must be a list of at most {limits.max_zones} boxes, or null.", field)
    return tuple(_box(box, f"{field}[{index}]", width, height) for index, box in enumerate(value))


def _choice(value: Any, field: str, choices: tuple[str, ...]) -> str | None:
    if value is not None and value not in choices:
        raise InvalidLayout(
            f"{_shown(value)} is not known; give one of {', '.join(choices)}, or null.", field
        )
    return cast(str | None, value)


def _lines(value: Any, field: str) -> int | None:
    if value is None:
        return None
    if not is_finite_number(value) or value != int(value) or not 0 <= value <= _MOST_LINES:
        raise InvalidLayout(
            f"The number of lines is {_shown(value)}; give a whole number from 0 to {_MOST_LINES}, or null.",
            field,
        )
    return int(value)


def _measure(value: Any, field: str, limits: ExchangeLimits) -> float | None:
    if value is None:
        return None
    if not is_finite_number(value) or not 0 <= value <= limits.max_side:
        raise InvalidLayout(
            f"The value is {_shown(value)}; give a number from 0 to {limits.max_side:g}, or null.", field
        )
    return float(value) or None


def _appearance(value: Any, field: str) -> InkAppearance | None:
    if value is None:
        return None
    names = [each.name for each in fields(InkAppearance)]
    if not isinstance(value, dict) or not all(
        is_finite_number(value.get(name)) and abs(value[name]) <= _LARGEST_APPEARANCE for name in names
    ):
        raise InvalidLayout(
            f"The appearance must be an object with finite numbers {', '.join(names)}, or null.", field
        )
    return InkAppearance(**{name: float(value[name]) for name in names})


def _text(value: Any, field: str, limits: ExchangeLimits) -> str:
    if value is None:
        return ""
    if not isinstance(value, str):
        raise InvalidLayout(f"The text must be a string; here it is {_shown(value)}.", field)
    if len(value) > limits.max_text_length:
        raise InvalidLayout(
            f"The text has {len(value)} characters and may have {limits.max_text_length}; divide the zone.",
            field,
        )
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise InvalidLayout(
            "The text has half a surrogate pair in it; send whole characters.", field
        ) from error
    return value


def _label(value: Any, field: str, limits: ExchangeLimits) -> str | None:
    if value is None:
        return None
    label = value.strip() if isinstance(value, str) else ""
    if not 1 <= len(label) <= limits.max_label_length or not label.isprintable():
        raise InvalidLayout(
            f"The label is {_shown(value)}; give 1 to {limits.max_label_length} printable characters, "
            "or null for none of the model's.",
            field,
        )
    return label


def _content(value: Any, field: str, limits: ExchangeLimits) -> dict[str, float]:
    if value is None:
        return {}
    if not isinstance(value, dict) or len(value) > limits.max_content_features:
        raise InvalidLayout(
            f'The content must be an object such as {{"date": 0.9}} of {limits.max_content_features} features at most.',
            field,
        )
    for name, confidence in value.items():
        if (
            not isinstance(name, str)
            or not 1 <= len(name) <= limits.max_label_length
            or not name.isprintable()
        ):
            raise InvalidLayout(
                f"{_shown(name)} is no name of a content feature; give 1 to {limits.max_label_length} "
                "printable characters.",
                field,
            )
        if not is_finite_number(confidence) or not 0 <= confidence <= 1:
            raise InvalidLayout(
                f"The confidence of {_shown(name)} is {_shown(confidence)}; give a number from 0 to 1.", field
            )
    return {name: float(confidence) for name, confidence in value.items()}


def _shown(value: Any) -> str:
    """The value for an error message: shortened, and in ASCII, which every encoding has."""
    if isinstance(value, list | tuple) and len(value) <= 4:
        return "[" + ", ".join(_shown_part(part) for part in value) + "]"
    return _shown_part(value)


def _shown_part(value: Any) -> str:
    if isinstance(value, dict | list | tuple):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and abs(value) >= 10**30:
        return "a whole number of more than 30 digits"
    shown = ascii(value[:60] if isinstance(value, str) else value)
    return shown if len(shown) <= 60 else shown[:57] + "..."
