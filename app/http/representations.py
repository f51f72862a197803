"""Format of a response, from `Accept` and the form field `format`."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar, get_args
from unicodedata import category
from urllib.parse import quote

from app.http.octets import OCTETS
from services.contract.answers.layout import DocumentResult, LayoutResult
from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.page import Warning
from services.contract.answers.rectify import FailedPage, PagesResult, RectifyResult
from services.contract.images import MEDIA_TYPES as PAGES_MEDIA_TYPES
from services.contract.images import AnswerFormat, PagesFormat, SeveralFormat
from services.contract.layout import DrawnPage
from services.errors import NotAcceptable

MEDIA_TYPES: Mapping[AnswerFormat, str] = {name: PAGES_MEDIA_TYPES[name] for name in get_args(AnswerFormat)}
"""Media types by format. The order decides between formats of equal weight."""

SEVERAL_MEDIA_TYPES: Mapping[SeveralFormat, str] = {
    name: PAGES_MEDIA_TYPES[name] for name in get_args(SeveralFormat)
}
"""Media types of formats that hold several pages, in order of preference."""

SNIFFED_BYTES = 32
Name = TypeVar("Name", bound=str)


@dataclass(frozen=True, slots=True)
class MediaRange:
    """One element of `Accept`: `type/subtype`, with `*` for any, and its weight 0-1."""

    type: str
    subtype: str
    weight: float

    def precision(self, media_type: str) -> int:
        """How specifically this range names `media_type`; 0: not at all."""
        type_, subtype = media_type.split("/")
        if (self.type, self.subtype) == (type_, subtype):
            return 3
        if (self.type, self.subtype) == (type_, "*"):
            return 2
        return 1 if (self.type, self.subtype) == ("*", "*") else 0


def parse_accept(header: str) -> tuple[MediaRange, ...]:
    """Elements of an `Accept` header (RFC 9110, 12.5.1); malformed elements are ignored."""
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
    """Format of the response; None: the format of the upload.

    Parameters
    ----------
    requested
        The form field `format`; it overrides `accept`.
    accept
        The `Accept` header.
    own
        The upload's format, if known (`sniff_format`). It is preferred among formats of equal weight.

    Raises
    ------
    NotAcceptable
        When `accept` allows no format.
    """
    return _choose(requested, accept, own, MEDIA_TYPES)


def choose_pages_formats(
    requested: PagesFormat | None, accept: str | None, own: AnswerFormat | None
) -> tuple[PagesFormat | None, SeveralFormat | None]:
    """Formats of a response that may have several pages: for one page (as `choose_format`), and for several.

    The second is None when the client accepts no format for several pages. A client without a preference gets several
    pages as a PDF, and those of a TIFF file as TIFF.

    Raises
    ------
    NotAcceptable
        When `accept` allows no format.
    """
    single = _choose(requested, accept, own, PAGES_MEDIA_TYPES)
    if requested is not None:
        return single, next((name for name in SEVERAL_MEDIA_TYPES if name == requested), None)
    ranges = _ranges_of(accept)
    weights = {
        name: _weight_of(media_type, ranges) if ranges else 1.0
        for name, media_type in SEVERAL_MEDIA_TYPES.items()
    }
    best = max(weights.values())
    liked = [name for name, weight in weights.items() if weight == best]
    if best <= 0:
        return single, None
    return single, "tiff" if own == "tiff" and "tiff" in liked else liked[0]


def _ranges_of(accept: str | None) -> tuple[MediaRange, ...]:
    """What the client accepts; nothing where it has no preference: bytes may be a file of any type."""
    return () if accept is None or accept == OCTETS else parse_accept(accept)


def _choose(
    requested: Name | None, accept: str | None, own: Name | None, media_types: Mapping[Name, str]
) -> Name | None:
    if requested is not None:
        return requested
    ranges = _ranges_of(accept)
    if not ranges:
        return own
    liked = _liked(media_types, ranges)
    if own in liked:
        return own
    images = {name for name, media_type in media_types.items() if media_type.startswith("image/")}
    if own is None and images.issubset(liked):
        return None
    return liked[0]


def choose_described_format(
    requested: Name | None, accept: str | None, media_types: Mapping[Name, str]
) -> Name:
    """Format of a response that is JSON unless the client wants something else.

    Parameters
    ----------
    requested
        The option `format`; it overrides `accept`.
    accept
        The `Accept` header.
    media_types
        Of the formats that the response can have; the first is the default.

    Raises
    ------
    NotAcceptable
        When `accept` allows no format.
    """
    if requested is not None:
        return requested
    ranges = parse_accept(accept) if accept is not None else ()
    return _liked(media_types, ranges)[0] if ranges else next(iter(media_types))


def _liked(media_types: Mapping[Name, str], ranges: tuple[MediaRange, ...]) -> list[Name]:
    """The formats of the largest weight, in their own order."""
    weights = {name: _weight_of(media_type, ranges) for name, media_type in media_types.items()}
    best = max(weights.values())
    if best <= 0:
        raise NotAcceptable(
            f"None of {', '.join(dict.fromkeys(media_types.values()))} fits the Accept header. Choose one with "
            "the option `format`."
        )
    return [name for name, weight in weights.items() if weight == best]


def _weight_of(media_type: str, ranges: tuple[MediaRange, ...]) -> float:
    """Weight by the most specific range that matches `media_type`; 0 if none does."""
    named = [(range_.precision(media_type), range_.weight) for range_ in ranges]
    precision, weight = max(named, key=lambda pair: pair[0])
    return weight if precision else 0.0


def sniff_format(head: bytes) -> AnswerFormat | None:
    """Response format for an upload, from its first bytes. HEIC gives JPEG, because HEIC is never sent.

    The result affects the choice of the response format only. The decoder checks what the upload really is.
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


