"""What a worker makes of pages and models: answers that are the contract's, refusals that name the place."""

import io
import json
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.schemas.layout import stored_form
from services.contract.fields import FieldSetting
from services.contract.images import DocumentLimits, ImageLimits
from services.contract.layout import LayoutOptions, LayoutSettings, ModelDocument
from services.contract.result_json import RecognitionJson
from services.errors import InvalidModel, InvalidOption, TooLarge
from services.layout.model.cost import MOST_EXPLAINED, AttributeCost
from services.layout.model.layout_model import MOST_LABELS
from services.layout.page import Page, Zone, ZoneWord
from services.layout.recognition.fields import probability_of_value
from services.layout.recognition.results import ClassMatch, ModelMatch, Recognition, RecognizedZone
from services.operations import layout
from services.operations.layout import recognize_upload
from services.operations.layout_again import recognize_again
from services.operations.layout_models import (
    import_model,
    import_sample,
    initialize_from_samples,
    measure_sample,
    measure_sample_file,
)
from services.operations.layout_result import describe_recognition
from services.operations.upright_reading import UprightReading
from services.progress import progress_to
from simulation.labelled_pages import letter_page
from tests.services.imaging.files import make_file
from tests.services.operations.documents import document_of as as_json_of
from tests.services.operations.pipelines import RectifyPipeline, reject_constant

SETTINGS = LayoutSettings()
LETTERS = [letter_page(np.random.default_rng(seed), draw=False).document() for seed in range(3)]


def as_json(document: Any) -> bytes:
    return json.dumps(document).encode()


@pytest.fixture(scope="module")
def model() -> ModelDocument:
    samples = [measure_sample(None, as_json(letter), SETTINGS) for letter in LETTERS[:2]]
    draft = initialize_from_samples("letter", samples, SETTINGS)
    assert "salutation" in draft.labels
    return ModelDocument("letter", 7, as_json(draft.document))


def test_the_answer_is_the_contracts(model: ModelDocument) -> None:
    reply = recognize_upload(None, as_json(LETTERS[2]), None, [model], LayoutOptions(), SETTINGS)
    json.loads(json.dumps([as_json_of(reply), reply.page]), parse_constant=reject_constant)
    result = reply.answer
    assert (reply.body, reply.media_type) == (b"", "application/json")
    assert result.class_ is not None
    assert (result.class_.name, result.class_.model_version) == ("letter", 7)
    assert [zone.id for zone in sorted(result.zones, key=lambda zone: zone.order)]
    assert pickle.loads(pickle.dumps(reply)) == reply


def test_the_settings_of_a_class_make_values(model: ModelDocument) -> None:
    letter = json.loads(json.dumps(LETTERS[2]))
    [dated] = [zone for zone in letter["zones"] if zone["label"] == "date"]
    dated["text"] = "March 3, 1998"
    typed = replace(model, fields={"date": FieldSetting("date"), "absent": FieldSetting("email")})
    reply = recognize_upload(None, as_json(letter), None, [typed], LayoutOptions(), SETTINGS)
    found = {field.label: field for field in reply.answer.fields}
    assert (found["date"].type, found["date"].value) == ("date", "1998-03-03")
    assert (found["salutation"].type, found["salutation"].problem) == ("text", None)
    assert "absent" not in found
    assert pickle.loads(pickle.dumps(typed)) == typed


def test_the_page_can_be_recognized_again(model: ModelDocument) -> None:
    reply = recognize_upload(None, as_json(LETTERS[2]), None, [model], LayoutOptions(), SETTINGS)
    again = recognize_upload(None, as_json(reply.page), None, [model], LayoutOptions(), SETTINGS)
    assert as_json_of(again)["match"] == as_json_of(reply)["match"]
    assert again.page == reply.page


def test_a_kept_page_is_found_as_before_by_the_models_of_then(model: ModelDocument) -> None:
    reply = recognize_upload(None, as_json(LETTERS[2]), None, [model], LayoutOptions(), SETTINGS)
    again = recognize_again(reply.page, [model], SETTINGS, False)
    assert again == {name: as_json_of(reply)[name] for name in RecognitionJson.__annotations__}
    newer = recognize_again(reply.page, [replace(model, version=8)], SETTINGS, True)
    assert newer["class"]["model_version"] == 8


