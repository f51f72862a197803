"""Every accepted kind of picture gives the right pixels."""

import io
import re
import struct
import sys
import zlib
from importlib.util import find_spec, module_from_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from services.contract.images import ImageLimits
from services.errors import TooLarge, UndecodableImage, UnsupportedMediaType
from services.imaging.codec import count_pixels, decode_image
from tests.services.imaging.files import make_exif, make_file, make_png, make_tiff, pack_chunk

LIMITS = ImageLimits()


@pytest.fixture(scope="module")
def smooth() -> NDArray[np.uint8]:
    """(48, 64, 3): three different gradients, which lossy formats keep within a few levels."""
    row, column = np.mgrid[0:48, 0:64]
    return np.stack([column * 4, row * 5, 255 - column * 2 - row * 2], axis=-1).astype(np.uint8)


def pixels_of(data: bytes) -> NDArray[np.int64]:
    decoded = decode_image(data, LIMITS)
    assert decoded.pixels.dtype == np.uint8
    assert decoded.pixels.ndim == 3
    assert decoded.pixels.shape[2] == 3
    assert decoded.pixels.flags.c_contiguous
    return decoded.pixels.astype(np.int64)


@pytest.mark.parametrize(
    ("plugin", "options", "name", "tolerance"),
    [
        ("PNG", {}, "png", 0),
        ("TIFF", {}, "tiff", 0),
        ("TIFF", {"compression": "tiff_lzw"}, "tiff", 0),
        ("TIFF", {"compression": "tiff_adobe_deflate"}, "tiff", 0),
        ("TIFF", {"compression": "packbits"}, "tiff", 0),
        ("TIFF", {"compression": "jpeg", "quality": 95}, "tiff", 12),
        ("TIFF", {"big_tiff": True}, "tiff", 0),
        ("WEBP", {"lossless": True}, "webp", 0),
        ("WEBP", {"quality": 95}, "webp", 20),
        ("JPEG", {"quality": 95}, "jpeg", 12),
        ("JPEG", {"quality": 95, "subsampling": 0}, "jpeg", 6),
        ("JPEG", {"quality": 95, "progressive": True}, "jpeg", 12),
        ("JPEG", {"quality": 95, "keep_rgb": True}, "jpeg", 6),
        ("JPEG", {"quality": 95, "restart_marker_rows": 1}, "jpeg", 12),
        ("HEIF", {"quality": 95}, "heic", 20),
    ],
)
def test_colour_is_kept_in_every_format(
    smooth: NDArray[np.uint8], plugin: str, options: dict[str, object], name: str, tolerance: int
) -> None:
    data = make_file(smooth, plugin, **options)
    assert decode_image(data, LIMITS).format == name
    assert np.abs(pixels_of(data) - smooth).max() <= tolerance


@pytest.mark.parametrize("plugin", ["PNG", "TIFF", "JPEG", "WEBP"])
def test_gray_becomes_three_equal_channels(smooth: NDArray[np.uint8], plugin: str) -> None:
    gray = smooth[..., 0]
    pixels = pixels_of(make_file(gray, plugin, quality=95))
    assert np.abs(pixels - gray[..., None]).max() <= 5
    assert (pixels[..., 0] == pixels[..., 2]).all() or plugin == "WEBP"


@pytest.mark.parametrize("plugin", ["PNG", "TIFF"])
def test_one_bit(plugin: str) -> None:
    bits = np.eye(11, 17, dtype=bool)
    assert (pixels_of(make_file(bits, plugin)) == 255 * bits[..., None]).all()


def test_fax_page_where_zero_is_white() -> None:
    bits = np.eye(16, dtype=bool)
    buffer = io.BytesIO()
    Image.fromarray(bits).save(buffer, "TIFF", compression="group4")
    assert (pixels_of(buffer.getvalue()) == 255 * bits[..., None]).all()


def test_palette(smooth: NDArray[np.uint8]) -> None:
    picture = Image.fromarray(smooth).quantize(32)
    expected = np.asarray(picture.convert("RGB"))
    for plugin in ("PNG", "TIFF"):
        buffer = io.BytesIO()
        picture.save(buffer, plugin)
        assert (pixels_of(buffer.getvalue()) == expected).all()


