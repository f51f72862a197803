"""Flat views of several photos, or of the pages of TIFF files and PDFs: one page after another."""

from collections.abc import Sequence

from services.contract.images import DocumentLimits, Encoding, FailedPlace, PageReply
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError, InvalidOption, NotDoneInTime
from services.heap import release_freed_memory
from services.imaging.page_images import PagePicture, PageSource, open_pages
from services.notices import Notice
from services.operations.page_journal import Entry, PageJournal, SourceName, SourceOutcome
from services.operations.page_reading import reading_engine
from services.operations.pages_reply import (
    DescribedPage,
    EncodedPage,
    PagesTarget,
    bind_pages,
    choose_target,
    encode_page,
)
from services.operations.rectify import flatten_picture, rectify_picture
from services.operations.replies import ENCODING_BEGINS, SourceFacts, timed
from services.progress import progress_within
from services.rectify.effort import PREVIEW_PX
from services.rectify.parameter_checks import parameters_of_page


def rectify_uploads(
    uploads: Sequence[bytes],
    parameters: RectifyParameters,
    encoding: Encoding,
    limits: DocumentLimits,
    journal: str = "",
    too_slow: str = "",
) -> PageReply:
    """Frontal flat views of the pages in `uploads`: photos, TIFF files and PDFs of one page or more.

    A single page is answered as by `rectify_picture`. Of several pages, one that fails does not lose the others: the
    document has its problem at its place, and a file of several pages leaves it out. Of several pages, those that are
    done are written to the file `journal`. When this call is stopped, another one with the same file goes on behind the
    page that was at work, whose problem is `too_slow`; or `bind_done_pages` makes an answer of it.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When the only upload is not accepted, or all pages together are too large.
    NoText
        When no page shows its shape; the error is that of the first page.
    InvalidOption
        When `parameters` or `encoding` are not possible.
    NotAcceptable
        When there are several pages and the client accepts no format that can hold several.
    """
    if parameters.text or parameters.language is not None:
        reading_engine(parameters.language)  # an error must come before the work
    with open_pages(uploads, limits, lenient=True) as sources:
        if len(sources) == 1:
            return rectify_picture(sources[0].decode, parameters_of_page(parameters, 0, 1), encoding)
        if parameters.region is not None:
            raise InvalidOption(
                f"region: it is of one photo, and {len(sources)} pages were sent; send the photo of the region alone.",
                "region",
            )
        of_pages = [parameters_of_page(parameters, index, len(sources)) for index in range(len(sources))]
        return _rectify_pages(sources, of_pages, encoding, PageJournal(journal), too_slow)


def bind_done_pages(journal: str, encoding: Encoding, reason: str) -> PageReply:
    """The answer of a `rectify_uploads` that was stopped, with the pages that were done; the others have failed.

    Raises
    ------
    NotDoneInTime
        When no page was done. `reason` is the detail, also of the pages that are missing; it begins small.
    """
    names, entries = PageJournal(journal).read()
    outcomes = [entry.outcome for entry in entries]
    for name in names[len(entries) :]:
        outcomes.append(SourceOutcome(error=NotDoneInTime(f"{name.label}: {reason}", name.field)))
    target = entries[-1].target if entries else None
    if target is None or not any(outcome.pages for outcome in outcomes):
        raise NotDoneInTime(reason[:1].upper() + reason[1:])
    return _bind(outcomes, target, encoding, entries[-1].timings_ms)


def _rectify_pages(
    sources: Sequence[PageSource],
    of_pages: Sequence[RectifyParameters],
    encoding: Encoding,
    journal: PageJournal,
    too_slow: str,
) -> PageReply:
    names, entries = journal.read()
    outcomes = [entry.outcome for entry in entries]
    target = entries[-1].target if entries else None
    timings_ms = entries[-1].timings_ms if entries else {}

    def note(outcome: SourceOutcome) -> None:
        outcomes.append(outcome)
        journal.add(Entry(outcome, target, timings_ms))

    if not names:
        journal.begin([SourceName(source.label, source.field) for source in sources])
    elif len(entries) < len(sources):
        slow = sources[len(entries)]
        note(SourceOutcome(error=NotDoneInTime(f"{slow.label}: {too_slow}", slow.field)))
    for index, source in enumerate(sources[len(outcomes) :], len(outcomes)):
        share = ENCODING_BEGINS / len(sources)
        parameters = of_pages[index]
        with progress_within(index * share, (index + 1) * share):
            try:
                picture = _decode(source, timings_ms, PREVIEW_PX if parameters.preview else None)
                facts = SourceFacts(picture.format, picture.dpi, picture.icc_profile)
                target = target or choose_target(encoding, facts, len(sources))
                pages = flatten_picture(picture, parameters, encoding)
            except DocumentError as error:
                if target is None and error.code == "not-acceptable":
                    raise
                note(SourceOutcome(error=_named(error, source)))
                continue
            del picture
            # Pixels are let go before more memory is taken: those of the photo before encoding, those of a page before
            # the next page begins.
            encoded: list[EncodedPage] = []
            while pages:
                page = pages.pop(0)
                release_freed_memory()
                encoded.append(encode_page(page, target, facts, encoding))
                _add_timings(timings_ms, page)
                del page
            note(SourceOutcome(tuple(encoded)))
            release_freed_memory()
    if target is None or not any(outcome.pages for outcome in outcomes):
        raise next(outcome.error for outcome in outcomes if outcome.error is not None)
    return _bind(outcomes, target, encoding, timings_ms)


def _bind(
    outcomes: Sequence[SourceOutcome], target: PagesTarget, encoding: Encoding, timings_ms: dict[str, float]
) -> PageReply:
    encoded: list[EncodedPage] = []
    failed: list[FailedPlace] = []
    for outcome in outcomes:
        if outcome.error is not None:
            error = outcome.error
            failed.append(FailedPlace(len(encoded) + len(failed), error.code, error.detail, error.field))
        encoded += outcome.pages
    return bind_pages(encoded, target, encoding, timings_ms, _notices(failed), failed)


def _decode(source: PageSource, timings_ms: dict[str, float], enough_px: int | None) -> PagePicture:
    spent: dict[str, float] = {}
    with timed("decode", spent, 0.0):
        picture = source.decode(enough_px)
    timings_ms["decode"] = timings_ms.get("decode", 0.0) + spent["decode"]
    return picture


def _add_timings(timings_ms: dict[str, float], page: DescribedPage) -> None:
    for stage, spent in page.answer.timings_ms.items():
        timings_ms[stage] = timings_ms.get(stage, 0.0) + spent


def _named(error: DocumentError, source: PageSource) -> DocumentError:
    """The error with the name of its page."""
    if error.detail.startswith(source.label):
        return error
    field = source.field or error.field
    if isinstance(error, InvalidOption):
        return InvalidOption(f"{source.label}: {error.detail}", field or "image")
    return type(error)(f"{source.label}: {error.detail}", field)


def _notices(failed: Sequence[FailedPlace]) -> tuple[Notice, ...]:
    if not failed:
        return ()
    numbers = ", ".join(str(each.place + 1) for each in failed)
    return (
        Notice(
            "pages-failed",
            f"of all pages, these could not be flattened and are left out of a file: {numbers}. JSON has the reason.",
        ),
    )