def check_accepted(accept: str | None, media_type: str) -> None:
    """Check that something stored may be sent as `media_type`.

    Raises
    ------
    NotAcceptable
        When the header `accept` excludes this type.
    """
    ranges = parse_accept(accept) if accept is not None else ()
    if ranges and _weight_of(media_type, ranges) <= 0:
        raise NotAcceptable(
            f"This is stored as {media_type}. Send Accept: {media_type}, or no Accept header."
        )


_EXTENSIONS = {
    "image/jpeg": "jpg",
    "image/png": "png",
    "image/webp": "webp",
    "image/tiff": "tif",
    "application/pdf": "pdf",
    "application/zip": "zip",
    "application/xml": "xml",
    "application/alto+xml": "xml",
    "text/vnd.hocr+html": "html",
    "text/plain": "txt",
    "text/markdown": "md",
    "text/html": "html",
    "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet": "xlsx",
}


def content_disposition(upload_name: str | None, suffix: str, media_type: str) -> dict[str, str]:
    """Header with the file name under which a browser saves the response (RFC 6266).

    Parameters
    ----------
    upload_name
        File name of the upload, as the client sent it.
    suffix
        What is added to it, so that the upload itself is not overwritten.
    media_type
        Media type of the response, for the extension.
    """
    name = f"{file_stem(upload_name)}{suffix}.{_EXTENSIONS.get(media_type, 'bin')}"
    plain = re.sub(r'[?"\\]', "_", name.encode("ascii", "replace").decode())
    value = f'inline; filename="{plain}"'
    if plain != name:
        value += f"; filename*=UTF-8''{quote(name.encode('utf-8', 'replace'), safe='')}"
    return {"Content-Disposition": value}


def file_stem(upload_name: str | None) -> str:
    """File name of an upload without folders and extension; `page` if it has none."""
    stem = (file_name(upload_name) or "")[:100]
    return stem.rpartition(".")[0] or stem or "page"


def file_name(upload_name: str | None) -> str | None:
    """File name of an upload without folders and unprintable characters, 200 at most; None if nothing is left."""
    base = (upload_name or "").replace("\\", "/").rpartition("/")[2]
    # Names of screenshots have spaces of other widths, which do not count as printable.
    spaced = (" " if category(character) == "Zs" else character for character in base)
    return "".join(character for character in spaced if character.isprintable())[:200].strip() or None


