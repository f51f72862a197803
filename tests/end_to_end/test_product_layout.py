"""/layout of the product itself: a handful of labelled pages in, classes and labels of other pages out."""

import io
import json
from collections.abc import Callable
from functools import partial
from typing import Any
from xml.etree import ElementTree

import httpx
import numpy as np
import pytest
from PIL import Image

from services.contract.answers.layout import LayoutResult
from simulation.labelled_pages import LabelledPage, fax_page, letter_page, memo_page, title_page
from tests.end_to_end.pictures import bomb, encoded

MAKERS: dict[str, Callable[..., LabelledPage]] = {
    "letter": letter_page,
    "memo": memo_page,
    "fax": fax_page,
    "title-page": partial(title_page, journal="plain"),
}
SAMPLES = 4


def make(name: str, seed: int, **options: Any) -> LabelledPage:
    return MAKERS[name](np.random.default_rng(seed), **options)


@pytest.fixture(scope="module")
def learned(service: httpx.Client) -> httpx.Client:
    """The product, which has made a model of each class from four pages."""
    for name in MAKERS:
        for seed in range(SAMPLES):
            page = make(name, seed, draw=False).document()
            service.post(f"/layout/models/{name}/samples", json=page).raise_for_status()
        service.post(f"/layout/models/{name}/initialize").raise_for_status()
    return service


def without_labels(page: LabelledPage) -> dict[str, Any]:
    document = page.document()
    for zone in document["zones"]:
        del zone["label"]
    return document


def recognize(client: httpx.Client, page: LabelledPage, **fields: str) -> dict[str, Any]:
    response = client.post("/layout", data={"zones": json.dumps(without_labels(page)), **fields})
    assert response.status_code == 200, response.text
    LayoutResult.model_validate_json(response.content)
    answer: dict[str, Any] = response.json()
    return answer


def share_right(page: LabelledPage, answer: dict[str, Any]) -> float:
    truth = {zone.id: zone.label for zone in page.zones}
    return float(np.mean([truth[zone["id"]] == zone["label"] for zone in answer["zones"]]))


def as_file(page: LabelledPage) -> bytes:
    assert page.image is not None
    return encoded(Image.fromarray(page.image).convert("RGB"), "PNG")


def test_zones_are_labelled_and_the_class_is_told(learned: httpx.Client) -> None:
    right = []
    for name in MAKERS:
        for seed in (100, 101):
            page = make(name, seed, draw=False)
            answer = recognize(learned, page)
            assert answer["class"] is not None
            assert answer["class"]["name"] == name
            assert answer["class"]["model_version"] == 1
            total = sum(match["probability"] for match in answer["classes"]) + answer["unknown_probability"]
            assert total == pytest.approx(1, abs=0.01)
            right.append(share_right(page, answer))
    assert np.mean(right) > 0.85


def test_the_models_that_compete(learned: httpx.Client) -> None:
    answer = recognize(learned, make("letter", 102, draw=False), models="memo,fax")
    assert {match["name"] for match in answer["classes"]} == {"memo", "fax"}


def test_the_cost_is_explained(learned: httpx.Client) -> None:
    page = make("memo", 103, draw=False)
    assert recognize(learned, page)["match"]["explanation"] is None
    match = recognize(learned, page, explain="true")["match"]
    costs = [abs(term["cost"]) for term in match["explanation"]]
    assert 10 < len(costs) <= 1000
    assert match["cost"] == pytest.approx(
        match["node_cost"] + match["edge_cost"] + match["count_cost"], abs=0.01
    )
    zones = {zone.id for zone in page.zones}
    assert {term["zone"] for term in match["explanation"]} <= zones


def test_an_image_is_segmented_and_labelled(learned: httpx.Client) -> None:
    page = make("letter", 104)
    response = learned.post("/layout", files={"image": ("page.png", as_file(page))})
    assert response.status_code == 200, response.text
    answer = response.json()
    assert f'"width":{page.width},"height":{page.height},' in response.text  # whole numbers, not 1240.0
    assert answer["class"]["name"] == "letter"
    assert response.headers["document-class"] == "letter"
    assert {"decode", "zones", "models"} <= answer["timings_ms"].keys()
    assert {"body", "date"} <= {zone["label"] for zone in answer["zones"]}
    kept = learned.get(f"/layout/results/{answer['id']}")
    assert kept.json() == answer