@pytest.mark.parametrize("plugin", ["JPEG", "TIFF"])
def test_cmyk(plugin: str) -> None:
    # Cyan 100 %, yellow 50 %, black 20 %: red 0, green 80 %, blue 40 % of white.
    cmyk = np.full((32, 32, 4), [255, 0, 128, 51], np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(cmyk, "CMYK").save(buffer, plugin)
    assert np.abs(pixels_of(buffer.getvalue()) - [0, 204, 102]).max() <= 2


@pytest.mark.parametrize("plugin", ["PNG", "TIFF", "WEBP"])
@pytest.mark.parametrize("alpha", [0, 64, 255])
def test_transparency_shows_white_paper(plugin: str, alpha: int) -> None:
    rgba = np.full((9, 12, 4), [200, 100, 0, alpha], np.uint8)
    expected = np.round((np.array([200, 100, 0]) * alpha + 255.0 * (255 - alpha)) / 255)
    assert np.abs(pixels_of(make_file(rgba, plugin, lossless=True)) - expected).max() <= 1


def test_gray_with_alpha() -> None:
    gray_alpha = np.full((5, 6, 2), [40, 128], np.uint8)
    assert np.abs(pixels_of(make_file(gray_alpha, "PNG")) - (40 * 128 + 255 * 127) / 255).max() <= 1


def test_transparent_palette_entry_and_colour_key() -> None:
    palette = Image.fromarray(np.array([[0, 1]], np.uint8), "P")
    palette.putpalette([10, 20, 30, 40, 50, 60])
    buffer = io.BytesIO()
    palette.save(buffer, "PNG", transparency=0)
    assert pixels_of(buffer.getvalue()).tolist() == [[[255, 255, 255], [40, 50, 60]]]
    key = pack_chunk(b"tRNS", struct.pack(">3H", 1, 2, 3))
    rows = zlib.compress(b"\0" + bytes([1, 2, 3, 4, 5, 6]))
    assert pixels_of(make_png(2, 1, rows, before=key)).tolist() == [[[255, 255, 255], [4, 5, 6]]]


@pytest.mark.parametrize(("colour_type", "samples"), [(0, 1), (2, 3), (4, 2), (6, 4)])
def test_sixteen_bit_png_is_scaled(colour_type: int, samples: int) -> None:
    levels = np.arange(256, dtype=">u2") * 257  # 0 ... 65535
    rows = np.repeat(levels[:, None], samples, axis=1)
    if colour_type >= 4:
        rows[:, -1] = 65535
    data = make_png(256, 1, zlib.compress(b"\0" + rows.tobytes()), depth=16, colour_type=colour_type)
    assert (pixels_of(data)[0] == np.arange(256)[:, None]).all()


def test_sixteen_bit_png_with_a_colour_key_is_decoded() -> None:
    key = pack_chunk(b"tRNS", struct.pack(">3H", 257, 514, 771))
    rows = np.array([[30_000, 20_000, 10_000]], ">u2")
    data = make_png(1, 1, zlib.compress(b"\0" + rows.tobytes()), depth=16, before=key)
    assert np.abs(pixels_of(data)[0, 0] - rows[0].astype(int) / 257).max() <= 1


@pytest.mark.parametrize(
    ("order", "bits", "white_is_zero"),
    [("<", 8, False), (">", 8, True), ("<", 16, False), (">", 16, False), ("<", 16, True)],
)
def test_gray_tiff_depths(order: str, bits: int, white_is_zero: bool) -> None:
    levels = (np.arange(256) * (257 if bits == 16 else 1)).astype(f"{order}u{bits // 8}")
    data = make_tiff(256, 1, levels.tobytes(), bits=bits, photometric=0 if white_is_zero else 1, order=order)
    expected = 255 - np.arange(256) if white_is_zero else np.arange(256)
    assert (pixels_of(data)[0] == expected[:, None]).all()


def test_twelve_bit_tiff_is_scaled() -> None:
    levels = np.linspace(0, 4095, 256).round().astype(int)
    packed = b"".join(
        bytes([a >> 4, (a & 15) << 4 | b >> 8, b & 255])
        for a, b in zip(levels[::2], levels[1::2], strict=True)
    )
    pixels = pixels_of(make_tiff(256, 1, packed, bits=12))[0, :, 0]
    assert np.abs(pixels - levels * 255 / 4095).max() <= 0.5


def test_interlaced_png() -> None:
    rgb = np.arange(11 * 13 * 3).reshape(11, 13, 3).astype(np.uint8)
    passes = [
        (0, 0, 8, 8),
        (0, 4, 8, 8),
        (4, 0, 8, 4),
        (0, 2, 4, 4),
        (2, 0, 4, 2),
        (0, 1, 2, 2),
        (1, 0, 2, 1),
    ]
    rows = b"".join(
        b"\0" + row.tobytes() for top, left, down, right in passes for row in rgb[top::down, left::right]
    )
    assert (pixels_of(make_png(13, 11, zlib.compress(rows), interlaced=True)) == rgb).all()


@pytest.mark.parametrize("plugin", ["PNG", "WEBP", "TIFF"])
def test_of_several_frames_the_first(plugin: str) -> None:
    frames = [Image.new("RGB", (20, 10), colour) for colour in ("red", "green", "blue")]
    buffer = io.BytesIO()
    frames[0].save(buffer, plugin, save_all=True, append_images=frames[1:], lossless=True)
    assert (pixels_of(buffer.getvalue()) == [255, 0, 0]).all()


def test_of_a_photo_with_embedded_previews_the_photo(smooth: NDArray[np.uint8]) -> None:
    buffer = io.BytesIO()
    preview = Image.new("RGB", (8, 8), "blue")
    Image.fromarray(smooth).save(buffer, "MPO", save_all=True, append_images=[preview], quality=95)
    assert decode_image(buffer.getvalue(), LIMITS).format == "jpeg"
    assert np.abs(pixels_of(buffer.getvalue()) - smooth).max() <= 12


# The corners of a 2 x 3 picture, row by row, and where EXIF 2.32 (4.6.4, tag 274) says that they belong.
UPRIGHT = {
    1: [[1, 2], [3, 4], [5, 6]],
    2: [[2, 1], [4, 3], [6, 5]],
    3: [[6, 5], [4, 3], [2, 1]],
    4: [[5, 6], [3, 4], [1, 2]],
    5: [[1, 3, 5], [2, 4, 6]],
    6: [[5, 3, 1], [6, 4, 2]],
    7: [[6, 4, 2], [5, 3, 1]],
    8: [[2, 4, 6], [1, 3, 5]],
}


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("plugin", ["PNG", "WEBP", "TIFF"])
def test_exif_orientation_is_applied(plugin: str, orientation: int) -> None:
    stored = np.repeat(np.array([[1, 2], [3, 4], [5, 6]], np.uint8)[..., None] * 40, 3, axis=2)
    data = make_file(stored, plugin, exif=make_exif(orientation), lossless=True)
    assert (pixels_of(data)[..., 0] == np.array(UPRIGHT[orientation]) * 40).all()


@pytest.mark.parametrize("orientation", range(1, 9))
def test_jpeg_turns_as_png_does(smooth: NDArray[np.uint8], orientation: int) -> None:
    exif = make_exif(orientation)
    upright = pixels_of(make_file(smooth, "PNG", exif=exif))
    assert np.abs(pixels_of(make_file(smooth, "JPEG", exif=exif, quality=95)) - upright).max() <= 12


def test_heic_is_turned_once_by_its_container(smooth: NDArray[np.uint8]) -> None:
    # 48 rows are coded as 64 and clipped; turning the `clap` box into `irot` (3: clockwise) shows them all.
    data = make_file(smooth, "HEIF", exif=make_exif(6), quality=95)
    clip = data.index(b"clap") - 4
    turn = struct.pack(">I4sB", 9, b"irot", 3) + struct.pack(">I4s23x", 31, b"free")
    turned = pixels_of(data[:clip] + turn + data[clip + 40 :])
    assert turned.shape == (64, 64, 3)
    assert np.abs(turned[:, 16:] - np.rot90(smooth, -1)).max() <= 20


@pytest.mark.parametrize(
    "metadata",
    [
        b"Exif\0\0",
        b"Exif\0\0II*\0\x08\0\0\0\xff\xff",
        b"Exif\0\0MM\0*\xff\xff\xff\xff",
        b"Exif\0\0" + bytes(40),
        b"Exif\0\0II*\0\x08\0\0\0\1\0\x12\1\3\0\1\0\0\0\x63\0\0\0" + bytes(4),  # orientation 99
    ],
)
def test_damaged_metadata_costs_the_metadata_only(smooth: NDArray[np.uint8], metadata: bytes) -> None:
    data = make_file(smooth, "JPEG", exif=metadata, quality=95)
    assert np.abs(pixels_of(data) - smooth).max() <= 12


def test_harmless_oddities_of_jpeg_are_accepted(smooth: NDArray[np.uint8]) -> None:
    plain = make_file(smooth, "JPEG", quality=95)
    scan = plain.index(b"\xff\xda")
    expected = pixels_of(plain)
    oddities = {
        "a zip archive behind the picture": plain + b"PK\3\4" + bytes(999),
        "stray bytes before the scan": plain[:scan] + b"\0\0" + plain[scan:],
        "stray byte before the end": plain[:-2] + b"\0" + plain[-2:],
        "fill bytes": plain[:2] + b"\xff" * 9 + plain[2:],
        "an unknown JFIF revision": plain[:11] + b"\3" + plain[12:],
    }
    for name, data in oddities.items():
        assert (pixels_of(data) == expected).all(), name


def test_one_pixel() -> None:
    assert pixels_of(make_file(np.full((1, 1, 3), 77, np.uint8), "PNG")).tolist() == [[[77, 77, 77]]]


def test_bands_of_a_tall_and_of_a_wide_picture_join_up() -> None:
    # One band is 262,144 pixels: these need several, the last one short, and one row a band.
    for height, width in ((1500, 700), (3, 29_000)):
        gray = (np.arange(height * width).reshape(height, width) % 251).astype(np.uint8)
        assert (pixels_of(make_file(gray, "PNG", compress_level=1)) == gray[..., None]).all()


@pytest.mark.parametrize("plugin", ["JPEG", "PNG", "WEBP", "TIFF", "HEIF"])
def test_pixels_are_counted_without_decoding(plugin: str) -> None:
    data = make_file(np.zeros((60, 80, 3), np.uint8), plugin)
    assert count_pixels(data, ImageLimits()) == 60 * 80
    with pytest.raises(TooLarge):
        count_pixels(data, ImageLimits(max_megapixels=0.0047))


def test_pixels_are_counted_by_the_header() -> None:
    bad_pixels = make_png(300, 200, b"no deflate")
    assert count_pixels(bad_pixels, ImageLimits()) == 60_000
    with pytest.raises(UndecodableImage):
        decode_image(bad_pixels, ImageLimits())


def test_without_its_reader_a_photo_in_heic_is_refused(
    smooth: NDArray[np.uint8], monkeypatch: pytest.MonkeyPatch
) -> None:
    data = make_file(smooth, "HEIF")
    source = find_spec("services.imaging.codec")
    monkeypatch.setitem(sys.modules, "pillow_heif", None)  # importing it fails
    without = module_from_spec(source)
    monkeypatch.setitem(sys.modules, without.__name__, without)  # its dataclasses look for it there
    source.loader.exec_module(without)
    assert not without.HAS_HEIC
    with pytest.raises(UnsupportedMediaType, match="without HEIC"):
        without.decode_image(data, LIMITS)
    assert without.decode_image(make_file(smooth, "PNG"), LIMITS).format == "png"


def test_the_codec_is_the_only_door() -> None:
    root = Path(__file__).parents[3]
    door = root / "services" / "imaging" / "codec.py"
    # Files of several pages are put together from pages that the codec has written.
    binder = root / "services" / "imaging" / "page_files.py"
    # Pictures that the codec has written itself, and that were kept, may be read without its checks.
    own = {binder, root / "services" / "operations" / "kept_picture.py"}
    inward = re.compile(r"imdecode|imread|Image\.open|pillow_heif|simplejpeg")
    outward = re.compile(r"imencode|imwrite|img2pdf")
    sources = [path for package in ("app", "services", "models") for path in (root / package).rglob("*.py")]
    assert {door, *own} <= set(sources)
    assert [
        str(path) for path in sources if inward.search(path.read_text()) and path not in (door, *own)
    ] == []
    assert [
        str(path) for path in sources if outward.search(path.read_text()) and path not in (door, binder)
    ] == []


@pytest.mark.parametrize("plugin", ["JPEG", "PNG"])
def test_an_image_is_reduced_as_far_as_it_stays_large_enough(plugin: str) -> None:
    row, column = np.mgrid[0:301, 0:402]
    data = make_file(np.stack([column // 2, row // 2, row // 4], axis=-1).astype(np.uint8), plugin)
    whole = decode_image(data, LIMITS)
    assert (whole.reduction, whole.size) == (1, (402, 301))
    for enough_px, reduction in ((202, 1), (201, 2), (100, 4), (1, 8)):
        reduced = decode_image(data, LIMITS, enough_px=enough_px)
        assert (reduced.reduction, reduced.size) == (reduction, (402, 301))
        assert max(reduced.pixels.shape) >= enough_px
        # The pixel (x, y) is the mean of the photo's pixels from (x r, y r) on.
        at = np.arange(10, 30)
        expected = (reduction * (at + 0.5) - 0.5) / 2
        assert np.abs(reduced.pixels[5, at, 0] - expected).mean() < 1.2
