"""Operations of kept pages: the real ones, of small pages."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from services import errors
from services.contract.images import Encoding, PageReply
from services.contract.kept_pages import KeptPage as KeptPhoto
from services.contract.kept_pages import PageReading, PageWish, RenderedPage
from services.contract.rectify import RectifyParameters


def kept_photo(parameters: RectifyParameters) -> KeptPhoto:
    """A real page of 80 x 60 pixels that is kept: red at its top, blue at its foot."""
    import numpy as np

    from services.imaging.codec import encode_image
    from services.imaging.page_images import PagePicture
    from services.operations.rectify import describe_page
    from services.rectify.kept_photo import keep_photo

    pixels = np.zeros((60, 80, 3), np.uint8)
    pixels[:30, :, 0] = pixels[30:, :, 2] = 200
    photo = PagePicture(pixels, None, "png", original=encode_image(pixels, "png"))
    result = keep_photo(pixels, errors.NoText("nothing is seen."))
    kept = describe_page(result, parameters, Encoding("json", max_width=40), photo).kept
    assert kept is not None
    return kept


MARKUP_READ = "<script>document.title='ran'</script><img/src=x/onerror=document.title='ran'>"
"""The only word of each kept page."""


@contextmanager
def _reading_markup() -> Iterator[None]:
    from services.ocr.engine import Word
    from services.operations import kept_text
    from services.text.page_text import PageText, ReadLine, TextBlock

    def read(view: Any, engine: object, language: str, mesh: Any, printed: object) -> PageText:
        line = ReadLine((Word(MARKUP_READ, (10.0, 20.0, 70.0, 26.0), 0.9),))
        places = (((10.0, 20.0), (70.0, 20.0), (70.0, 26.0), (10.0, 26.0)),)
        return PageText(view.shape[1], view.shape[0], language, (TextBlock((line,)),), places)

    with patch.object(kept_text, "read_flat_page", read):
        yield


def render_kept_page(
    kept: KeptPhoto, wish: PageWish, encoding: Encoding, reading: PageReading | None = None
) -> tuple[PageReply, RenderedPage]:
    """The real operation, of a small page, on which `MARKUP_READ` is read."""
    from services.operations import kept_pages

    with _reading_markup():
        return kept_pages.render_kept_page(kept, wish, encoding, reading)


def bind_kept_pages(
    pages: list[KeptPhoto], encoding: Encoding, reading: PageReading | None = None
) -> PageReply:
    """The real operation, of small pages."""
    from services.operations import kept_pages

    with _reading_markup():
        return kept_pages.bind_kept_pages(pages, encoding, reading)


def show_kept_photo(bundle: bytes, width: int | None) -> bytes:
    """The real operation, of a small photo."""
    from services.operations import kept_pages

    return kept_pages.show_kept_photo(bundle, width)