def test_an_image_with_its_zones(learned: httpx.Client) -> None:
    page = make("fax", 105)
    response = learned.post(
        "/layout",
        files={"image": ("page.png", as_file(page))},
        data={"zones": json.dumps(without_labels(page)), "ocr": "off"},
    )
    answer = response.json()
    assert answer["class"]["name"] == "fax"
    assert [zone["id"] for zone in answer["zones"]] == [zone.id for zone in page.zones]
    assert share_right(page, answer) > 0.7


@pytest.mark.parametrize(
    ("name", "root"),
    [
        ("pagexml", "{http://schema.primaresearch.org/PAGE/gts/pagecontent/2019-07-15}PcGts"),
        ("alto", "{http://www.loc.gov/standards/alto/ns-v4#}alto"),
    ],
)
def test_results_as_xml_can_be_sent_again(learned: httpx.Client, name: str, root: str) -> None:
    page = make("letter", 106, draw=False)
    response = learned.post("/layout", data={"zones": json.dumps(without_labels(page)), "format": name})
    assert (response.status_code, response.headers["content-type"]) == (200, "application/xml")
    assert ElementTree.fromstring(response.content).tag == root
    again = learned.post("/layout", files={"zones_file": (f"page.{name}", response.content)})
    assert again.status_code == 200, again.text
    assert again.json()["class"]["name"] == "letter"
    first = learned.get(response.headers["document-result"]).json()
    assert len(again.json()["zones"]) == len(first["zones"])


def test_what_is_answered_can_be_sent_again(learned: httpx.Client) -> None:
    """As zones, in every form, as a sample and under another name of the model: the labels and costs are the same."""
    zones = json.dumps(without_labels(make("letter", 110, draw=False)))
    ask = {"zones": zones, "models": "letter"}
    first = learned.post("/layout", data=ask).json()
    exported = learned.get("/layout/models/letter").json()
    del exported["name"]
    assert learned.put("/layout/models/again", json=exported).status_code == 201
    answers = [learned.post("/layout", data={**ask, "models": "again"})]
    answers.append(learned.post("/layout", data={**ask, "zones": json.dumps(first)}))
    for form in ("pagexml", "alto", "json"):
        sent = learned.post("/layout", data={**ask, "format": form}).content
        answers.append(
            learned.post("/layout", files={"zones_file": ("page", sent)}, data={"models": "letter"})
        )
    for answer in answers:
        found = answer.json()
        assert found["match"] == first["match"]
        assert [(zone["id"], zone["label"], zone["text"], zone["font_size"]) for zone in found["zones"]] == [
            (zone["id"], zone["label"], zone["text"], zone["font_size"]) for zone in first["zones"]
        ]
    sample = learned.post("/layout/models/again/samples", json=first)
    assert sample.status_code == 201, sample.text
    assert learned.post("/layout/models/again/initialize").json()["version"] == 2
    assert learned.delete("/layout/models/again").status_code == 204


@pytest.mark.parametrize("shape", [(1, 1), (1, 3000), (3000, 1), (40, 30)])
def test_images_that_are_no_page(learned: httpx.Client, shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (*shape, 3)).astype(np.uint8)
    response = learned.post("/layout", files={"image": encoded(Image.fromarray(pixels), "PNG")})
    assert response.status_code == 200, response.text
    assert (response.json()["height"], response.json()["width"]) == shape
    response = learned.post("/layout", files={"image": encoded(Image.fromarray(pixels), "PNG")}, data=PNG)
    assert (response.status_code, response.headers["content-type"]) == (200, "image/png")


PNG = {"format": "png", "ocr": "off"}


@pytest.mark.parametrize(
    "number", ["1e999", "-1e999", "NaN", "Infinity", "9" * 400, "true", "null", '"1"', "[1]", "1e308"]
)
def test_what_are_no_coordinates(learned: httpx.Client, number: str) -> None:
    for text, field in (
        (
            f'{{"width": 100, "height": 100, "zones": [{{"id": "a", "label": "b", "box": [1, 1, {number}, 9]}}]}}',
            "zones[0].box",
        ),
        (f'{{"width": {number}, "height": 100, "zones": []}}', "width"),
    ):
        for response in (
            learned.post("/layout", data={"zones": text}),
            learned.post(
                "/layout/models/bad/samples", content=text, headers={"Content-Type": "application/json"}
            ),
        ):
            assert (response.status_code, response.json()["code"]) == (422, "invalid-option"), response.text
            assert response.json()["field"] == field
    assert learned.get("/layout/models/bad").status_code == 404


