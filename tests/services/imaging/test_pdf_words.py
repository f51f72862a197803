"""The words of pages of PDFs that are set in type, and where they lie in the picture."""

import io
from typing import Any

import numpy as np
import pikepdf
import pytest

from services.contract.rectify import TypesetPage
from services.imaging.page_images import PagePicture, open_pages
from tests.services.imaging.test_page_images import LIMITS, set_in_type

pytestmark = pytest.mark.pipeline

WIDTH, HEIGHT = 400.0, 300.0


def upload_of(
    drawing: str, *, turn: int = 0, font: pikepdf.Dictionary | None = None, note: bool = False
) -> bytes:
    """A page with a `drawing`, in Helvetica if no other `font` is given."""
    buffer, document = io.BytesIO(), pikepdf.new()
    document.add_blank_page(page_size=(WIDTH, HEIGHT))
    page = document.pages[0].obj
    page["/Rotate"] = turn
    helvetica = {
        "/Type": "/Font",
        "/Subtype": "/Type1",
        "/BaseFont": "/Helvetica",
        "/Encoding": "/WinAnsiEncoding",
    }
    named = pikepdf.Dictionary({key: pikepdf.Name(value) for key, value in helvetica.items()})
    page["/Resources"] = pikepdf.Dictionary(Font=pikepdf.Dictionary(F1=font or named))
    page["/Contents"] = pikepdf.Stream(document, drawing.encode("cp1252"))
    if note:
        box = pikepdf.Array([10, 10, 60, 30])
        page["/Annots"] = pikepdf.Array([pikepdf.Dictionary(Subtype=pikepdf.Name("/Square"), Rect=box)])
    document.save(buffer)
    return buffer.getvalue()


def picture_of(upload: bytes) -> PagePicture:
    with open_pages([upload], LIMITS) as pages:
        return pages[0].decode()


def page_of(drawing: str, **how: Any) -> PagePicture:
    """The picture of `upload_of`."""
    return picture_of(upload_of(drawing, **how))


def typeset(picture: PagePicture) -> TypesetPage:
    assert isinstance(picture.origin, TypesetPage)
    return picture.origin


def show(text: str, x: float = 50, y: float = 200, *, size: int = 20, how: str = "") -> str:
    return f"BT {how} /F1 {size} Tf {x} {y} Td ({text}) Tj ET "


def lines_of(picture: PagePicture) -> list[str]:
    """The lines of the page."""
    lines: dict[int, list[str]] = {}
    for word in typeset(picture).words:
        lines.setdefault(word.line, []).append(word.text)
    return [" ".join(line) for line in lines.values()]


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
def test_words_lie_on_their_ink(turn: int) -> None:
    """Also of a heading in white on a band of colour."""
    band = "0 0 0.6 rg 0 230 400 50 re f 1 1 1 rg "
    picture = page_of(band + show("HEADING", y=245) + "0 g " + show("Stra\xdfe \xdcber"), turn=turn)
    assert sorted(lines_of(picture)) == ["HEADING", "Straße Über"]
    height, width = picture.pixels.shape[:2]
    for word in typeset(picture).words:
        x0, y0, x1, y1 = np.array(word.box) * (width, height, width, height)
        left, top = int(x0) - 2, int(y0) - 2
        gray = picture.pixels.min(axis=2)[top : int(y1) + 3, left : int(x1) + 3]
        rows, columns = np.nonzero(gray > 128 if word.text == "HEADING" else gray < 128)
        ink = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]) + [left, top] * 2
        np.testing.assert_allclose(ink, [x0, y0, x1, y1], atol=1.5)


def test_what_is_not_shown_on_the_page_is_left_out() -> None:
    drawing = (
        show("A line that is shown") + show("hidden", y=100, how="3 Tr") + show("beyond", x=500, how="0 Tr")
    )
    assert lines_of(page_of(drawing)) == ["A line that is shown"]


def test_print_that_is_made_bold_by_drawing_it_twice_is_there_once() -> None:
    twice = "".join(
        show(letter, 50 + dx + 14 * k, 200) for k, letter in enumerate("BALLOONS12") for dx in (0, 0.5)
    )
    assert "".join(lines_of(page_of(twice)).pop().split()) == "BALLOONS12"


def test_a_hyphen_at_the_end_of_a_line_ends_its_word() -> None:
    assert lines_of(page_of(show("some hyphen-") + show("ated words", y=176))) == [
        "some hyphen-",
        "ated words",
    ]


def font_without_a_map() -> pikepdf.Dictionary:
    """A font whose characters have numbers only."""
    system = pikepdf.Dictionary(Registry="Adobe", Ordering="Identity", Supplement=0)
    name = pikepdf.Name("/Nameless")
    told = pikepdf.Dictionary(
        Type=pikepdf.Name("/FontDescriptor"),
        FontName=name,
        Flags=4,
        FontBBox=pikepdf.Array([0, 0, 500, 700]),
        ItalicAngle=0,
        Ascent=700,
        Descent=0,
        CapHeight=700,
        StemV=80,
    )
    glyphs = pikepdf.Dictionary(
        Type=pikepdf.Name("/Font"),
        Subtype=pikepdf.Name("/CIDFontType2"),
        BaseFont=name,
        CIDSystemInfo=system,
        FontDescriptor=told,
        DW=500,
    )
    return pikepdf.Dictionary(
        Type=pikepdf.Name("/Font"),
        Subtype=pikepdf.Name("/Type0"),
        BaseFont=name,
        Encoding=pikepdf.Name("/Identity-H"),
        DescendantFonts=pikepdf.Array([glyphs]),
    )


def test_a_font_that_does_not_name_its_characters_has_no_words() -> None:
    codes = "".join(f"{0xF800 + k:04x}" for k in range(30))
    picture = page_of(f"BT /F1 12 Tf 10 200 Td <{codes}> Tj ET", font=font_without_a_map())
    assert picture.origin == "page" or typeset(picture).words == ()


@pytest.mark.parametrize(
    ("more", "note", "pictures"),
    [
        ("0 0 50 50 re f ", False, False),
        ("0 0 m 50 0 50 50 0 50 c f ", False, True),
        ("0 0 m 50 0 50 50 0 50 c S ", False, False),
        ("", True, True),
    ],
    ids=["rectangle", "letters as outlines", "line", "annotation"],
)
def test_what_else_may_be_print(more: str, note: bool, pictures: bool) -> None:
    assert typeset(page_of(more + show("A line of text"), note=note)).has_pictures == pictures


def test_an_image_may_have_print() -> None:
    upload = set_in_type("words and " * 40, image=True)
    assert typeset(picture_of(upload)).has_pictures
