"""Where lines part that stand near each other, and where they do not: drawn lines of print."""

import cv2
import numpy as np

from services.arrays import GrayImage
from services.layout.page import Zone
from services.layout.segmentation import segment_page

WIDTH, HEIGHT = 1000, 1400
FONT = cv2.FONT_HERSHEY_SIMPLEX


def blank() -> GrayImage:
    return np.full((HEIGHT, WIDTH), 255, dtype=np.uint8)


def put(image: GrayImage, text: str, x: int, y: int, size: float = 0.7, *, width: int | None = None) -> int:
    """Draw a line from x on, its baseline at y, its words spread over `width` px if that is given; its end."""
    glyphs: list[GrayImage | None] = []
    for letter in text:
        canvas = np.full((80, 80), 255, dtype=np.uint8)
        cv2.putText(canvas, letter, (20, 50), FONT, size, 0, 2, cv2.LINE_AA)
        inked = np.flatnonzero(np.min(canvas, axis=0) < 200)
        glyphs.append(canvas[:, inked[0] : inked[-1] + 1] if len(inked) else None)
    drawn = sum(glyph.shape[1] + 3 for glyph in glyphs if glyph is not None)
    space = 9.0 if width is None else (width - drawn) / max(text.count(" "), 1)
    at = float(x)
    for glyph in glyphs:
        if glyph is None:
            at += space
            continue
        target = image[y - 50 : y + 30, round(at) : round(at) + glyph.shape[1]]
        np.minimum(target, glyph, out=target)
        at += glyph.shape[1] + 3
    return round(at) - 3


def lean(image: GrayImage, y: int) -> None:
    """Shear the line with its baseline at y as italics lean."""
    band = image[y - 40 : y + 20]
    shear = np.array([[1.0, -0.25, 0.25 * 40], [0.0, 1.0, 0.0]])
    band[:] = cv2.warpAffine(band, shear, (WIDTH, len(band)), flags=cv2.INTER_LINEAR, borderValue=255)


def centred(image: GrayImage, text: str, y: int, width: int) -> None:
    put(image, text, (WIDTH - width) // 2, y, width=width)


def text_zones(image: GrayImage) -> list[Zone]:
    return [zone for zone in segment_page(image, None).zones if zone.kind == "text"]


def lines_of_zones(image: GrayImage) -> list[int | None]:
    """Lines of every zone from the top down."""
    return [zone.lines for zone in sorted(text_zones(image), key=lambda zone: zone.box[1])]


def running_foot(y: int, size: float, gap: int) -> GrayImage:
    image = blank()
    end = put(image, "Journal of Drawn Print, volume four", 100, y, 0.7)
    put(image, "12", end + gap, y, size)
    return image


def test_a_larger_number_at_the_end_of_a_running_foot_is_a_zone_of_its_own() -> None:
    assert len(text_zones(running_foot(1350, 0.9, 16))) == 2


def test_a_number_far_from_the_words_of_a_running_head_is_a_zone_of_its_own() -> None:
    assert len(text_zones(running_foot(60, 0.7, 50))) == 2


def test_a_number_among_the_words_of_a_line_is_one_of_them() -> None:
    assert len(text_zones(running_foot(1350, 0.7, 9))) == 1
    assert len(text_zones(running_foot(700, 0.9, 16))) == 1


def test_a_centred_line_in_italics_is_not_of_the_upright_one_below() -> None:
    image = blank()
    centred(image, "Institute for Drawing Straight Lines", 200, 450)
    upright = image.copy()
    lean(image, 200)
    for each in (image, upright):
        centred(each, "Dated: December twelfth, ninety", 230, 400)
    assert lines_of_zones(upright) == [2]
    assert lines_of_zones(image) == [1, 1]


def test_a_line_in_italics_within_a_paragraph_stays_in_it() -> None:
    image = blank()
    for row, text in enumerate(
        ["Lines of running text fill", "their column from its left", "edge to the right edge"]
    ):
        put(image, text, 100, 300 + 30 * row, width=320)
        if row == 1:
            lean(image, 330)
    assert lines_of_zones(image) == [3]


def test_a_line_without_capitals_and_ascenders_stays_in_its_paragraph() -> None:
    image = blank()
    rows = [
        "The third of these lines has",
        "neither Capitals nor the like:",
        "sorrow, so vacuous, seems a",
    ]
    for row, text in enumerate([*rows, "But the Lines about it do, and", "are of the Paragraph as much"]):
        put(image, text, 100, 300 + 30 * row, width=370)
    assert lines_of_zones(image) == [5]


def letter_with_foot(rows: list[tuple[int, str]]) -> GrayImage:
    image = blank()
    for row in range(5):
        put(image, "This is the body of a letter that is drawn", 100, 300 + 30 * row, width=520)
    for number, (indent, text) in enumerate(rows):
        put(image, text, 100 + indent, 1000 + 24 * number, 0.6)
    return image


def test_initials_and_enclosures_are_zones_each() -> None:
    assert lines_of_zones(letter_with_foot([(0, "JRB:tc"), (0, "Enclosures")])) == [5, 1, 1]


def test_names_under_each_other_are_of_their_label_and_end_before_the_next() -> None:
    rows = [(0, "cc:"), (40, "Lee Kennedy"), (40, "Henry Young"), (0, "Attachments")]
    image = letter_with_foot(rows)
    put(image, "Adam Smith", 140, 1000, 0.6)
    assert lines_of_zones(image) == [5, 3, 1]


def test_two_lines_of_an_address_are_one_zone() -> None:
    assert lines_of_zones(letter_with_foot([(0, "Edward King Junior"), (0, "President")])) == [5, 2]