def test_the_overlay(learned: httpx.Client) -> None:
    page = make("memo", 107)
    for files, data in (
        ({"image": ("page.png", as_file(page))}, {"ocr": "off"}),
        (None, {"zones": json.dumps(without_labels(page))}),
    ):
        response = learned.post("/layout", files=files, data={**data, "format": "png"})
        assert (response.status_code, response.headers["content-type"]) == (200, "image/png")
        with Image.open(io.BytesIO(response.content)) as drawn:
            pixels = np.asarray(drawn.convert("RGB")).astype(int)
        assert pixels.shape[0] >= page.height
        assert np.ptp(pixels, axis=2).max() > 50  # colours


def test_a_sample_may_come_as_an_image(learned: httpx.Client) -> None:
    page = make("memo", 108)
    bare = {
        "width": page.width,
        "height": page.height,
        "zones": [{"id": zone.id, "box": zone.box, "label": zone.label} for zone in page.zones],
    }
    response = learned.post(
        "/layout/models/measured/samples",
        files={"image": ("page.png", as_file(page))},
        data={"zones": json.dumps(bare)},
    )
    assert response.status_code == 201, response.text
    sample = learned.get(response.headers["location"])
    assert sample.status_code == 200, sample.text
    assert {zone["label"] for zone in sample.json()["found"]["zones"]} & {zone.label for zone in page.zones}
    measured = {zone["id"]: zone for zone in sample.json()["zones"]}
    for zone in page.zones:
        if zone.kind == "text" and zone.lines > 2:
            assert measured[zone.id]["lines"] == zone.lines
            assert measured[zone.id]["font_size"] == pytest.approx(zone.font_size, rel=0.25)
    assert learned.post("/layout/models/measured/initialize").status_code == 200
    assert learned.delete("/layout/models/measured").status_code == 204


def test_models_travel(learned: httpx.Client) -> None:
    exported = learned.get("/layout/models/letter").json()
    name = exported.pop("name")
    assert name == "letter"
    response = learned.put("/layout/models/brief", json=exported)
    assert response.status_code == 201, response.text
    answer = recognize(learned, make("letter", 109, draw=False), models="brief,memo")
    assert answer["class"]["name"] == "brief"
    problem = learned.put("/layout/models/other", json={**exported, "name": "letter"})
    assert (problem.status_code, problem.json()["field"]) == (422, "name")
    assert learned.delete("/layout/models/brief").status_code == 204


