"""HTML of recognized pages: pictures cut out of the page, several pages, settings of classes, stored results."""

import base64
import io
import json
from dataclasses import replace
from typing import Any
from xml.etree.ElementTree import Element

import html5lib
import numpy as np
import pytest
from PIL import Image

from app.schemas.layout import stored_form
from services.contract.answers.layout import LabelField, LayoutResult
from services.contract.html import HtmlElement
from services.contract.layout import DocumentReply, KeptResult, LayoutOptions, LayoutSettings
from services.layout.page import Page, Zone
from services.layout.recognition.fields import Field
from services.layout.recognition.results import Recognition, RecognizedZone
from services.operations import layout, layout_documents
from services.operations.kept_picture import encode_kept_picture
from services.operations.layout_documents import recognize_uploads
from services.operations.layout_files import render_results
from services.operations.layout_html import HtmlPage, render_html
from services.operations.layout_result import describe_recognition
from tests.services.imaging.files import make_file

SETTINGS = LayoutSettings()
PAGE = Page(
    100.0,
    80.0,
    (
        Zone("f", (10.0, 20.0, 50.0, 40.0), "figure"),
        Zone("t", (0.0, 0.0, 100.0, 10.0), text="On pages"),
        Zone("c", (10.0, 41.0, 50.0, 45.0), text="Figure 1"),
    ),
)
PICTURE = np.full((80, 100, 3), 255, np.uint8)
PICTURE[20:40, 10:50] = (200, 30, 30)


def document(
    labels: tuple[str | None, ...] = ("figure", "title", "caption"), page: Page = PAGE
) -> LayoutResult:
    """The answer about the page; its title comes before its figure."""
    order = {"t": 0, "f": 1, "c": 2}
    zones = tuple(
        RecognizedZone(zone, label, 0.9, None, order.get(zone.id, index))
        for index, (zone, label) in enumerate(zip(page.zones, labels, strict=True))
    )
    answer = describe_recognition(Recognition(page, zones, None), explain=False)
    answer.language = "eng"
    return answer


def parsed(file: bytes) -> Element:
    root: Element = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(file)
    return root


def pixels_of(image: Element) -> np.ndarray:
    content = base64.b64decode(str(image.get("src")).removeprefix("data:image/jpeg;base64,"))
    with Image.open(io.BytesIO(content)) as opened:
        assert (str(opened.width), str(opened.height)) == (image.get("width"), image.get("height"))
        return np.asarray(opened.convert("RGB"), np.float64)


@pytest.mark.parametrize("scale", [1, 2, 0.5])
def test_a_figure_is_cut_out_of_the_picture(scale: float) -> None:
    size = (round(100 * scale), round(80 * scale))
    picture = np.asarray(Image.fromarray(PICTURE).resize(size, Image.Resampling.NEAREST))
    root = parsed(render_html([HtmlPage(document(), picture)], "page.png"))
    assert root.get("lang") == "en"
    assert root.findtext("head/title") == "On pages"
    main = root.find("body/main")
    assert main is not None
    assert [each.tag for each in main] == ["h1", "figure"]
    assert [each.tag for each in main[1]] == ["img", "figcaption"]
    shown = pixels_of(main[1][0])
    assert shown.shape == (20 * scale, 40 * scale, 3)
    assert np.abs(shown - (200, 30, 30)).max() <= 6


def test_stored_results_have_the_kept_picture_or_none() -> None:
    kept = encode_kept_picture(PICTURE, 10_000).body
    elements: dict[str, HtmlElement] = {"title": "h3", "figure": "img", "caption": "none"}
    no_page: Any = {}
    pages = [
        KeptResult(stored_form(document()), no_page, "1", kept, elements),
        KeptResult(stored_form(document(("figure", None, None))), no_page, "2"),
    ]
    root = parsed(render_results(pages, "html", SETTINGS).body)
    first, second = root.findall("body/main/section")
    assert [each.tag for each in first] == ["h3", "img"]
    assert np.abs(pixels_of(first[1]).mean((0, 1)) - (200, 30, 30)).max() <= 6
    assert [(each.tag, each.text) for each in second] == [
        ("p", "On pages"),
        ("figure", "[figure]"),
        ("p", "Figure 1"),
    ]
    assert root.findtext("head/title") == "On pages"


def test_text_that_nobody_has_read_is_shown_as_a_picture() -> None:
    unread = replace(PAGE, zones=tuple(replace(zone, text="") for zone in PAGE.zones))
    main = parsed(render_html([HtmlPage(document(page=unread), PICTURE)], "page.png")).find("body/main")
    assert main is not None
    assert [(each.tag, each[0].tag) for each in main] == [("h1", "img"), ("figure", "img"), ("figure", "img")]


def test_pictures_have_a_bounded_area_and_size() -> None:
    zones = tuple(Zone(f"z{n}", (0.0, 0.0, 4000.0, 100.0), "figure") for n in range(5))
    page = Page(4000.0, 100.0, zones)
    picture = np.full((100, 4000, 3), 255, np.uint8)
    root = parsed(render_html([HtmlPage(document((None,) * 5, page), picture)], ""))
    assert [(image.get("width"), image.get("height")) for image in root.iter("img")] == [("1600", "40")] * 2
    assert len(root.findall("body/main/figure")) == 5


def test_dates_are_machine_readable() -> None:
    found = document(("figure", "date", None))
    found.fields = [
        LabelField(label="date", text="", type="date", value="1998-03-03", confidence=1.0, zones=["t"])
    ]
    root = parsed(render_html([HtmlPage(found)], ""))
    moment = root.find("body/main/p/time")
    assert moment is not None
    assert (moment.get("datetime"), moment.text) == ("1998-03-03", "On pages")
    found.fields[0].label = "another"  # the zone is more than its date
    assert parsed(render_html([HtmlPage(found)], "")).find("body/main/p/time") is None
    assert {"label", "type", "value", "zones"} <= {*Field.__slots__}


@pytest.fixture
def eyes(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (layout, layout_documents):
        monkeypatch.setattr(module, "ocr_engine", lambda language: None)
    monkeypatch.setattr(layout, "fine_page", lambda *_: (PAGE, None))


@pytest.mark.usefixtures("eyes")
@pytest.mark.parametrize("named", [True, False])
def test_one_file_for_one_page_and_for_several(named: bool) -> None:
    image = make_file(PICTURE, "PNG")
    options = LayoutOptions(format="html", image_name="a <b>.png", format_named=named)
    one = recognize_uploads([image], None, None, [], options, SETTINGS)
    assert one.media_type == "text/html"
    assert one.answer.language is None
    root = parsed(one.body)
    assert [each.tag for each in root.find("body/main") or ()] == ["figure", "p", "p"]
    assert root.findtext("head/title") == "a <b>.png"
    assert "lang" not in root.attrib
    two = recognize_uploads([image, image], None, None, [], options, SETTINGS)
    assert isinstance(two, DocumentReply)
    assert two.media_type == "text/html"
    images = parsed(two.body).findall("body/main/section/figure/img")
    assert len(images) == 2
    assert np.abs(pixels_of(images[1]).mean((0, 1)) - (200, 30, 30)).max() <= 6
    assert [page.picture for page in two.pages] == [b"", b""]


def test_zones_alone_make_a_page_without_pictures() -> None:
    zones = {"width": 100, "height": 80, "zones": [{"id": 1, "box": [0, 0, 9, 9], "kind": "figure"}]}
    options = LayoutOptions(format="html")
    reply = recognize_uploads([], json.dumps(zones).encode(), None, [], options, SETTINGS)
    assert parsed(reply.body).findtext("body/main/figure") == "[figure]"
