"""What is learnt from a picture's metadata: focal length, resolution, colour profile."""

import math

import numpy as np
import pytest
from PIL import ImageCms

from services.contract.images import ImageLimits
from services.imaging.codec import DecodedImage, decode_image
from services.imaging.exif import DiagonalFocalLength
from tests.services.imaging.files import make_exif, make_file

FOCAL_LENGTH, FOCAL_LENGTH_35MM, EXPOSURE_TIME = 0x920A, 0xA405, 0x829A
PLANE_X_RESOLUTION, PLANE_UNIT, PIXEL_X, PIXEL_Y = 0xA20E, 0xA210, 0xA002, 0xA003
GRAY = np.full((300, 400, 3), 128, np.uint8)


def decode_photo(camera: dict[int, object], orientation: int = 1, plugin: str = "JPEG") -> DecodedImage:
    return decode_image(make_file(GRAY, plugin, exif=make_exif(orientation, camera)), ImageLimits())


@pytest.mark.parametrize("plugin", ["JPEG", "PNG", "WEBP", "HEIF"])
@pytest.mark.parametrize("orientation", [1, 6])
def test_focal_length_of_35_mm_film(plugin: str, orientation: int) -> None:
    photo = decode_photo({FOCAL_LENGTH_35MM: 26}, orientation, plugin)
    # The film frame's diagonal is hypot(36, 24) mm, this picture's 500 pixels.
    assert photo.focal_length_px == pytest.approx(26 / math.hypot(36, 24) * 500)


@pytest.mark.parametrize(("unit", "per_mm"), [(2, 1 / 25.4), (3, 1 / 10), (4, 1.0), (5, 1000.0)])
def test_focal_length_from_the_focal_plane(unit: int, per_mm: float) -> None:
    # 100 pixels per mm and 5 mm make 500 pixels, in the unit at hand.
    camera = {
        FOCAL_LENGTH: 5.0,
        PLANE_X_RESOLUTION: 100 / per_mm,
        PLANE_UNIT: unit,
        PIXEL_X: 400,
        PIXEL_Y: 300,
    }
    assert decode_photo(camera).focal_length_px == pytest.approx(500, rel=1e-4)


def test_focal_plane_resolution_refers_to_the_picture_as_taken() -> None:
    # Taken at 4000 x 3000, now a tenth of that, and turned by an editor.
    camera = {FOCAL_LENGTH: 5.0, PLANE_X_RESOLUTION: 1000.0, PLANE_UNIT: 4, PIXEL_X: 3000, PIXEL_Y: 4000}
    assert decode_photo(camera).focal_length_px == pytest.approx(500)


@pytest.mark.parametrize(
    "camera",
    [
        {},
        {FOCAL_LENGTH_35MM: 0},
        {FOCAL_LENGTH: 5.0},
        {FOCAL_LENGTH: 5.0, PLANE_X_RESOLUTION: 0.0},
        {FOCAL_LENGTH: 5.0, PLANE_X_RESOLUTION: 100.0, PLANE_UNIT: 9},
        {FOCAL_LENGTH_35MM: 60_000},  # a field of view of 0.04 degrees
        {FOCAL_LENGTH_35MM: 1},
    ],
)
def test_unbelievable_focal_lengths_are_unknown(camera: dict[int, object]) -> None:
    assert decode_photo(camera).focal_length_px is None


@pytest.mark.parametrize(
    ("dpi", "expected"), [((300, 300), 300), ((72, 72), None), ((300, 200), 300), ((9600, 9600), None)]
)
@pytest.mark.parametrize("plugin", ["JPEG", "PNG", "TIFF"])
def test_resolution_of_a_scan(plugin: str, dpi: tuple[int, int], expected: float | None) -> None:
    found = decode_image(make_file(GRAY, plugin, dpi=dpi), ImageLimits()).dpi
    assert found == (None if expected is None else pytest.approx(expected, rel=1e-3))


@pytest.mark.parametrize(
    ("dpi", "aspect"),
    [((204, 98), 98 / 204), ((100, 200), 2.0), ((300, 299), 1.0), ((90, 45), 1.0), ((1000, 200), 1.0)],
)
@pytest.mark.parametrize("plugin", ["JPEG", "PNG", "TIFF"])
def test_the_aspect_of_pixels(plugin: str, dpi: tuple[int, int], aspect: float) -> None:
    found = decode_image(make_file(GRAY, plugin, dpi=dpi), ImageLimits())
    assert found.pixel_aspect == pytest.approx(aspect, rel=1e-3)
    turned = decode_image(make_file(GRAY, "JPEG", dpi=dpi, exif=make_exif(6, {})), ImageLimits())
    assert turned.pixel_aspect == pytest.approx(1 / aspect, rel=1e-3)


@pytest.mark.parametrize("tag", [FOCAL_LENGTH, EXPOSURE_TIME])
def test_resolution_of_a_photo_means_nothing(tag: int) -> None:
    data = make_file(GRAY, "JPEG", dpi=(300, 300), exif=make_exif(1, {tag: 0.5}))
    assert decode_image(data, ImageLimits()).dpi is None


@pytest.mark.parametrize("plugin", ["JPEG", "PNG", "WEBP", "TIFF", "HEIF"])
def test_profile_of_rgb_pixels_is_handed_on(plugin: str) -> None:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    assert decode_image(make_file(GRAY, plugin, icc_profile=profile), ImageLimits()).icc_profile == profile


def test_profiles_that_do_not_describe_the_pixels_are_dropped() -> None:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for other in (
        make_file(GRAY[..., 0], "JPEG", icc_profile=profile),
        make_file(GRAY, "JPEG", icc_profile=profile[:16] + b"GRAY" + profile[20:]),
        make_file(GRAY, "JPEG", icc_profile=b"RGB "),
        make_file(GRAY, "JPEG"),
    ):
        assert decode_image(other, ImageLimits()).icc_profile is None


def test_a_cropped_picture_has_the_focal_length_of_the_one_that_was_taken() -> None:
    # 400 x 300 is left of 400 x 500: the 35 mm equivalent refers to the whole.
    camera = {FOCAL_LENGTH_35MM: 26, PIXEL_X: 400, PIXEL_Y: 500}
    found = decode_photo(camera).focal_length_px
    assert found == pytest.approx(26 / math.hypot(36, 24) * math.hypot(400, 500))
    assert not isinstance(found, DiagonalFocalLength)
    plane = {FOCAL_LENGTH: 5.0, PLANE_X_RESOLUTION: 100.0, PLANE_UNIT: 4, PIXEL_X: 400, PIXEL_Y: 500}
    assert decode_photo(plane).focal_length_px == pytest.approx(500)


@pytest.mark.parametrize("sizes", [{}, {PIXEL_X: 400, PIXEL_Y: 300}, {PIXEL_X: 3000, PIXEL_Y: 4000}])
def test_where_no_cropping_is_seen_the_focal_length_is_a_share_of_the_diagonal(
    sizes: dict[int, object],
) -> None:
    found = decode_photo({FOCAL_LENGTH_35MM: 26} | sizes).focal_length_px
    assert found == pytest.approx(26 / math.hypot(36, 24) * 500)
    assert isinstance(found, DiagonalFocalLength)