def image_headers(answer: RectifyResult | MosaicResult | PagesResult) -> dict[str, str]:
    """Main values of an answer as headers of a response with its file.

    For several pages, each header lists the values of the pages in their order.
    """
    if isinstance(answer, PagesResult):
        return _headers_of_pages(answer)
    headers = {"Document-Rotation": str(answer.orientation.rotation_deg)}
    if isinstance(answer, MosaicResult):
        headers["Document-Unplaced"] = ", ".join(map(str, answer.unplaced))
    else:
        headers |= _headers_of_page(answer)
    if answer.page_id is not None:
        headers["Document-Page-Id"] = answer.page_id
    return headers | _notices(answer.warnings) | _stages(answer.timings_ms)


def _headers_of_page(page: RectifyResult) -> dict[str, str]:
    headers: dict[str, str] = {"Document-Kind": page.kind}
    if page.quality is not None:
        headers["Document-Advice"] = ", ".join(advice.code for advice in page.quality.advice)
    return headers


def _headers_of_pages(answer: PagesResult) -> dict[str, str]:
    flat = [page for page in answer.pages if isinstance(page, RectifyResult)]
    failed = [
        f"{number} {page.problem.code}"
        for number, page in enumerate(answer.pages, 1)
        if isinstance(page, FailedPage)
    ]
    ids = [page.page_id for page in flat if page.page_id is not None]
    headers = {
        "Document-Pages": str(len(flat)),
        "Document-Kind": ", ".join(page.kind for page in flat),
        "Document-Rotation": ", ".join(str(page.orientation.rotation_deg) for page in flat),
        **({"Document-Failed": ", ".join(failed)} if failed else {}),
        **({"Document-Page-Id": ", ".join(ids)} if ids else {}),
    }
    warnings = [*answer.warnings, *(warning for page in flat for warning in page.warnings)]
    return headers | _notices(warnings) | _stages(answer.timings_ms)


def layout_headers(answer: LayoutResult | DocumentResult, drawn: DrawnPage | None = None) -> dict[str, str]:
    """Main values of an answer of /layout as headers of any response; `drawn` is the place of the page in a picture.

    The warnings are those of the document and of all its pages.
    """
    headers = {"Vary": "Accept"}
    if drawn is not None:
        headers["Document-Scale"] = f"{drawn.scale_x:.6g}, {drawn.scale_y:.6g}"
        headers["Document-Offset"] = f"{drawn.left}, {drawn.top}"
    pages: Sequence[LayoutResult] = answer.pages if isinstance(answer, DocumentResult) else ()
    if answer.class_ is not None:  # a continuation page has its own model; the class is the document's
        of_page = answer.document_class if isinstance(answer, LayoutResult) else None
        headers["Document-Class"] = of_page or answer.class_.name
    said = [*answer.warnings, *(warning for page in pages for warning in page.warnings)]
    return headers | _notices(said) | _stages(answer.timings_ms)


def stack_headers(documents: Sequence[DocumentResult]) -> dict[str, str]:
    """Headers of the answer about a stack: the classes of its documents in their order, and all their warnings."""
    said = [
        *(warning for document in documents for warning in document.warnings),
        *(warning for document in documents for page in document.pages for warning in page.warnings),
    ]
    names = ", ".join("null" if document.class_ is None else document.class_.name for document in documents)
    return {"Vary": "Accept", "Document-Class": names} | _notices(said)


def _notices(warnings: Sequence[Warning]) -> dict[str, str]:
    codes = dict.fromkeys(warning.code for warning in warnings)  # without repetitions
    return {"Document-Warnings": ", ".join(codes)}


def _stages(timings_ms: Mapping[str, float]) -> dict[str, str]:
    return {"Server-Timing": ", ".join(f"{name};dur={ms:.1f}" for name, ms in timings_ms.items())}