def test_a_stored_model_that_cannot_be_read_is_told() -> None:
    broken = ModelDocument("letter", 4, b'{"format": "of old"}')
    with pytest.raises(InvalidModel, match=r"Version 4 of model letter .* Initialize it again"):
        recognize_upload(None, as_json(LETTERS[2]), None, [broken], LayoutOptions(), SETTINGS)


def recognition(terms: int = 0) -> Recognition:
    zones = (
        Zone("a", (0.0, 0.0, 9.999, 5.0), lines=1, font_size=12.34567, content={"date": 0.5, "name": 0.0}),
    )
    match = ClassMatch("memo", 3, 1.23456, 0.75)
    explanation = tuple(AttributeCost("a", None, f"attribute {index}", 1.0) for index in range(terms))
    report = ModelMatch(1.23456, 1.0, 0.2, 0.03456, False, 0.5, {"date": "a"}, explanation)
    return Recognition(
        Page(100.0, 50.0, zones),
        (RecognizedZone(zones[0], "date", 0.98765, "date", 0),),
        match,
        (match,),
        0.25,
        report,
    )


def test_a_recognition_as_json() -> None:
    found = stored_form(describe_recognition(recognition(5), explain=False))
    assert {name: found[name] for name in found if found[name] not in (None, [], {}) or name == "fields"} == {
        "width": 100.0,
        "height": 50.0,
        "class": {"name": "memo", "model_version": 3, "cost": 1.2346, "probability": 0.75},
        "classes": [{"name": "memo", "model_version": 3, "cost": 1.2346, "probability": 0.75}],
        "unknown_probability": 0.25,
        "zones": [
            {
                "id": "a",
                "box": [0.0, 0.0, 10.0, 5.0],
                "label": "date",
                "confidence": 0.9877,
                "group": "date",
                "order": 0,
                "kind": "text",
                "lines": 1,
                "font_size": 12.3457,
                "font_class": "normal",
                "line_spacing": None,
                "weight": None,
                "alignment": None,
                "appearance": None,
                "text": "",
                "text_confidence": None,
                "words": None,
                "content": {"date": 0.5},
            }
        ],
        "fields": [],
        "match": {
            "cost": 1.2346,
            "node_cost": 1.0,
            "edge_cost": 0.2,
            "count_cost": 0.0346,
            "optimal": False,
            "gap": 0.5,
            "backbone": {"date": "a"},
            "explanation": None,
        },
    }


def test_words_and_fields_as_json() -> None:
    words = (ZoneWord("3", (1.0, 1.0, 2.0, 4.0), 0.5, 0), ZoneWord("May", (3.0, 1.0, 6.123, 4.0), 0.9, 0))
    found = recognition()
    zone = replace(found.zones[0].zone, text="3 May", words=words)
    read = replace(found, zones=(replace(found.zones[0], zone=zone, confidence=0.8),))
    described = stored_form(describe_recognition(read, explain=False, words=True))
    assert described["zones"][0]["text_confidence"] == 0.8
    assert described["zones"][0]["words"] == [
        {"text": "3", "box": [1.0, 1.0, 2.0, 4.0], "confidence": 0.5, "line": 0},
        {"text": "May", "box": [3.0, 1.0, 6.12, 4.0], "confidence": 0.9, "line": 0},
    ]
    [field] = described["fields"]
    assert field == {
        "label": "date",
        "text": "3 May",
        "type": "text",
        "value": "3 May",
        "currency": None,
        "problem": None,
        "confidence": round(0.75 * probability_of_value(0.8, 0.5 * 0.9, "text"), 4),
        "zones": ["a"],
    }
    plain = stored_form(describe_recognition(read, explain=False))
    assert plain["zones"][0]["words"] is None


