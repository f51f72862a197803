"""`Accept` and `format` -> what is sent."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar, get_args

from services.contract.images import MEDIA_TYPES as PAGES_MEDIA_TYPES
from services.contract.images import AnswerFormat, PagesFormat, SeveralFormat
from services.contract.layout import MEDIA_TYPES as LAYOUT_MEDIA_TYPES
from services.contract.layout import LayoutFormat
from services.errors import NotAcceptable

MEDIA_TYPES: Mapping[AnswerFormat, str] = {name: PAGES_MEDIA_TYPES[name] for name in get_args(AnswerFormat)}
"""In the order of preference among what a client likes equally well."""

SEVERAL_MEDIA_TYPES: Mapping[SeveralFormat, str] = {
    name: PAGES_MEDIA_TYPES[name] for name in get_args(SeveralFormat)
}
"""Of formats that hold several pages, in the order of preference."""

SNIFFED_BYTES = 32
Name = TypeVar("Name", bound=str)


@dataclass(frozen=True, slots=True)
class MediaRange:
    """One element of `Accept`: `type/subtype` with `*` for any, and its weight 0-1."""

    type: str
    subtype: str
    weight: float

    def precision(self, media_type: str) -> int:
        """How exactly this range names `media_type`; 0: not at all."""
        type_, subtype = media_type.split("/")
        if (self.type, self.subtype) == (type_, subtype):
            return 3
        if (self.type, self.subtype) == (type_, "*"):
            return 2
        return 1 if (self.type, self.subtype) == ("*", "*") else 0


def parse_accept(header: str) -> tuple[MediaRange, ...]:
    """Elements of an `Accept` header (RFC 9110, 12.5.1); malformed ones are passed over."""
    ranges = []
    for element in header.split(","):
        name, *parameters = (part.strip() for part in element.split(";"))
        type_, slash, subtype = name.lower().partition("/")
        weight = _weight(parameters)
        if slash and type_ and subtype and weight is not None:
            ranges.append(MediaRange(type_, subtype, weight))
    return tuple(ranges)


def _weight(parameters: list[str]) -> float | None:
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip().lower() == "q":
            try:
                weight = float(value.strip())
            except ValueError:
                return None
            return weight if 0 <= weight <= 1 else None
    return 1.0


def choose_format(
    requested: AnswerFormat | None, accept: str | None, own: AnswerFormat | None
) -> AnswerFormat | None:
    """AnswerFormat to send; None: the upload's own, whatever it turns out to be.

    `requested` is the form's `format` and wins over `accept`, the header; `own` is the upload's format where
    it is known (`sniff_format`). Among formats that weigh the same the upload's own comes first.

    Raises
    ------
    NotAcceptable
        When `accept` has room for none of the formats.
    """
    return _choose(requested, accept, own, MEDIA_TYPES)


def choose_pages_formats(
    requested: PagesFormat | None, accept: str | None, own: AnswerFormat | None
) -> tuple[PagesFormat | None, SeveralFormat | None]:
    """Formats to send where the answer may have several pages: of a single page, as by `choose_format`, and of several.

    The second is None when the client takes none that holds several pages. A client that says nothing gets several
    pages as a PDF (of a TIFF file: as a TIFF file).

    Raises
    ------
    NotAcceptable
        When `accept` has room for none of the formats.
    """
    single = _choose(requested, accept, own, PAGES_MEDIA_TYPES)
    if requested is not None:
        return single, next((name for name in SEVERAL_MEDIA_TYPES if name == requested), None)
    ranges = parse_accept(accept) if accept is not None else ()
    weights = {
        name: _weight_of(media_type, ranges) if ranges else 1.0
        for name, media_type in SEVERAL_MEDIA_TYPES.items()
    }
    best = max(weights.values())
    liked = [name for name, weight in weights.items() if weight == best]
    if best <= 0:
        return single, None
    return single, "tiff" if own == "tiff" and "tiff" in liked else liked[0]


def _choose(
    requested: Name | None, accept: str | None, own: Name | None, media_types: Mapping[Name, str]
) -> Name | None:
    if requested is not None:
        return requested
    ranges = parse_accept(accept) if accept is not None else ()
    if not ranges:
        return own
    liked = _liked(media_types, ranges)
    if own in liked:
        return own
    images = {name for name, media_type in media_types.items() if media_type.startswith("image/")}
    if own is None and images.issubset(liked):
        return None
    return liked[0]


def choose_layout_format(requested: LayoutFormat | None, accept: str | None) -> LayoutFormat:
    """AnswerFormat of an answer of /layout: `requested`, the form's `format`, else by `accept`, the header, else JSON.

    Raises
    ------
    NotAcceptable
        When `accept` has room for none of the formats.
    """
    if requested is not None:
        return requested
    ranges = parse_accept(accept) if accept is not None else ()
    return _liked(LAYOUT_MEDIA_TYPES, ranges)[0] if ranges else "json"


def _liked(media_types: Mapping[Name, str], ranges: tuple[MediaRange, ...]) -> list[Name]:
    """The formats that weigh most, in their own order."""
    weights = {name: _weight_of(media_type, ranges) for name, media_type in media_types.items()}
    best = max(weights.values())
    if best <= 0:
        raise NotAcceptable(
            f"None of {', '.join(dict.fromkeys(media_types.values()))} fits the Accept header; send a form field "
            "`format` to choose one."
        )
    return [name for name, weight in weights.items() if weight == best]


def _weight_of(media_type: str, ranges: tuple[MediaRange, ...]) -> float:
    """Weight by the most precise range that names `media_type`; 0 where none does."""
    named = [(range_.precision(media_type), range_.weight) for range_ in ranges]
    precision, weight = max(named, key=lambda pair: pair[0])
    return weight if precision else 0.0


def sniff_format(head: bytes) -> AnswerFormat | None:
    """AnswerFormat to answer in, by the first bytes of an upload; HEIC, which is not sent, becomes JPEG.

    Only the choice of the representation hangs on it: what the upload really is, the decoder decides.
    """
    if head.startswith(b"\xff\xd8\xff"):
        return "jpeg"
    if head.startswith(b"\x89PNG\r\n\x1a\n"):
        return "png"
    if head.startswith(b"RIFF") and head[8:12] == b"WEBP":
        return "webp"
    if head.startswith((b"II*\x00", b"MM\x00*", b"II+\x00", b"MM\x00+")):
        return "tiff"
    if head[4:8] == b"ftyp":
        return "jpeg"
    return None


def may_have_pages(head: bytes) -> bool:
    """Whether an upload that begins so may hold several pages: a TIFF file, or no image at all, as PDFs are none."""
    return sniff_format(head) in ("tiff", None)


def image_headers(document: Mapping[str, object]) -> dict[str, str]:
    """The essential facts of a result (a route's result as JSON) as headers of an image answer.

    Of several pages: of each, in their order.
    """
    pages = document.get("pages")
    if isinstance(pages, list | tuple):
        return _headers_of_pages(document, pages)
    headers = {}
    kind, orientation, unplaced, warnings, timings = (
        document.get(name) for name in ("kind", "orientation", "unplaced", "warnings", "timings_ms")
    )
    if kind is not None:
        headers["Document-Kind"] = str(kind)
    if isinstance(orientation, Mapping):
        headers["Document-Rotation"] = str(orientation["rotation_deg"])
    if isinstance(unplaced, list | tuple):
        headers["Document-Unplaced"] = ", ".join(map(str, unplaced))
    return headers | _notices(warnings) | _stages(timings)


def _headers_of_pages(
    document: Mapping[str, object], pages: Sequence[Mapping[str, object]]
) -> dict[str, str]:
    warnings: list[object] = []
    for part in (document, *pages):
        found = part["warnings"]
        warnings += found if isinstance(found, list | tuple) else ()
    each = [image_headers(page) for page in pages]
    headers = {"Document-Pages": str(len(pages))} | {
        name: ", ".join(one[name] for one in each if name in one)
        for name in ("Document-Kind", "Document-Rotation")
    }
    return headers | _notices(warnings) | _stages(document.get("timings_ms"))


def layout_headers(document: Mapping[str, object]) -> dict[str, str]:
    """The essential facts of a result of /layout as headers of any answer."""
    headers = {"Vary": "Accept"}
    chosen = document.get("class")
    if isinstance(chosen, Mapping):  # a page that goes on has a model of its own, and its document's class
        headers["Document-Class"] = str(document.get("document_class") or chosen["name"])
    return headers | _notices(document.get("warnings")) | _stages(document.get("timings_ms"))


def _notices(warnings: object) -> dict[str, str]:
    if not isinstance(warnings, list | tuple):
        return {}
    codes = dict.fromkeys(str(warning["code"]) for warning in warnings)  # photos share some
    return {"Document-Warnings": ", ".join(codes)}


def _stages(timings_ms: object) -> dict[str, str]:
    if not isinstance(timings_ms, Mapping):
        return {}
    stages = (f"{name.replace('_', '-')};dur={float(ms):.1f}" for name, ms in timings_ms.items())
    return {"Server-Timing": ", ".join(stages)}
