"""Lines of words: print of dots has no lines in its ink, signs and words beside a line are part of it."""

import cv2
import numpy as np

from services.arrays import GrayImage
from services.layout.segmentation import compose_page, segment_finely
from services.ocr.engine import Word

ROWS = (
    (160, "ACME TRADING LTD"),
    (200, "12 & 14 HILL ROAD, 40300 SPRINGFIELD"),
    (280, "DATE: 05/08/2017"),
    (340, "COFFEE LARGE"),
    (380, "TEA AND CAKE"),
    (460, "TOTAL"),
    (540, "THANK YOU PLEASE COME AGAIN"),
)
AMOUNTS = ((340, "4.20"), (380, "7.80"), (460, "12.00"))


def slip() -> tuple[GrayImage, list[Word]]:
    """Rows of solid print with amounts in a column of their own, and their words as a perfect engine reads them."""
    image = np.full((700, 900), 255, np.uint8)
    words = []
    for y, row, left in [*((y, row, 60) for y, row in ROWS), *((y, row, 760) for y, row in AMOUNTS)]:
        x = left
        for text in row.split(" "):
            width = 17 * len(text)
            for place, letter in enumerate(text):
                cv2.putText(image, letter, (x + 17 * place, y), cv2.FONT_HERSHEY_SIMPLEX, 0.72, 0, 2)
            words.append(Word(text, (x - 1.0, y - 17.0, x + width - 1.0, y + 2.0), 0.95))
            x += width + 15
    return image, words


def dotted(image: GrayImage) -> GrayImage:
    """As print of pins: dots of two pixels, three apart."""
    dots = np.zeros(image.shape, bool)
    for dy in (0, 1):
        for dx in (0, 1):
            dots[dy::4, dx::4] = True
    return np.where(dots, image, 255).astype(np.uint8)


def test_words_make_the_lines_of_dotted_print() -> None:
    image, words = slip()
    fine = segment_finely(dotted(image), words)
    texts = [text for text in fine.texts if text]
    assert sorted(texts) == sorted(row for _, row in (*ROWS, *AMOUNTS))
    assert {word.text for own in fine.words for word in own} == {word.text for word in words}
    for text, box in zip(fine.texts, fine.boxes.tolist(), strict=True):
        own = np.array([word.box for word in words if word.text in text.split(" ")])
        assert not text or (own[:, 0].min() >= box[0] - 1 and own[:, 2].max() <= box[2] + 1)


def test_solid_print_has_its_lines_from_its_ink() -> None:
    image, words = slip()
    fine = segment_finely(image, words)
    assert sorted(text for text in fine.texts if text) == sorted(row for _, row in (*ROWS, *AMOUNTS))
    assert all(len(line.members) for line in fine.lines)
    without = segment_finely(dotted(image), None)
    assert without.texts == ("",) * len(without.texts), "nobody read it"


def test_signs_between_words_are_part_of_the_line() -> None:
    image, words = slip()
    marks = [Word("-", (30.0, 185.0, 45.0, 190.0), 0.9), Word("|", (300.0, 180.0, 304.0, 202.0), 0.9)]
    texts = segment_finely(image, [*words, *marks]).texts
    assert "12 & 14 HILL ROAD, 40300 SPRINGFIELD" in texts, "a dash before the line and a bar in it are none"


def test_a_word_beside_a_line_is_part_of_it() -> None:
    image, words = slip()
    image[183:203, 560:] = 255  # the end of the second row is too pale for ink
    fine = segment_finely(image, words)
    place = fine.texts.index("12 & 14 HILL ROAD, 40300 SPRINGFIELD")
    last = next(word for word in words if word.text == "SPRINGFIELD")
    assert fine.boxes[place][2] >= last.box[2]
    assert fine.lines[place].box[2] * fine.scale >= last.box[2] - 1
    far = [Word("lost", (860.0, 183.0, 895.0, 202.0), 0.9)]
    assert "lost" not in " ".join(segment_finely(image, [*words, *far]).texts), "it stands too far away"
    zones = compose_page(fine).zones
    assert any("SPRINGFIELD" in zone.text and zone.box[2] >= last.box[2] for zone in zones)
