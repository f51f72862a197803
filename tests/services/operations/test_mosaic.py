"""The page of several uploads: gates before the first pixel, errors that name the photo, the contract's document."""

import base64
import io
import json
import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageCms

from services.contract.cameras import CameraMemory
from services.contract.images import Encoding, ImageLimits, PageReply
from services.contract.mosaic import MosaicLimits, MosaicParameters
from services.errors import DocumentError, TooLarge, UndecodableImage, UnsupportedMediaType
from services.operations import mosaic
from services.operations.mosaic import mosaic_uploads
from tests.services.imaging.files import make_exif, make_file, make_png
from tests.services.operations.documents import document_of
from tests.services.operations.pipelines import MosaicPipeline, reject_constant

LIMITS = MosaicLimits(ImageLimits(), 200)
PARAMETERS = MosaicParameters(upright=False)
PHOTOS = [np.random.default_rng(seed).integers(0, 256, (40, 60, 3), dtype=np.uint8) for seed in range(3)]
PNGS = [make_file(photo, "PNG") for photo in PHOTOS]
BLUE, GREEN = (
    ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()[:-1] + last for last in (b"b", b"g")
)


def run(uploads: list[bytes], encoding: Encoding | None = None) -> PageReply:
    return mosaic_uploads(uploads, PARAMETERS, encoding or Encoding(), LIMITS)


@pytest.mark.usefixtures("mosaic_pipeline")
def test_the_answer_is_the_contracts() -> None:
    document = json.loads(json.dumps(document_of(run(PNGS))), parse_constant=reject_constant)
    assert list(document.pop("timings_ms")) == ["decode", "registration", "composition", "encode"]
    mesh = {"rows": 2, "columns": 2, "target": [[[0, 0.333], [9, 0]], [[0, 9], [9, 9]]]}
    placed = {
        "placed": True,
        "mesh": mesh,
        "scale": 1.2346,
        "sharpness": 1.0,
        "covered_fraction": 0.0,
        "camera": None,
    }
    assert document == {
        "width": 60,
        "height": 40,
        "base": 0,
        "orientation": {
            "rotation_deg": 90,
            "mirrored": False,
            "confidence": None,
            "photo_rotation_deg": None,
        },
        "patches": [placed, placed, {**dict.fromkeys(placed), "placed": False}],
        "pairs": [
            {
                "a": 0,
                "b": 1,
                "matches": 900,
                "votes": 400,
                "runner_up_votes": 12,
                "overlap_fraction": 0.2346,
                "residual_px": 0.0712,
            }
        ],
        "surface": None,
        "unplaced": [2],
        "warnings": [{"code": "not-placed", "detail": "images[2] overlaps no other photo."}],
        "text": None,
        "image": None,
        "image_media_type": None,
        "page_id": None,
    }


def test_the_pipeline_gets_upright_photos_in_their_order_and_all_that_is_known(
    mosaic_pipeline: MosaicPipeline,
) -> None:
    turned = make_file(PHOTOS[0], "JPEG", exif=make_exif(6, {0xA405: 26}))
    run([PNGS[0], turned])
    ((shapes, parameters, focal_lengths_px, ocr, cameras),) = mosaic_pipeline.calls
    assert shapes == [(40, 60, 3), (60, 40, 3)]
    assert parameters is PARAMETERS
    assert focal_lengths_px == [None, pytest.approx(26 / math.hypot(36, 24) * math.hypot(60, 40))]
    assert ocr == "an engine"
    assert cameras == [None, None]


def test_each_photo_has_the_memory_of_its_camera(mosaic_pipeline: MosaicPipeline) -> None:
    exif = make_exif()
    exif[0x010F], exif[0x0110] = "Maker", "M 1"
    named = make_file(PHOTOS[0], "JPEG", exif=exif)
    phone, tablet = CameraMemory("Maker M 1 60x40", 0.3, 0.02, 5), CameraMemory("tablet", 0.1, 0.02, 5)
    for name in (None, "tablet"):
        asked = replace(PARAMETERS, camera=name, cameras=(phone, tablet))
        mosaic_uploads([PNGS[0], named], asked, Encoding(), LIMITS)
    assert [call[-1] for call in mosaic_pipeline.calls] == [[None, phone], [tablet, tablet]]


@pytest.mark.parametrize(
    ("plugin", "asked", "media_type", "mark"),
    [
        ("JPEG", None, "image/jpeg", "JPEG"),
        ("PNG", None, "image/png", "PNG"),
        ("HEIF", None, "image/jpeg", "JPEG"),
        ("PNG", "webp", "image/webp", "WEBP"),
    ],
)
@pytest.mark.usefixtures("mosaic_pipeline")
def test_the_file_is_in_the_asked_for_or_in_the_first_photos_format(
    plugin: str, asked: Any, media_type: str, mark: str
) -> None:
    reply = run([make_file(PHOTOS[0], plugin), make_file(PHOTOS[1], "TIFF")], Encoding(asked))
    assert reply.media_type == media_type
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert (picture.format, picture.size) == (mark, (60, 40))


