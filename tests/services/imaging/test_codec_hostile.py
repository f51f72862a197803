"""Files that are damaged, or made to cost: the right error, at once, whatever they claim."""

import io
import struct
import time
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from services.contract.images import ImageLimits
from services.errors import DocumentError, TooLarge, UndecodableImage, UnsupportedMediaType
from services.imaging.codec import decode_image
from tests.services.imaging.files import (
    insert_segments,
    make_file,
    make_png,
    make_tiff,
    pack_chunk,
    pack_directory,
    pack_segment,
)

LIMITS = ImageLimits()
NOISE: NDArray[np.uint8] = np.random.default_rng(5).integers(0, 256, (120, 160, 3), dtype=np.uint8)
JPEG = make_file(NOISE, "JPEG", quality=85)
ROWS = zlib.compress(b"".join(b"\0" + row.tobytes() for row in NOISE))
PNG = make_png(160, 120, ROWS)
LONGEST_S = 5.0
"""Generous, for a loaded machine: each of these takes milliseconds here, and minutes without the gates."""


def _cmyk_jpeg() -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(NOISE).convert("CMYK").save(buffer, "JPEG")
    return buffer.getvalue()


WHOLE_FILES = {
    "jpeg": JPEG,
    "progressive jpeg": make_file(NOISE, "JPEG", progressive=True),
    "cmyk jpeg": _cmyk_jpeg(),
    "png": PNG,
    "webp": make_file(NOISE, "WEBP"),
    "lossless webp": make_file(NOISE, "WEBP", lossless=True),
    "tiff": make_file(NOISE, "TIFF"),
    "lzw tiff": make_file(NOISE, "TIFF", compression="tiff_lzw"),
    "deflate tiff": make_file(NOISE, "TIFF", compression="tiff_adobe_deflate"),
    "heic": make_file(NOISE, "HEIF"),
}


def refused_at_once(data: bytes, error: type[DocumentError], limits: ImageLimits = LIMITS) -> str:
    """Detail of the error that `data` is refused with."""
    started = time.process_time()
    with pytest.raises(error) as caught:
        decode_image(data, limits)
    assert time.process_time() - started < LONGEST_S
    assert type(caught.value) is error
    assert " at 0x" not in caught.value.detail
    return caught.value.detail


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"hello",
        b"\xff\xd8",
        b"<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/>",
        b"<!doctype html><title>photo.jpg</title>",
        b"%PDF-1.7\n",
        b"PK\x03\x04" + bytes(40),
        b"\x00\x00\x00\x0cjP  \r\n\x87\n" + bytes(40),
        b"\x00\x00\x00\x1cftypavif" + bytes(40),
        b"\x00\x00\x00\x1cftypmp42" + bytes(40),
        b"RIFF\x24\x00\x00\x00WAVEfmt " + bytes(40),
        b"hidden" + JPEG,
        make_file(NOISE, "GIF"),
        make_file(NOISE, "BMP"),
        make_file(NOISE, "PPM"),
    ],
    ids=lambda data: repr(data[:12]),
)
def test_what_is_no_accepted_image(data: bytes) -> None:
    refused_at_once(data, UnsupportedMediaType)


def test_samples_that_are_no_pictures_are_unsupported() -> None:
    refused_at_once(make_file(np.zeros((9, 9), np.float32), "TIFF"), UnsupportedMediaType)
    refused_at_once(make_file(np.zeros((9, 9), np.int32), "TIFF"), UnsupportedMediaType)


@pytest.mark.parametrize("name", WHOLE_FILES)
@given(kept=st.floats(0, 1, exclude_max=True))
@settings(max_examples=15, deadline=None)
def test_every_truncated_file_is_refused(name: str, kept: float) -> None:
    whole = WHOLE_FILES[name]
    decode_image(whole, LIMITS)
    shortest = 40  # below, it may be too short to be recognized
    refused_at_once(whole[: shortest + int(kept * (len(whole) - shortest))], UndecodableImage)


