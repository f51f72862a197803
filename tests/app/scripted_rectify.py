"""Scripted operations of /rectify and /mosaic: they do what their uploads say."""

import base64
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from services import errors
from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.page import Warning
from services.contract.answers.rectify import PagesResult, RectifyResult
from services.contract.images import MEDIA_TYPES, DocumentLimits, Encoding, FailedPlace, PageReply
from services.contract.mosaic import MosaicLimits, MosaicParameters
from services.contract.rectify import RectifyParameters
from tests.app.scripted_kept_pages import kept_photo
from tests.app.scripted_results import CREASED_SHEET, mosaic_document
from tests.app.scripted_results import document as rectified_document
from tests.app.scripts import follow


def rectify(
    uploads: list[bytes],
    parameters: RectifyParameters,
    encoding: Encoding,
    limits: DocumentLimits,
    journal: str = "",
    too_slow: str = "",
) -> PageReply:
    """Follow the scripts in the uploads, then answer with a document that tells what was asked.

    Of both pages there is one, unless the script says `pages-N`; `creased` answers a mesh. Several uploads are pages;
    those whose script is an error are failed pages.
    """
    if len(uploads) > 1:
        return _reply_of_uploads(uploads, parameters, encoding, Path(journal), too_slow)
    verb = follow(uploads[0], "image")
    if verb == b"unpicklable":
        return PageReply(lambda: None, "image/jpeg", None)  # type: ignore[arg-type]
    if parameters.pages == "both":
        return _reply_of_pages(verb, parameters, encoding)
    creased = {"kind": "curved", "surface": CREASED_SHEET} if verb == b"creased" else {}
    reply = _reply(encoding, lambda image: _rectified(parameters, encoding, image, creased))
    return replace(reply, kept=(kept_photo(parameters),)) if parameters.keep_photo else reply


def _reply_of_uploads(
    uploads: list[bytes], parameters: RectifyParameters, encoding: Encoding, journal: Path, too_slow: str
) -> PageReply:
    pages = _done(journal)
    if journal.stat().st_size:
        pages.append(_failed(errors.NotDoneInTime(too_slow, f"image[{len(pages)}]")))
    _write_done(journal, pages, len(uploads))
    for index, file in enumerate(uploads[len(pages) :], len(pages)):
        try:
            follow(file, f"image[{index}]")
            pages.append(rectified_document(parameters, encoding, None))
        except errors.DocumentError as error:
            pages.append(_failed(error))
        _write_done(journal, pages, len(uploads))
    return _reply_of_all(pages, encoding)


def bind_done_pages(journal: str, encoding: Encoding, reason: str) -> PageReply:
    """The pages that the call of `rectify` has written down before it was stopped."""
    pages = _done(Path(journal))
    if not pages:
        raise errors.NotDoneInTime(reason)
    count = json.loads(Path(journal).read_text(encoding="utf-8").splitlines()[0])
    missing = [_failed(errors.NotDoneInTime(reason, f"image[{index}]")) for index in range(len(pages), count)]
    return _reply_of_all([*pages, *missing], encoding)


def _done(journal: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()[1:]]


def _write_done(journal: Path, pages: list[dict[str, Any]], count: int) -> None:
    journal.write_text("\n".join(map(json.dumps, [count, *pages])), encoding="utf-8")


def _failed(error: errors.DocumentError) -> dict[str, object]:
    return {"problem": {"code": error.code, "detail": error.detail, "field": error.field}}


def _reply_of_all(pages: list[dict[str, Any]], encoding: Encoding) -> PageReply:
    flat = [RectifyResult.model_validate(page) for page in pages if "problem" not in page]
    failed = tuple(
        FailedPlace(place, **page["problem"]) for place, page in enumerate(pages) if "problem" in page
    )
    whole = PagesResult(pages=flat, warnings=[], timings_ms={"decode": 1.25})
    if encoding.pages_format is None:
        raise errors.NotAcceptable(f"{len(pages)} pages, and the format holds one.", "format")
    body = b"" if encoding.pages_format == "json" else f"{len(pages)} as {encoding.pages_format}".encode()
    return PageReply(body, MEDIA_TYPES[encoding.pages_format], whole, failed=failed)


def _reply_of_pages(verb: bytes, parameters: RectifyParameters, encoding: Encoding) -> PageReply:
    count = int(verb.removeprefix(b"pages-")) if verb.startswith(b"pages-") else 1
    chosen = encoding.format if count == 1 else encoding.pages_format
    if count > 1 and chosen is None:
        raise errors.NotAcceptable(f"{count} pages, and the format holds one.", "format")
    embedded = base64.b64encode(b"flat").decode() if encoding.embed and chosen == "json" else None
    page = RectifyResult.model_validate(rectified_document(parameters, encoding, embedded))
    whole = PagesResult(
        pages=[page] * count,
        warnings=[Warning(code="whole", detail="of all pages")],
        timings_ms={"decode": 1.25},
    )
    body = b"" if chosen == "json" else f"{count} as {chosen}".encode()
    return PageReply(body, MEDIA_TYPES[chosen or "jpeg"], whole)


def mosaic(
    uploads: list[bytes], parameters: MosaicParameters, encoding: Encoding, limits: MosaicLimits
) -> PageReply:
    """Follow the script in every upload, then answer with a document that tells what was asked."""
    for index, file in enumerate(uploads):
        follow(file, f"images[{index}]")
    asked = {"options": parameters, "encoding": encoding, "limits": limits, "bytes": list(map(len, uploads))}
    return _reply(
        encoding, lambda image: MosaicResult.model_validate(mosaic_document(len(uploads), asked, image))
    )


def _rectified(
    parameters: RectifyParameters, encoding: Encoding, image: str | None, other: dict[str, object]
) -> RectifyResult:
    return RectifyResult.model_validate(rectified_document(parameters, encoding, image) | other)


def _reply(encoding: Encoding, describe: Callable[[str | None], RectifyResult | MosaicResult]) -> PageReply:
    embedded = base64.b64encode(b"flat").decode() if encoding.embed and encoding.format == "json" else None
    body = b"" if encoding.format == "json" else f"flat as {encoding.format}".encode()
    return PageReply(body, MEDIA_TYPES[encoding.format or "jpeg"], describe(embedded))
