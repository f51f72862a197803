"""What a worker answers: the asked-for file, and a document that is the contract's."""

import base64
import io
import json
import math
import pickle
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pikepdf
import pytest
from PIL import Image, ImageCms
from pydantic import TypeAdapter

from services.contract.answers.rectify import CreasedSheet, RectifyResult
from services.contract.images import Encoding, ImageLimits
from services.contract.rectify import RectifyParameters
from services.errors import InvalidOption, NoText, TooLarge, UndecodableImage, UnsupportedMediaType
from services.operations import rectify as rectify_operation
from services.operations.page_bundle import KEPT_OPTIONS
from services.progress import progress_to, report_progress
from services.sheet.surfaces import MeshSurface
from tests.services.imaging.files import make_exif, make_file
from tests.services.operations.documents import document_of
from tests.services.operations.pipelines import RectifyPipeline, reject_constant, turned_mesh
from tests.services.operations.single_uploads import rectify_upload

LIMITS = ImageLimits()
PHOTO = np.random.default_rng(1).integers(0, 256, (40, 60, 3), dtype=np.uint8)
PARAMETERS = RectifyParameters(kind="planar", upright=False)
OF_ONE_ANSWER = {
    "region",
    "pages",
    "on_no_text",
    "text",
    "preview",
    "cameras",
    "corners",
    "rotate",
    "keep_photo",
}
"""Options of a request that a kept page is not analysed by again."""


def test_every_option_is_kept_with_a_page_or_of_one_answer() -> None:
    options = {field.name for field in fields(RectifyParameters)}
    assert options == {*KEPT_OPTIONS, *OF_ONE_ANSWER}
    assert OF_ONE_ANSWER.isdisjoint(KEPT_OPTIONS)


def test_the_answer_is_the_contracts(pipeline: RectifyPipeline) -> None:
    reply = rectify_upload(make_file(PHOTO, "PNG"), PARAMETERS, Encoding(), LIMITS)
    document = json.loads(json.dumps(document_of(reply)), parse_constant=reject_constant)
    assert document.pop("timings_ms").keys() == {"decode", "text", "remap", "quality", "encode"}
    assert document.pop("camera") == {
        "focal_length_px": 55.5,
        "field_of_view_deg": pytest.approx(60),
        "source": "exif",
        "principal_point": [29.5, 19.25],
        "principal_point_source": "estimated",
        "name": None,
        "page_focal_length_px": None,
        "page_focal_deviation": None,
    }
    assert document == {
        "kind": "planar",
        "evidence": {
            "major_convergence": 0.0123,
            "minor_convergence": None,
            "text_area_fraction": 0.41,
            "source": ["text"],
            "outline_confidence": None,
            "sides_seen": 0,
            "print_kept": None,
            "flatness_error_percent": None,
        },
        "surface": {"type": "plane", "normal": [0.0, 0.6, 0.8]},
        "orientation": {
            "rotation_deg": 270,
            "mirrored": False,
            "confidence": 0.98,
            "photo_rotation_deg": 4.7,
        },
        "width": 40,
        "height": 60,
        "mesh": {"rows": 2, "columns": 2, "source": [[[0, 0.333], [1, 0]], [[0, 1], [1, 1]]]},
        "warnings": [{"code": "focal-length-unknown", "detail": "Say it."}],
        "photo": {"width": 60, "height": 40},
        "corners": [None] * 4,
        "page": {
            "width_mm": None,
            "height_mm": None,
            "dpi": None,
            "paper": None,
            "source": None,
            "reason": "The sheet's four corners are not in view, so its proportions are unknown.",
            "aspect": None,
            "aspect_deviation": None,
            "stretch": None,
        },
        "quality": None,
        "text": None,
        "image": None,
        "image_media_type": None,
        "page_id": None,
    }