@pytest.mark.parametrize("name", WHOLE_FILES)
@given(position=st.floats(0, 1), damage=st.binary(min_size=1, max_size=64))
@settings(max_examples=25, deadline=None)
def test_damage_gives_an_error_or_a_picture_and_always_the_same(
    name: str, position: float, damage: bytes
) -> None:
    whole = WHOLE_FILES[name]
    at = int(position * (len(whole) - len(damage)))
    damaged = whole[:at] + damage + whole[at + len(damage) :]
    answers: list[object] = []
    for _ in range(2):
        started = time.process_time()
        try:
            answers.append(decode_image(damaged, LIMITS).pixels.tobytes())
        except DocumentError as error:
            answers.append((error.code, error.detail))
        assert time.process_time() - started < LONGEST_S
    assert answers[0] == answers[1]


def test_lost_and_zeroed_jpeg_data_is_refused() -> None:
    restarts = make_file(NOISE, "JPEG", restart_marker_rows=1)
    first, second = restarts.index(b"\xff\xd0", 700), restarts.index(b"\xff\xd1", 700)
    refused_at_once(restarts[:first] + restarts[second:], UndecodableImage)
    middle = len(JPEG) // 2
    refused_at_once(JPEG[:middle] + JPEG[middle + 3000 :], UndecodableImage)


def test_one_wrong_bit_in_a_png_is_refused() -> None:
    at = PNG.index(b"IDAT") + 500
    refused_at_once(PNG[:at] + bytes([PNG[at] ^ 1]) + PNG[at + 1 :], UndecodableImage)


def _exif_block(size: int) -> bytes:
    return b"Exif\0\0II*\0\x08\0\0\0" + bytes(size - 14)


def _last_scan_repeated(times: int) -> bytes:
    progressive = WHOLE_FILES["progressive jpeg"]
    last = progressive.rindex(b"\xff\xda")
    return progressive[:-2] + progressive[last:-2] * times + progressive[-2:]


def _webp_of(kind: bytes, header: bytes) -> bytes:
    body = b"WEBP" + kind + struct.pack("<I", len(header)) + header
    return b"RIFF" + struct.pack("<I", len(body)) + body


def _size_lie(heic: bytes, width: int, height: int) -> bytes:
    at = heic.index(b"ispe") + 8
    return heic[:at] + struct.pack(">II", width, height) + heic[at + 8 :]