@pytest.mark.parametrize("terms", [0, 5, MOST_EXPLAINED + 1])
def test_so_many_terms_are_explained(terms: int) -> None:
    match = describe_recognition(recognition(terms), explain=True).match
    assert match is not None
    assert match.explanation is not None
    assert len(match.explanation) == min(terms, MOST_EXPLAINED)


def test_a_photo_is_rectified_first(monkeypatch: pytest.MonkeyPatch) -> None:
    pipeline = RectifyPipeline()
    monkeypatch.setattr(layout, "rectify", pipeline)
    monkeypatch.setattr(layout, "ocr_engine", lambda language: None)
    photo = make_file(np.full((40, 60, 3), 255, np.uint8), "PNG")
    heard: list[str] = []
    with progress_to(lambda stage, fraction: heard.append(f"{stage} {fraction:.2f}")):
        options = LayoutOptions(rectify=True, format="png", keep_image_bytes=50_000)
        reply = recognize_upload(photo, None, None, [], options, SETTINGS)
    assert heard == ["models 0.00", "decode 0.02", "zones 0.60", "matching 0.80", "encode 0.95"]
    assert len(pipeline.calls) == 1
    assert (as_json_of(reply)["width"], as_json_of(reply)["height"]) == (40, 60)  # it turns the photo
    assert as_json_of(reply)["warnings"] == [{"code": "focal-length-unknown", "detail": "Say it."}]
    timings = as_json_of(reply)["timings_ms"]
    assert isinstance(timings, dict)
    assert {"decode", "text", "remap", "zones", "encode"} <= timings.keys()
    with Image.open(io.BytesIO(reply.body)) as drawn:
        assert drawn.format == "PNG"
        assert reply.drawn is not None
        assert (reply.drawn.left, reply.drawn.scale_y) == ((drawn.width - 600) // 2, 900 / 60)
    with Image.open(io.BytesIO(reply.picture)) as kept:
        assert (kept.format, kept.size) == ("JPEG", (40, 60)), "the flat page, whose zones these are"
    assert as_json_of(reply)["image"] == {"width": 40, "height": 60, "bytes": len(reply.picture)}
    flat = as_json_of(reply)["page"]
    assert isinstance(flat, dict)
    assert flat["photo"] == {"width": 60, "height": 40}
    assert (flat["width"], flat["height"]) == (40, 60)
    assert flat["mesh"]["rows"] == 2


@pytest.mark.parametrize("ocr", [True, False])
def test_the_page_is_read_if_wanted(monkeypatch: pytest.MonkeyPatch, ocr: bool) -> None:
    seen = []
    monkeypatch.setattr(layout, "ocr_engine", lambda language: "an engine")
    monkeypatch.setattr(
        layout,
        "read_upright",
        lambda image, engine, origin: seen.append(engine) or UprightReading(image, None),
    )
    photo = make_file(np.full((40, 60, 3), 255, np.uint8), "PNG")
    recognize_upload(photo, None, None, [], LayoutOptions(ocr=ocr), SETTINGS)
    assert seen == ["an engine" if ocr else None]


def test_a_sample_keeps_its_labels_and_leaves_content_to_be_measured_again() -> None:
    page = {
        "width": 100,
        "height": 100,
        "zones": [
            {
                "id": 1,
                "box": [0, 0, 50, 10],
                "label": "date",
                "text": "May 4, 1998",
                "content": {"date": 0.1},
            },
            {"id": 2, "box": [0, 20, 50, 30], "label": None, "content": {"date": 0.1}},
        ],
    }
    first, second = measure_sample(None, as_json(page), SETTINGS)["zones"]  # type: ignore[misc]
    assert (first["id"], first["label"], first["text"]) == ("1", "date", "May 4, 1998")
    assert "content" not in first
    assert second["label"] is None
    assert second["content"]["date"] == 0.1


def test_samples_of_wider_limits_are_still_read() -> None:
    narrow = replace(SETTINGS, max_zones=2)
    with pytest.raises(InvalidOption, match="2"):
        measure_sample(None, as_json(LETTERS[0]), narrow)
    sample = measure_sample(None, as_json(LETTERS[0]), SETTINGS)
    assert initialize_from_samples("letter", [sample], narrow).labels
    broken: Any = {"width": 1}
    with pytest.raises(InvalidOption, match=r"samples\[1\]"):
        initialize_from_samples("letter", [sample, broken], SETTINGS)


def test_a_model_is_called_as_its_path_says(model: ModelDocument) -> None:
    document = json.loads(model.document)
    assert import_model("letter", model.document).document == document
    with pytest.raises(InvalidModel, match="memo") as raised:
        import_model("memo", model.document)
    assert raised.value.field == "name"
    del document["name"]
    assert import_model("memo", as_json(document)).document == {**document, "name": "memo"}


@pytest.mark.parametrize("document", [b"", b"{", b"\xff\xfe", b"[" * 200_000, b"9" * 5000])
def test_a_model_that_is_no_json(document: bytes) -> None:
    with pytest.raises(InvalidModel, match="JSON"):
        import_model("letter", document)


@pytest.mark.parametrize("zones", [b"", b"{", b"\xff\xfe", b"[" * 200_000, b"9" * 5000])
def test_zones_that_are_no_json(zones: bytes) -> None:
    with pytest.raises(InvalidOption, match="JSON") as raised:
        recognize_upload(None, zones, None, [], LayoutOptions(), SETTINGS)
    assert raised.value.field == "zones"


def test_a_page_without_an_image_is_drawn_on_white_if_it_is_not_too_large() -> None:
    page = {"width": 99.5, "height": 50, "zones": []}
    options = LayoutOptions(format="png")
    reply = recognize_upload(None, as_json(page), None, [], options, SETTINGS)
    with Image.open(io.BytesIO(reply.body)) as drawn:
        assert drawn.width >= 100
        assert drawn.convert("L").getextrema()[1] == 255
    narrow = replace(SETTINGS, document=DocumentLimits(ImageLimits(max_megapixels=0.001)))
    with pytest.raises(TooLarge, match=r"0\.001 megapixels"):
        recognize_upload(None, as_json(page), None, [], options, narrow)


def test_a_class_has_a_bounded_number_of_labels() -> None:
    zones = [
        {"id": k, "box": [10, 10 * k, 90, 10 * k + 8], "label": f"label {k}"} for k in range(MOST_LABELS + 1)
    ]
    sample: Any = {"width": 100, "height": 1000, "zones": zones}
    with pytest.raises(InvalidOption, match="61 different labels; a model may have 60"):
        initialize_from_samples("many", [sample], SETTINGS)
    fewer: Any = {**sample, "zones": zones[:-1]}
    few = initialize_from_samples("many", [fewer], SETTINGS)
    assert len(few.labels) == MOST_LABELS


@pytest.mark.parametrize("image_format", ["pagexml", "alto"])
def test_a_sample_may_be_a_file_of_another_program(model: ModelDocument, image_format: Any) -> None:
    options = LayoutOptions(format=image_format)
    labelled = recognize_upload(None, as_json(LETTERS[2]), None, [model], options, SETTINGS)
    sample: Any = measure_sample_file(None, labelled.body, SETTINGS).document
    zones: Any = as_json_of(labelled)["zones"]
    assert {zone["id"]: zone["label"] for zone in sample["zones"]} == {
        zone["id"]: zone["label"] for zone in zones
    }
    with pytest.raises(InvalidOption, match="JSON"):
        measure_sample(None, labelled.body, SETTINGS)


def test_an_exported_sample_is_imported_as_it_was() -> None:
    sample: Any = measure_sample(None, as_json(LETTERS[0]), SETTINGS)
    sample["found"] = measure_sample(None, as_json(LETTERS[1]), SETTINGS)
    assert import_sample(as_json(sample), SETTINGS) == sample
    for wrong in (b"no JSON", b"[]", b"{}", as_json({**LETTERS[0], "zones": []})):
        with pytest.raises(InvalidOption):
            import_sample(wrong, SETTINGS)