@pytest.mark.usefixtures("mosaic_pipeline")
def test_json_with_and_without_the_image() -> None:
    reply = run(PNGS, Encoding("json"))
    assert (reply.body, reply.media_type, document_of(reply)["image"]) == (b"", "application/json", None)
    image = document_of(run(PNGS, Encoding("json", embed=True)))["image"]
    assert isinstance(image, str)
    with Image.open(io.BytesIO(base64.b64decode(image, validate=True))) as picture:
        assert np.array_equal(np.asarray(picture), PHOTOS[0])


@pytest.mark.parametrize(
    ("profiles", "kept"),
    [((BLUE, BLUE), BLUE), ((BLUE, GREEN), None), ((BLUE, None), None), ((None, None), None)],
    ids=["all", "different", "one", "none"],  # profiles hold the time at which they were made
)
@pytest.mark.usefixtures("mosaic_pipeline")
def test_a_colour_profile_is_kept_where_all_photos_have_it(
    profiles: tuple[bytes | None, ...], kept: bytes | None
) -> None:
    reply = run([make_file(PHOTOS[0], "PNG", icc_profile=profile) for profile in profiles])
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert picture.info.get("icc_profile") == kept


@pytest.mark.parametrize(
    ("dpi", "scale", "expected"), [((200, 200), 1.0, 200), ((200, 200), 1.5, 300), ((200, 400), 1.0, 300)]
)
def test_scans_that_agree_on_their_resolution_keep_it(
    mosaic_pipeline: MosaicPipeline, dpi: tuple[int, int], scale: float, expected: int
) -> None:
    mosaic_pipeline.scale = scale
    reply = run([make_file(PHOTOS[0], "PNG", dpi=(each, each)) for each in dpi], Encoding("jpeg"))
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert picture.info["dpi"] == (expected, expected)


BROKEN = {
    "no picture": (b"no picture", LIMITS, UnsupportedMediaType),
    "cut": (PNGS[0][:-20], LIMITS, UndecodableImage),
    "damaged pixels": (make_png(60, 40, b"no deflate"), LIMITS, UndecodableImage),
    "large": (make_file(np.zeros((90, 90), np.uint8), "PNG"), None, TooLarge),
    "EXIF": (make_file(PHOTOS[0], "JPEG", exif=b"Exif\0\0" + bytes(3000)), None, TooLarge),
}


@pytest.mark.parametrize("place", [0, 2])
@pytest.mark.parametrize("name", BROKEN)
def test_a_bad_photo_is_named(mosaic_pipeline: MosaicPipeline, name: str, place: int) -> None:
    upload, limits, error = BROKEN[name]
    limits = limits or MosaicLimits(ImageLimits(max_megapixels=0.003, max_exif_bytes=2000), 200)
    uploads = PNGS[:2]
    uploads.insert(place, upload)
    with pytest.raises(error, match=rf"^images\[{place}\]: ") as caught:
        mosaic_uploads(uploads, PARAMETERS, Encoding(), limits)
    assert caught.value.field == f"images[{place}]"
    assert mosaic_pipeline.calls == []


def test_all_headers_are_judged_before_the_first_picture_is_decoded(
    monkeypatch: pytest.MonkeyPatch, mosaic_pipeline: MosaicPipeline
) -> None:
    decoded: list[bytes] = []
    monkeypatch.setattr(mosaic, "decode_image", lambda upload, limits: decoded.append(upload))
    limits = MosaicLimits(ImageLimits(max_megapixels=0.003), 0.007)
    with pytest.raises(TooLarge, match=r"^images: .* 0\.0 megapixels together; .* 0\.007") as caught:
        mosaic_uploads(PNGS, PARAMETERS, Encoding(), limits)
    assert caught.value.field == "images"
    with pytest.raises(UnsupportedMediaType):
        mosaic_uploads([*PNGS, b"no picture"], PARAMETERS, Encoding(), limits)
    assert decoded == mosaic_pipeline.calls == []


@pytest.mark.usefixtures("mosaic_pipeline")
def test_exactly_the_limit_is_allowed() -> None:
    mosaic_uploads(PNGS, PARAMETERS, Encoding(), MosaicLimits(ImageLimits(), 0.0072))


@pytest.mark.usefixtures("mosaic_pipeline")
def test_replies_and_errors_cross_the_border_of_a_process() -> None:
    reply = run(PNGS)
    assert pickle.loads(pickle.dumps(reply)) == reply
    with pytest.raises(DocumentError) as caught:
        run([PNGS[0], b"no picture"])
    restored = pickle.loads(pickle.dumps(caught.value))
    assert type(restored) is UnsupportedMediaType
    assert (restored.field, restored.detail) == ("images[1]", caught.value.detail)
