"""Pages of the size of a letter at 300 dpi whose text never recurs: parts of them can be told apart."""

import functools

import cv2
import numpy as np

from simulation import texts
from simulation.flat_page import Page
from simulation.pages import Block, Setting, set_page

BOOKS = (texts.MOBY_DICK, texts.TWO_CITIES, texts.ALICE, texts.WALDEN, texts.PRIDE_AND_PREJUDICE)


@functools.lru_cache(maxsize=2)
def letter_pages(width: int = 2550, height: int = 3300) -> tuple[Page, ...]:
    """Four pages of 11 point type: one column, ragged, two columns, and in colour with pictures."""
    return (
        _letter_page("letter-1", (0, 1, 2, 3, 4), width, height),
        _letter_page("letter-2", (3, 4, 0, 2, 1), width, height, justified=False),
        _letter_page("letter-3", (2, 0, 4, 1, 3), width, height, columns=2),
        colour_page(width, height),
    )


def colour_page(width: int = 2550, height: int = 3300) -> Page:
    """A page with coloured pictures and a tinted heading."""
    plain = _letter_page("letter-4", (4, 2, 1, 3), width, height, pictures=True)
    image = np.repeat(plain.image[..., None], 3, axis=2).astype(np.float32)
    rng = np.random.default_rng(4)
    # Pictures are where many grays are: their tones get hues that drift; ink and paper stay as they are.
    tones = ((plain.image > 24) & (plain.image < 236)).astype(np.float32)
    picture = cv2.boxFilter(tones, -1, (61, 61)) > 0.8
    picture = np.asarray(cv2.dilate(picture.astype(np.uint8), np.ones((61, 61), np.uint8)), np.uint8)
    hues = np.asarray(
        cv2.resize(rng.uniform(0.45, 1.0, (9, 7, 3)), (width, height), interpolation=cv2.INTER_CUBIC),
        np.float32,
    )
    image = np.where(picture[..., None] > 0, image * np.clip(hues, 0, 1), image)
    first = plain.lines[0]
    top, foot = int(first[0].box[1]) - 8, int(max(word.box[3] for word in first)) + 8
    heading = image[max(top, 0) : foot]
    heading[...] = 255 - (255 - heading) * np.array([0.25, 0.9, 0.95], np.float32)
    return Page(np.clip(image, 0, 255).astype(np.uint8), plain.lines, name="letter-colour")


def _letter_page(
    name: str,
    order: tuple[int, ...],
    width: int,
    height: int,
    *,
    columns: int = 1,
    justified: bool = True,
    pictures: bool = False,
) -> Page:
    blocks: list[Block] = []
    for number, book in enumerate(order, 1):
        blocks.append(Block("heading", f"{number} {' '.join(BOOKS[book][0].split()[:4]).strip('.,')}"))
        blocks += [Block("paragraph", text) for text in BOOKS[book]]
        if pictures and number in (1, 3):
            blocks.append(Block("picture", height_lines=8))
    body = max(8, round(46 * width / 2550))
    return set_page(tuple(blocks), Setting(width, height, body, columns=columns, justified=justified), name)