def test_a_creased_page_is_a_mesh_in_the_contracts_terms(pipeline: RectifyPipeline) -> None:
    x, y = np.meshgrid(np.arange(4) / 3, np.arange(3) * 2.0)
    normals = np.tile([0.0, -0.6, 0.8], (2, 3, 1))
    pipeline.surface = MeshSurface(np.stack([x, y], axis=-1), normals)
    reply = rectify_upload(make_file(PHOTO, "PNG"), PARAMETERS, Encoding(), LIMITS)
    document = json.loads(json.dumps(document_of(reply)), parse_constant=reject_constant)
    surface = document["surface"]
    assert (surface["type"], surface["rows"], surface["columns"]) == ("mesh", 3, 4)
    assert surface["points"][2][1] == [0.33, 4.0]
    assert surface["normals"][1][2] == [0.0, -0.6, 0.8]
    assert (len(surface["points"]), len(surface["normals"])) == (3, 2)
    assert {len(row) for row in surface["points"]} == {4}
    assert {len(row) for row in surface["normals"]} == {3}
    described = TypeAdapter(CreasedSheet).validate_python(surface)
    assert described.points[2][1] == (0.33, 4.0)


@pytest.mark.usefixtures("pipeline")
def test_the_pipelines_progress_is_a_part_of_the_operations(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in = rectify_operation.rectify  # type: ignore[attr-defined]

    def speak(*arguments: Any) -> Any:
        report_progress("text", 0.0)
        report_progress("remap", 1.0)
        return stand_in(*arguments)

    monkeypatch.setattr(rectify_operation, "rectify", speak)
    heard: list[tuple[str, float]] = []
    with progress_to(lambda *report: heard.append(report)):
        rectify_upload(make_file(PHOTO, "PNG"), PARAMETERS, Encoding(), LIMITS)
    assert heard == [("decode", 0.0), ("text", 0.03), ("remap", pytest.approx(0.95)), ("encode", 0.95)]


@pytest.mark.parametrize("not_finite", [math.nan, math.inf, -math.inf, np.float32("nan")])
def test_what_is_not_finite_becomes_null(pipeline: RectifyPipeline, not_finite: float) -> None:
    pipeline.field_of_view_rad = pipeline.convergence = not_finite
    document = document_of(rectify_upload(make_file(PHOTO, "PNG"), PARAMETERS, Encoding(), LIMITS))
    restored = json.loads(json.dumps(document), parse_constant=reject_constant)
    assert restored["camera"]["field_of_view_deg"] is None
    assert restored["evidence"]["major_convergence"] is None


def test_the_pipeline_gets_the_upright_photo_and_all_that_is_known(pipeline: RectifyPipeline) -> None:
    upload = make_file(PHOTO, "JPEG", exif=make_exif(6, {0xA405: 26}))
    rectify_upload(upload, PARAMETERS, Encoding(), LIMITS)
    ((shape, parameters, focal_length_px, ocr),) = pipeline.calls
    assert shape == (60, 40, 3)
    assert parameters == replace(PARAMETERS, on_no_text="refuse")
    assert focal_length_px == pytest.approx(26 / math.hypot(36, 24) * math.hypot(60, 40))
    assert ocr == "an engine"


@pytest.mark.parametrize(
    ("plugin", "asked", "media_type", "mark"),
    [
        ("JPEG", None, "image/jpeg", "JPEG"),
        ("PNG", None, "image/png", "PNG"),
        ("WEBP", None, "image/webp", "WEBP"),
        ("TIFF", None, "image/tiff", "TIFF"),
        ("HEIF", None, "image/jpeg", "JPEG"),
        ("PNG", "jpeg", "image/jpeg", "JPEG"),
        ("JPEG", "png", "image/png", "PNG"),
        ("JPEG", "webp", "image/webp", "WEBP"),
        ("HEIF", "tiff", "image/tiff", "TIFF"),
    ],
)
@pytest.mark.usefixtures("pipeline")
def test_the_file_is_in_the_asked_for_or_in_the_uploads_format(
    plugin: str, asked: Any, media_type: str, mark: str
) -> None:
    reply = rectify_upload(make_file(PHOTO, plugin), PARAMETERS, Encoding(asked), LIMITS)
    assert reply.media_type == media_type
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert picture.format == mark
        assert picture.size == (40, 60)
    assert document_of(reply)["image"] is None


@pytest.mark.usefixtures("pipeline")
def test_pdf() -> None:
    reply = rectify_upload(make_file(PHOTO, "JPEG"), PARAMETERS, Encoding("pdf"), LIMITS)
    assert reply.media_type == "application/pdf"
    assert reply.body.startswith(b"%PDF-1.7")


@pytest.mark.usefixtures("pipeline")
def test_json_has_no_body_and_encodes_nothing() -> None:
    reply = rectify_upload(make_file(PHOTO, "PNG"), PARAMETERS, Encoding("json"), LIMITS)
    assert (reply.body, reply.media_type, document_of(reply)["image"]) == (b"", "application/json", None)
    timings = document_of(reply)["timings_ms"]
    assert isinstance(timings, dict)
    assert "encode" not in timings


@pytest.mark.parametrize(("plugin", "mark"), [("PNG", "PNG"), ("JPEG", "JPEG"), ("HEIF", "JPEG")])
@pytest.mark.usefixtures("pipeline")
def test_json_can_hold_the_image_in_the_uploads_format(plugin: str, mark: str) -> None:
    reply = rectify_upload(make_file(PHOTO, plugin), PARAMETERS, Encoding("json", embed=True), LIMITS)
    assert reply.body == b""
    assert isinstance(document_of(reply)["image"], str)
    with Image.open(io.BytesIO(base64.b64decode(document_of(reply)["image"], validate=True))) as picture:
        assert picture.format == mark


@pytest.mark.usefixtures("pipeline")
def test_json_can_hold_a_smaller_image_in_another_format() -> None:
    asked = Encoding("json", embed=True, embed_format="webp", max_width=20)
    document = document_of(rectify_upload(make_file(PHOTO, "TIFF"), PARAMETERS, asked, LIMITS))
    assert (document["width"], document["height"]) == (20, 30)
    assert document["image_media_type"] == "image/webp"
    assert isinstance(document["image"], str)
    with Image.open(io.BytesIO(base64.b64decode(document["image"], validate=True))) as picture:
        assert (picture.format, picture.size) == ("WEBP", (20, 30))


def test_a_smaller_scan_has_fewer_pixels_per_inch(pipeline: RectifyPipeline) -> None:
    pipeline.mesh = turned_mesh(PHOTO)
    upload = make_file(PHOTO, "PNG", dpi=(200, 200))
    reply = rectify_upload(upload, PARAMETERS, Encoding("jpeg", max_width=10), LIMITS)
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert picture.info["dpi"] == (50, 50)


def test_a_scan_that_is_drawn_larger_keeps_its_true_size(pipeline: RectifyPipeline) -> None:
    pipeline.mesh = turned_mesh(PHOTO, 0.5)
    reply = rectify_upload(make_file(PHOTO, "PNG", dpi=(200, 200)), PARAMETERS, Encoding("jpeg"), LIMITS)
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert picture.info["dpi"] == (400, 400)


def test_the_scans_resolution_and_the_colour_profile_are_kept(pipeline: RectifyPipeline) -> None:
    pipeline.mesh = turned_mesh(PHOTO)
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    upload = make_file(PHOTO, "PNG", dpi=(200, 200), icc_profile=profile)
    reply = rectify_upload(upload, PARAMETERS, Encoding("jpeg"), LIMITS)
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert picture.info["dpi"] == (200, 200)
        assert picture.info["icc_profile"] == profile


@pytest.mark.usefixtures("pipeline")
def test_quality_reaches_the_encoder() -> None:
    sizes = [
        len(rectify_upload(make_file(PHOTO, "PNG"), PARAMETERS, Encoding("jpeg", quality), LIMITS).body)
        for quality in (10, 95)
    ]
    assert sizes[0] < sizes[1] / 2
    with pytest.raises(InvalidOption, match="quality"):
        rectify_upload(make_file(PHOTO, "PNG"), PARAMETERS, Encoding("jpeg", 101), LIMITS)


@pytest.mark.usefixtures("pipeline")
def test_a_reply_crosses_the_border_of_a_process() -> None:
    reply = rectify_upload(make_file(PHOTO, "PNG"), PARAMETERS, Encoding(), LIMITS)
    assert pickle.loads(pickle.dumps(reply)) == reply


@pytest.mark.parametrize(
    ("upload", "limits", "error"),
    [
        (b"no picture", LIMITS, UnsupportedMediaType),
        (make_file(PHOTO, "PNG")[:-20], LIMITS, UndecodableImage),
        (make_file(PHOTO, "PNG"), ImageLimits(max_megapixels=0.001), TooLarge),
    ],
)
def test_bad_uploads_never_reach_the_pipeline(
    pipeline: RectifyPipeline, upload: bytes, limits: ImageLimits, error: type[Exception]
) -> None:
    with pytest.raises(error):
        rectify_upload(upload, PARAMETERS, Encoding(), limits)
    assert pipeline.calls == []


def test_a_photo_without_text_is_kept_if_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise NoText("too little text.")

    monkeypatch.setattr(rectify_operation, "rectify", refuse)
    monkeypatch.setattr(rectify_operation, "rectify_spread", refuse)
    upload = make_file(PHOTO, "PNG")
    for pages in ("main", "both"):
        with pytest.raises(NoText):
            rectify_upload(upload, RectifyParameters(pages=pages), Encoding("png"), LIMITS)  # type: ignore[arg-type]
        keep = RectifyParameters(pages=pages, on_no_text="keep")  # type: ignore[arg-type]
        reply = rectify_upload(upload, keep, Encoding("png"), LIMITS)
        with Image.open(io.BytesIO(reply.body)) as picture:
            assert np.array_equal(np.asarray(picture), PHOTO)
    document = document_of(
        rectify_upload(upload, RectifyParameters(on_no_text="keep"), Encoding("json"), LIMITS)
    )
    described = RectifyResult.model_validate(document)
    assert described.mesh.source[-1][-1] == (PHOTO.shape[1] - 1, PHOTO.shape[0] - 1)
    assert [warning.code for warning in described.warnings] == ["kept-as-it-is"]


def test_pixels_that_are_not_square_are_made_square_and_places_are_in_those_of_the_file(
    pipeline: RectifyPipeline,
) -> None:
    pipeline.mesh = turned_mesh(np.zeros((80, 60)))
    asked = RectifyParameters(region=((0.0, 0.0), (50.0, 0.0), (50.0, 30.0)))
    upload = make_file(PHOTO, "PNG", dpi=(200, 100))
    reply = rectify_upload(upload, asked, Encoding("pdf"), LIMITS)
    ((shape, parameters, _, _),) = pipeline.calls
    assert shape == (80, 60, 3)
    assert parameters.region[2] == pytest.approx((50.0, 60.5))
    assert document_of(reply)["photo"] == {"width": 60, "height": 40}
    mesh = document_of(reply)["mesh"]
    assert isinstance(mesh, dict)
    # The middle of a pixel of the file lies between two of the square ones.
    assert np.array(mesh["source"]) == pytest.approx(
        np.array([[[59.0, -0.25], [59.0, 39.25]], [[0.0, -0.25], [0.0, 39.25]]])
    )
    with pikepdf.open(io.BytesIO(reply.body)) as document:
        size = [float(side) for side in document.pages[0].mediabox[2:]]
    # The stand-in turns the page: 80 x 60 pixels at 200 dpi.
    assert size == pytest.approx([80 * 0.36, 60 * 0.36], rel=1e-3)
