"""`Accept` by RFC 9110."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.http.representations import (
    MEDIA_TYPES,
    MediaRange,
    choose_format,
    choose_pages_formats,
    image_headers,
    layout_headers,
    parse_accept,
    sniff_format,
)
from app.schemas.layout import result_of
from services.contract.answers.layout import DocumentResult
from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.page import Warning
from services.contract.answers.rectify import RectifyResult
from services.contract.images import AnswerFormat, Encoding, PagesFormat
from services.contract.rectify import RectifyParameters
from services.errors import NotAcceptable
from tests.app.scripted_results import document as rectified_document
from tests.app.scripted_results import layout_document, mosaic_document


@pytest.mark.parametrize(
    ("accept", "own", "expected"),
    [
        (None, "png", "png"),
        (None, None, None),
        ("", "png", "png"),
        (";;,,q=", "png", "png"),
        ("*/*", None, None),
        ("*/*", "tiff", "tiff"),
        ("image/*", None, None),
        ("image/*;q=0.5, application/json", "png", "json"),
        ("image/*, application/json;q=0.9", "png", "png"),
        ("*/*;q=0.1, image/png;q=0.2", "jpeg", "png"),
        ("image/webp, image/png", "jpeg", "png"),
        ("image/webp, image/png", "webp", "webp"),
        ("image/jpeg;q=0, image/*", "jpeg", "png"),
        ("image/jpeg;q=0, image/*", None, "png"),
        ("image/*, */*;q=0", "jpeg", "jpeg"),
        ("application/*", "jpeg", "pdf"),
        ("application/json; charset=utf-8", "jpeg", "json"),
        ("IMAGE/PNG; Q=1", "jpeg", "png"),
        ("image/png;q=nonsense, image/webp;q=0.1", "jpeg", "webp"),
        ("image/png;q=7, image/webp;q=0.1", "jpeg", "webp"),
    ],
)
def test_choice(accept: str | None, own: AnswerFormat | None, expected: AnswerFormat | None) -> None:
    assert choose_format(None, accept, own) == expected


@pytest.mark.parametrize("accept", ["text/html", "image/avif", "*/*;q=0", "image/*;q=0.0, text/css"])
def test_nothing_fits(accept: str) -> None:
    with pytest.raises(NotAcceptable, match="image/jpeg"):
        choose_format(None, accept, "jpeg")


def test_the_field_wins() -> None:
    assert choose_format("pdf", "text/html", "jpeg") == "pdf"


@pytest.mark.parametrize(
    ("requested", "accept", "own", "single", "several"),
    [
        (None, None, "jpeg", "jpeg", "pdf"),
        (None, "*/*", "tiff", "tiff", "tiff"),
        (None, "image/*", "png", "png", "tiff"),
        (None, "image/png", "png", "png", None),
        (None, "image/jpeg, application/json;q=0.5", "png", "jpeg", "json"),
        (None, "application/zip, application/pdf;q=0.9", "png", "zip", "zip"),
        ("zip", "image/png", "png", "zip", "zip"),
        ("webp", "*/*", "png", "webp", None),
    ],
)
def test_choice_for_one_page_and_for_several(
    requested: PagesFormat | None,
    accept: str | None,
    own: AnswerFormat,
    single: PagesFormat,
    several: PagesFormat | None,
) -> None:
    assert choose_pages_formats(requested, accept, own) == (single, several)


def test_nothing_fits_several_pages_either() -> None:
    with pytest.raises(NotAcceptable, match="application/zip"):
        choose_pages_formats(None, "text/html", "jpeg")


def test_parsing_keeps_order_and_weights() -> None:
    assert parse_accept("image/png;q=0.5;level=1 , */*") == (
        MediaRange("image", "png", 0.5),
        MediaRange("*", "*", 1.0),
    )


@given(st.text(alphabet="aimgejson/*;q=.,0159 \t-+", max_size=60), st.sampled_from([None, *MEDIA_TYPES]))
def test_no_header_breaks_it(accept: str, own: AnswerFormat | None) -> None:
    try:
        chosen = choose_format(None, accept, own)
    except NotAcceptable:
        return
    assert chosen is None or chosen in MEDIA_TYPES


@given(st.sampled_from(sorted(MEDIA_TYPES)), st.floats(0.001, 1))
def test_the_only_format_that_is_wanted_is_sent(wanted: AnswerFormat, weight: float) -> None:
    assert choose_format(None, f"{MEDIA_TYPES[wanted]};q={weight:.3f}", "jpeg") == wanted


@pytest.mark.parametrize("head", [b"", b"GIF89a", b"RIFF....WAVE", b"%PDF-1.7", b"\xff\xd8"])
def test_what_is_not_known_is_left_to_the_decoder(head: bytes) -> None:
    assert sniff_format(head) is None


def test_headers_of_a_page_without_warnings() -> None:
    page = rectified_document(RectifyParameters(), Encoding(), None)
    answer = RectifyResult.model_validate({**page, "warnings": [], "timings_ms": {"texture_flow": 1.0}})
    assert image_headers(answer) == {
        "Document-Kind": "planar",
        "Document-Rotation": "180",
        "Document-Warnings": "",
        "Server-Timing": "texture_flow;dur=1.0",
    }


def test_headers_of_a_mosaic() -> None:
    warnings = [{"code": code, "detail": ""} for code in ("unplaced", "curved-page", "unplaced")]
    document = mosaic_document(2, {}, None) | {"unplaced": [0, 12], "warnings": warnings}
    headers = image_headers(MosaicResult.model_validate(document))
    assert headers["Document-Unplaced"] == "0, 12"
    assert headers["Document-Warnings"] == "unplaced, curved-page"
    assert "Document-Kind" not in headers


def test_warnings_of_a_document_are_those_of_all_its_pages() -> None:
    turned = [Warning(code="page-turned", detail="")]
    page = result_of(layout_document({"width": 9, "height": 9, "zones": []}, [], [], {}), "")
    pages = [page.model_copy(update={"warnings": said}) for said in (turned, [], turned)]
    whole = DocumentResult(
        id="",
        class_=None,
        classes=[],
        unknown_probability=1.0,
        pages=pages,
        warnings=[Warning(code="unlike-page", detail="")],
        timings_ms={},
    )
    assert layout_headers(whole)["Document-Warnings"] == "unlike-page, page-turned"
    assert layout_headers(page)["Document-Warnings"] == ""
