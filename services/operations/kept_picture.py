"""The picture of a page that is kept with its result: a JPEG file of a bounded number of bytes."""

import io
from dataclasses import dataclass

import numpy as np
from PIL import Image

from services.arrays import RgbImage
from services.contract.answers.layout import KeptImage
from services.errors import TooLarge
from services.imaging.codec import encode_image
from services.operations.reduced_views import reduce_picture, reduced_size

PICTURE_QUALITY = 85
"""Print stays clear, and an A4 page at 200 dpi has 0.5 MB."""
_FILLED = 0.9
"""Share of the bytes that a smaller picture aims at; bytes fall somewhat slower than pixels."""


@dataclass(frozen=True, slots=True)
class KeptPicture:
    """A JPEG file of a page, and its size in pixels. It shows the whole page, perhaps with fewer pixels."""

    body: bytes
    width: int
    height: int

    def describe(self) -> KeptImage:
        """The `image` of an answer."""
        return KeptImage(width=self.width, height=self.height, bytes=len(self.body))


def encode_kept_picture(page: RgbImage, most_bytes: int) -> KeptPicture:
    """The picture of `page` (H, W, 3), reduced until its file has at most `most_bytes` bytes.

    Raises
    ------
    TooLarge
        When no picture of the page is that small.
    """
    height, width = page.shape[:2]
    while True:
        small = (
            page if (width, height) == (page.shape[1], page.shape[0]) else reduce_picture(page, width, height)
        )
        body = encode_image(small, "jpeg", PICTURE_QUALITY)
        if len(body) <= most_bytes:
            return KeptPicture(body, width, height)
        if max(width, height) == 1:
            raise TooLarge(f"keep_image: no picture has only {most_bytes} bytes.", "keep_image")
        share = min(0.8, float(np.sqrt(_FILLED * most_bytes / len(body))))
        width, height = max(1, int(width * share)), max(1, int(height * share))


def read_kept_picture(picture: bytes) -> RgbImage:
    """Pixels (H, W, 3) of a kept picture."""
    with Image.open(io.BytesIO(picture), formats=("JPEG",)) as opened:
        return np.asarray(opened.convert("RGB"))


def resize_kept_picture(picture: bytes, width: int) -> bytes:
    """A kept picture as a JPEG file of at most `width` pixels in width; it is never enlarged."""
    with Image.open(io.BytesIO(picture), formats=("JPEG",)) as opened:
        if opened.width <= width:
            return picture
        size = reduced_size(*opened.size, width, None)
        opened.draft("RGB", size)  # decodes half, a quarter or an eighth of the pixels where that is enough
        pixels = np.asarray(opened.convert("RGB"))
    return encode_image(reduce_picture(pixels, *size), "jpeg", PICTURE_QUALITY)
