"""Files of stored results, as feedback has corrected them: HTML, PAGE-XML, ALTO, or the page with its labels drawn."""

from collections.abc import Sequence
from dataclasses import replace

from services.contract.answers import layout as answers
from services.contract.answers.layout import DocumentClass, LayoutResult
from services.contract.layout import (
    MEDIA_TYPES,
    DrawnPage,
    KeptResult,
    LayoutFormat,
    LayoutOptions,
    LayoutSettings,
    RenderedResults,
)
from services.errors import InvalidOption
from services.imaging.codec import encode_image
from services.layout.page import ZoneWord
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone
from services.layout.rendering.overlay import draw_overlay, place_of_page
from services.operations.kept_picture import read_kept_picture
from services.operations.layout import write_xml
from services.operations.layout_documents import ARCHIVE, zip_files
from services.operations.layout_html import HtmlPage, render_html
from services.operations.layout_tables import tables_from
from services.operations.page_zones import read_kept_page
from services.rectify.results import Orientation


def render_results(
    pages: Sequence[KeptResult], format: LayoutFormat, settings: LayoutSettings
) -> RenderedResults:
    """Stored results as one file: HTML of all pages, an archive of XML for several of them, a picture of one.

    Raises
    ------
    InvalidOption
        When several pages are asked for as a picture, or this release cannot read one.
    """
    if format == "html":
        html = [HtmlPage(_answer(page), page.picture or None, page.elements) for page in pages]
        title = html[0].answer.file_name or ""
        return RenderedResults(render_html(html, title), MEDIA_TYPES[format])
    recognized = [_recognition(page, settings) for page in pages]
    if format == "png":
        if len(pages) > 1:
            raise InvalidOption(
                f"format: png shows one page, and this document has {len(pages)}. Ask for those of its pages.",
                "format",
            )
        [page], [recognition] = pages, recognized
        picture = read_kept_picture(page.picture) if page.picture else None
        body = encode_image(draw_overlay(picture, recognition), "png")
        return RenderedResults(body, MEDIA_TYPES[format], DrawnPage(*place_of_page(recognition)))
    options = LayoutOptions(format=format, words=True)
    files = [
        write_xml(each, options, page.name, _orientation(_answer(page)))
        for each, page in zip(recognized, pages, strict=True)
    ]
    if len(files) == 1:
        return RenderedResults(files[0], MEDIA_TYPES[format])
    return RenderedResults(zip_files(files), ARCHIVE)


def _recognition(kept: KeptResult, settings: LayoutSettings) -> Recognition:
    """The recognition that a stored result describes."""
    page, answer = read_kept_page(kept.page, settings), _answer(kept)
    shown = {zone.id: zone for zone in answer.zones}
    zones = tuple(
        RecognizedZone(
            replace(zone, words=tuple(map(_word, shown[zone.id].words or ()))),
            shown[zone.id].label,
            shown[zone.id].confidence,
            shown[zone.id].group,
            shown[zone.id].order,
        )
        for zone in page.zones
    )
    chosen = None if answer.class_ is None else _match(answer.class_)
    # Where the class is sure, a person has named it: what was compared says nothing any more.
    classes = (chosen,) if chosen and chosen.probability >= 1.0 else tuple(map(_match, answer.classes))
    return Recognition(
        page, zones, chosen, classes, answer.unknown_probability, tables=tables_from(answer.tables)
    )


def _answer(kept: KeptResult) -> LayoutResult:
    return LayoutResult.model_validate({"id": "", **kept.document})


def _orientation(answer: LayoutResult) -> Orientation | None:
    turned = answer.orientation
    return None if turned is None else Orientation(turned.rotation_deg, turned.mirrored, turned.confidence)


def _word(word: answers.ReadWord) -> ZoneWord:
    return ZoneWord(word.text, word.box, word.confidence, word.line)


def _match(match: DocumentClass) -> ClassMatch:
    return ClassMatch(match.name, match.model_version or 0, match.cost or 0.0, match.probability)