def broken(document: dict[str, Any]) -> list[Any]:
    """What may become of a model on its way."""
    text = json.dumps(document)
    nodes = document["nodes"]
    return [
        text[: len(text) // 2],
        json.dumps({**document, "format": "other"}),
        json.dumps({**document, "format_version": 1000}),
        json.dumps({**document, "nodes": []}),
        json.dumps({**document, "nodes": [*nodes, nodes[1]]}),
        json.dumps({**document, "nodes": "many"}),
        json.dumps({**document, "nodes": [{**nodes[0], "cost": float("nan")}, *nodes[1:]]}),
        json.dumps({**document, "calibration": None}),
        "[" * 100_000,
        "1" * 10_000,
    ]


def test_broken_models_are_not_kept(learned: httpx.Client) -> None:
    exported = learned.get("/layout/models/letter").json()
    del exported["name"]
    for text in broken(exported):
        response = learned.put("/layout/models/broken", content=text)
        assert (response.status_code, response.json()["code"]) == (422, "invalid-model"), text[:80]
        assert len(response.json()["detail"]) > 20
    assert learned.get("/layout/models/broken").status_code == 404


ZONE = {"id": "a", "box": [10, 10, 90, 30]}
BAD_ZONES: dict[str, tuple[dict[str, Any], str]] = {
    "no zones": ({"zones": None}, "zones"),
    "no width": ({"width": None}, "width"),
    "endless": ({"width": 1e9}, "width"),
    "turned box": ({"zones": [{**ZONE, "box": [90, 10, 10, 30]}]}, "zones[0].box"),
    "box of three": ({"zones": [{**ZONE, "box": [90, 10, 10]}]}, "zones[0].box"),
    "box of NaN": ({"zones": [{**ZONE, "box": [float("nan"), 10, 20, 30]}]}, "zones[0].box"),
    "box far away": ({"zones": [{**ZONE, "box": [1e8, 1e8, 2e8, 2e8]}]}, "zones[0].box"),
    "two of one id": ({"zones": [ZONE, ZONE]}, "zones[1].id"),
    "an unknown kind": ({"zones": [{**ZONE, "kind": "poem"}]}, "zones[0].kind"),
    "too many": ({"zones": [{**ZONE, "id": index} for index in range(501)]}, "zones"),
}


@pytest.mark.parametrize("name", BAD_ZONES)
def test_bad_zones_are_named(learned: httpx.Client, name: str) -> None:
    change, field = BAD_ZONES[name]
    page = {"width": 100, "height": 100, "zones": [ZONE], **change}
    for response in (
        learned.post("/layout", data={"zones": json.dumps(page)}),
        learned.post(
            "/layout/models/bad/samples",
            content=json.dumps(page),
            headers={"Content-Type": "application/json"},
        ),
    ):
        assert (response.status_code, response.json()["code"]) == (422, "invalid-option"), response.text
        assert response.json()["field"] == field
    assert learned.get("/layout/models/bad").status_code == 404


@pytest.mark.parametrize("number", [0, 1, 500])
def test_any_number_of_zones(learned: httpx.Client, number: int) -> None:
    zones = [
        {
            "id": index,
            "box": [10 * (index % 20), 20 * (index // 20), 10 * (index % 20) + 15, 20 * (index // 20) + 15],
        }
        for index in range(number)
    ]
    page = {"width": 300, "height": 600, "zones": zones}
    response = learned.post("/layout", data={"zones": json.dumps(page)})
    assert response.status_code == 200, response.text
    assert len(response.json()["zones"]) == number
    if number == 0:
        assert response.json()["class"] is None


@pytest.mark.parametrize("zones", ["", "{", "nonsense", "[]", "1", "null", "\ufeff{}"])
def test_what_are_no_zones(learned: httpx.Client, zones: str) -> None:
    if zones:
        response = learned.post("/layout", data={"zones": zones})
        assert (response.status_code, response.json()["code"]) == (422, "invalid-option")
    response = learned.post("/layout", files={"zones_file": ("page.xml", zones.encode())})
    assert (response.status_code, response.json()["code"]) == (422, "invalid-option")
    assert response.json()["field"] == "zones_file"


def test_a_sample_needs_a_label(learned: httpx.Client) -> None:
    page = {"width": 100, "height": 100, "zones": [ZONE, {**ZONE, "id": "b", "label": None}]}
    response = learned.post("/layout/models/bad/samples", json=page)
    assert (response.status_code, response.json()["field"]) == (422, "zones")
    assert "label" in response.json()["detail"]


def test_zones_of_another_size_than_the_image(learned: httpx.Client) -> None:
    page = {"width": 100, "height": 100, "zones": [ZONE]}
    image = encoded(Image.new("RGB", (200, 100), "white"), "PNG")
    response = learned.post("/layout", files={"image": image}, data={"zones": json.dumps(page)})
    assert (response.status_code, response.json()["field"]) == (422, "zones")
    assert "200 x 100" in response.json()["detail"]


@pytest.mark.parametrize("rectify", ["true", "false"])
def test_bad_images(learned: httpx.Client, rectify: str) -> None:
    for upload, status, code in (
        (b"no picture", 415, "unsupported-media-type"),
        (bomb(), 413, "too-large"),
        (encoded(Image.new("RGB", (400, 300), "gray"), "JPEG")[:-50], 422, "undecodable-image"),
    ):
        response = learned.post("/layout", files={"image": upload}, data={"rectify": rectify})
        assert (response.status_code, response.json()["code"]) == (status, code)


def test_a_blank_image(learned: httpx.Client) -> None:
    blank = encoded(Image.new("RGB", (400, 300), "white"), "PNG")
    response = learned.post("/layout", files={"image": blank})
    assert response.status_code == 200
    assert (response.json()["zones"], response.json()["class"]) == ([], None)
    response = learned.post("/layout", files={"image": blank}, data={"rectify": "true"})
    assert (response.status_code, response.json()["code"]) == (422, "no-text")


def test_a_page_too_large_to_be_drawn(learned: httpx.Client) -> None:
    page = {"width": 20_000, "height": 20_000, "zones": [ZONE]}
    response = learned.post("/layout", data={"zones": json.dumps(page), "format": "png"})
    assert (response.status_code, response.json()["field"]) == (413, "format")