PIXELS_OF_TIFF = [(258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (277, 3, 1, 1)]
SMALL_TIFF = [(256, 3, 1, 100), (257, 3, 1, 100), *PIXELS_OF_TIFF]


def _deflated_zeros(blocks: int) -> bytes:
    """A zlib stream of `blocks` times 16 MiB of zeros. The compressed block is repeated, which takes no time."""
    size = 2**24
    deflate = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    block = deflate.compress(bytes(size)) + deflate.flush(zlib.Z_FULL_FLUSH)
    checksum = (blocks * size % 65521) << 16 | 1
    return b"\x78\xda" + blocks * block + b"\x03\0" + struct.pack(">I", checksum)


GIGABYTE_OF_ZEROS = _deflated_zeros(64)
TEXT_MEGABYTE = pack_chunk(b"zTXt", b"k\0\0" + zlib.compress(bytes(2**20 - 99), 9))


@pytest.mark.parametrize(
    ("data", "error"),
    [
        pytest.param(make_png(60_000, 60_000, ROWS), TooLarge, id="png of 3600 megapixels"),
        pytest.param(make_png(2**31 - 1, 2**31 - 1, b""), TooLarge, id="png of 4 exapixels"),
        pytest.param(make_png(40_000, 2, ROWS), TooLarge, id="png with a side that nothing can warp"),
        pytest.param(make_png(0, 0, ROWS), UndecodableImage, id="png of no size"),
        pytest.param(make_png(0, 9, ROWS), UndecodableImage, id="png of no width"),
        pytest.param(make_png(160, 999, ROWS), UndecodableImage, id="png with too little data"),
        pytest.param(make_png(9, 9, ROWS, depth=3), UndecodableImage, id="png of 3 bits"),
        pytest.param(
            make_png(9, 9, ROWS, before=pack_chunk(b"eXIf", bytes(2**20))),
            TooLarge,
            id="png with 1 MB of EXIF",
        ),
        pytest.param(
            make_png(9, 9, ROWS, before=pack_chunk(b"tEXt", b"a\0b") * 300_000),
            UndecodableImage,
            id="png of many chunks",
        ),
        pytest.param(
            make_png(9, 9, ROWS, before=pack_chunk(b"zTXt", b"k\0\0" + GIGABYTE_OF_ZEROS)),
            UndecodableImage,
            id="png with a compressed gigabyte of text",
        ),
        pytest.param(
            make_png(9, 9, ROWS, before=pack_chunk(b"iCCP", b"k\0\0" + GIGABYTE_OF_ZEROS)),
            UndecodableImage,
            id="png with a compressed gigabyte of profile",
        ),
        pytest.param(
            make_png(9, 9, ROWS, before=TEXT_MEGABYTE * 100), UndecodableImage, id="png with 100 MB of text"
        ),
        pytest.param(
            insert_segments(JPEG, pack_segment(0xE1, _exif_block(65_000)) * 500),
            TooLarge,
            id="jpeg, 32 MB of EXIF",
        ),
        pytest.param(
            insert_segments(JPEG, pack_segment(0xFE, b"") * 1_000_000),
            UndecodableImage,
            id="jpeg of many segments",
        ),
        pytest.param(insert_segments(JPEG, b"\xff" * 10_000_000), UndecodableImage, id="jpeg of fill bytes"),
        pytest.param(_last_scan_repeated(2000), UndecodableImage, id="jpeg of 2000 scans"),
        pytest.param(
            JPEG.replace(
                b"\xff\xc0\0\x11\x08" + struct.pack(">HH", 120, 160), b"\xff\xc0\0\x11\x08" + b"\xff" * 4
            ),
            TooLarge,
            id="jpeg of 4295 megapixels",
        ),
        pytest.param(
            JPEG.replace(
                b"\xff\xc0\0\x11\x08" + struct.pack(">HH", 120, 160), b"\xff\xc0\0\x11\x08" + b"\0" * 4
            ),
            UndecodableImage,
            id="jpeg of no size",
        ),
        pytest.param(b"\xff\xd8\xff" + b"a" * 999, UndecodableImage, id="jpeg of its mark alone"),
        pytest.param(
            _webp_of(b"VP8L", b"\x2f" + struct.pack("<I", 16383 | 16383 << 14)),
            TooLarge,
            id="webp of 33 bytes",
        ),
        pytest.param(_webp_of(b"VP8X", bytes(4) + b"\xff" * 6), TooLarge, id="webp of 281 terapixels"),
        pytest.param(
            _webp_of(b"VP8 ", b"\0\0\0\x9d\x01\x2a" + b"\xff\x3f" * 2),
            TooLarge,
            id="lossy webp of 268 megapixels",
        ),
        pytest.param(_webp_of(b"VP8X", bytes(10)), UndecodableImage, id="webp without a frame"),
        pytest.param(_webp_of(b"VP8L", bytes(9)), UndecodableImage, id="webp of zeros"),
        pytest.param(_size_lie(WHOLE_FILES["heic"], 60_000, 60_000), TooLarge, id="heic of 3600 megapixels"),
        pytest.param(_size_lie(WHOLE_FILES["heic"], 16, 16), UndecodableImage, id="heic larger than it says"),
        pytest.param(
            make_file(NOISE, "HEIF", exif=_exif_block(2**20)), TooLarge, id="heic with 1 MB of EXIF"
        ),
        pytest.param(
            make_file(NOISE, "WEBP", exif=_exif_block(2**20)), TooLarge, id="webp with 1 MB of EXIF"
        ),
        pytest.param(b"\0\0\0\x18ftypheic" + bytes(99), UndecodableImage, id="heic of its mark alone"),
        pytest.param(
            b"\0\0\0\x18ftypheic\0\0\0\0heicmif1" + b"\0\0\0\x08free" * 500_000,
            UndecodableImage,
            id="heic of boxes",
        ),
        pytest.param(
            pack_directory(
                [(256, 4, 1, 60_000), (257, 4, 1, 60_000), *PIXELS_OF_TIFF, (273, 4, 1, 8), (279, 4, 1, 9)]
            ),
            TooLarge,
            id="tiff of 3600 megapixels",
        ),
        pytest.param(make_tiff(0, 0, b""), UndecodableImage, id="tiff of no size"),
        pytest.param(
            pack_directory(
                [*SMALL_TIFF, (322, 4, 1, 60_000), (323, 4, 1, 60_000), (324, 4, 1, 8), (325, 4, 1, 99)]
            ),
            TooLarge,
            id="tiff of 3600-megapixel tiles",
        ),
        pytest.param(
            pack_directory([*SMALL_TIFF, (273, 4, 5_000_000, 200), (279, 4, 5_000_000, 200)])
            + bytes(20_000_000),
            UndecodableImage,
            id="tiff of 5 million strips",
        ),
        pytest.param(
            pack_directory([(256, 3, 1, 99), (257, 3, 1, 99), (258, 3, 9_000_000, 100)]) + bytes(18_000_000),
            UndecodableImage,
            id="tiff of 9 million samples",
        ),
        pytest.param(
            pack_directory([(tag, 4, 1, 0) for tag in range(60_000)]),
            UndecodableImage,
            id="tiff of 60,000 tags",
        ),
        pytest.param(
            pack_directory([(tag, 7, 30_000, 8) for tag in range(1000)]) + bytes(30_000),
            UndecodableImage,
            id="tiff whose tags share their bytes",
        ),
        pytest.param(
            b"II+\0\x08\0\0\0" + struct.pack("<QQ", 16, 2**40) + bytes(999),
            UndecodableImage,
            id="bigtiff of 2^40 tags",
        ),
        pytest.param(
            b"II*\0" + b"\xff" * 4 + bytes(99), UndecodableImage, id="tiff whose directory is elsewhere"
        ),
        pytest.param(
            pack_directory(SMALL_TIFF)[:-4] + b"\x08\0\0\0", UndecodableImage, id="tiff without pixels"
        ),
    ],
)
def test_costly_and_senseless_files_are_refused(data: bytes, error: type[DocumentError]) -> None:
    refused_at_once(data, error)


@pytest.mark.parametrize("name", ["jpeg", "png", "webp", "tiff", "heic"])
def test_limits_are_reached_before_they_are_crossed(name: str) -> None:
    data, pixels = WHOLE_FILES[name], 120 * 160
    exact = ImageLimits(max_megapixels=pixels / 1e6, max_bytes=len(data), max_side_px=160)
    assert decode_image(data, exact).pixels.shape == (120, 160, 3)
    assert "megapixels" in refused_at_once(data, TooLarge, ImageLimits(max_megapixels=(pixels - 1) / 1e6))
    assert "bytes" in refused_at_once(data, TooLarge, ImageLimits(max_bytes=len(data) - 1))
    assert "a side" in refused_at_once(data, TooLarge, ImageLimits(max_side_px=159))


def test_exif_of_the_largest_allowed_size_is_read_at_once() -> None:
    entries = b"".join(struct.pack("<HHII", tag % 65_536, 4, 1, tag) for tag in range(5000))
    block = b"II*\0\x08\0\0\0" + struct.pack("<H", 5000) + entries
    segments = pack_segment(0xE1, b"Exif\0\0" + block)
    segments += pack_segment(0xE1, b"Exif\0\0" + bytes(65_000)) * 3
    started = time.process_time()
    assert decode_image(insert_segments(JPEG, segments), LIMITS).pixels.shape == (120, 160, 3)
    assert time.process_time() - started < LONGEST_S
