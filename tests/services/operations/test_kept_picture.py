"""Pictures that are kept: of bounded size, and of the whole page."""

import io

import numpy as np
import pytest
from PIL import Image

from services.errors import TooLarge
from services.operations.kept_picture import encode_kept_picture, resize_kept_picture

RNG = np.random.default_rng(5)
NOISE = RNG.integers(0, 256, (600, 400, 3), dtype=np.uint8)
"""The most bytes that a page of this size can have."""


def size_of(picture: bytes) -> tuple[int, int]:
    with Image.open(io.BytesIO(picture)) as opened:
        assert opened.format == "JPEG"
        return opened.size


def test_a_picture_that_fits_keeps_its_size() -> None:
    page = np.full((600, 400, 3), 255, np.uint8)
    kept = encode_kept_picture(page, 2**20)
    assert (kept.width, kept.height) == size_of(kept.body) == (400, 600)
    assert kept.describe().model_dump() == {"width": 400, "height": 600, "bytes": len(kept.body)}


@pytest.mark.parametrize("most_bytes", [100_000, 20_000, 3_000])
def test_a_larger_one_is_reduced_until_it_fits(most_bytes: int) -> None:
    kept = encode_kept_picture(NOISE, most_bytes)
    assert 0.2 * most_bytes < len(kept.body) <= most_bytes
    assert (kept.width, kept.height) == size_of(kept.body)
    assert kept.width / kept.height == pytest.approx(400 / 600, rel=0.05)


def test_what_no_picture_can_meet_is_refused() -> None:
    with pytest.raises(TooLarge, match="keep_image"):
        encode_kept_picture(NOISE, 100)


@pytest.mark.parametrize("width", [1, 50, 200, 399])
def test_a_picture_is_made_smaller(width: int) -> None:
    page = np.zeros((600, 400, 3), np.uint8)
    page[:, 200:] = 255
    small = resize_kept_picture(encode_kept_picture(page, 2**20).body, width)
    assert size_of(small) == (width, max(1, round(600 * width / 400)))
    with Image.open(io.BytesIO(small)) as opened:
        pixels = np.asarray(opened.convert("L"), float)
    assert pixels.mean() == pytest.approx(127.5, abs=3)


def test_a_picture_is_never_enlarged() -> None:
    picture = encode_kept_picture(NOISE, 2**20).body
    assert resize_kept_picture(picture, 400) is picture
    assert resize_kept_picture(picture, 30_000) is picture
