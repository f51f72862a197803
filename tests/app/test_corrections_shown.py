"""What a person has said of a page is what every representation of its result shows; undo brings the first answer back.

A property over random feedback, with the real operations: labels, classes, texts and drawn zones, one after another.
"""

import csv
import io
import json
import random
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import html5lib
import httpx
import numpy as np
import pytest
from PIL import Image

from services.contract.operations import Operations
from services.layout.page import Page, Zone
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone
from services.layout.rendering.overlay import draw_overlay
from simulation.invoice_pages import ITEMS
from tests.app.serving import serving
from tests.app.test_feedback_undo import KINDS, page
from tests.services.layout.tables.invoices import ALDER, made
from tests.services.operations.test_layout_tables import found_page

FORMATS = ("html", "pagexml", "alto", "png")
LABELS = ["sender", "date", "body", "title", "subject", "new-one", None]


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    """A service that knows letters, whose dates have a type, and memos."""
    with serving(Operations(), workers=1, worker_memory_bytes=0, job_timeout_s=60.0) as client:
        client.timeout = httpx.Timeout(60.0)
        for name in KINDS:
            for seed in range(3):
                sent = client.post(f"/layout/models/{name}/samples", json=page(name, seed))
                assert sent.status_code == 201
            assert client.post(f"/layout/models/{name}/initialize").status_code == 200
        settings = {"fields": {"date": {"type": "date"}}}
        assert client.patch("/layout/models/letter/settings", json=settings).status_code == 200
        yield client


def recognize(client: httpx.Client, seed: int, models: str = "letter") -> dict[str, Any]:
    """The answer about a letter with texts, on an empty picture; among models that are none of it no class is found."""
    sent = page("letter", seed)
    for zone, text in zip(
        sent["zones"], ("The Miller Company", "Marcb 3, 199B", "one\ntwo\nthree"), strict=True
    ):
        zone |= {"label": None, "text": text}
    paper = io.BytesIO()
    Image.new("RGB", (sent["width"], sent["height"]), "white").save(paper, "PNG")
    data = {"zones": json.dumps(sent), "models": models, "ocr": "off"}
    response = client.post("/layout", data=data, files={"image": (f"letter-{seed}.png", paper.getvalue())})
    assert response.status_code == 200, response.text
    answer: dict[str, Any] = response.json()
    return answer


def random_feedback(chance: random.Random, shown: dict[str, Any]) -> dict[str, Any]:
    """Any body that may be sent about what a result shows."""
    zones = shown["zones"]
    some = [zone["id"] for zone in zones if chance.random() < 0.5]
    body: dict[str, Any] = {}
    if shown["class"] is None or chance.random() < 0.6:
        body["class"] = chance.choice(["letter", "memo", "memo", None])
    if chance.random() < 0.4:
        drawn = [{"id": zone["id"], "box": zone["box"], "label": chance.choice(LABELS)} for zone in zones[1:]]
        left, top, right, bottom = zones[0]["box"]
        middle = round((top + bottom) / 2, 1)
        for box in ([left, top, right, middle], [left, middle, right, bottom]):
            drawn.append({"box": box, "label": chance.choice(LABELS), "text": "half"})
        return body | {"zones": drawn}
    body["labels"] = {zone: chance.choice(LABELS) for zone in some}
    if chance.random() < 0.5:
        body["texts"] = {zones[-1]["id"]: chance.choice(["March 3, 1998", zones[-1]["text"] or "given"])}
    return body


def give(client: httpx.Client, result: str, body: dict[str, Any]) -> dict[str, Any]:
    response = client.post(f"/layout/results/{result}/feedback", json=body)
    assert response.status_code == 200, response.text
    told: dict[str, Any] = response.json()
    return told


def representations(client: httpx.Client, result: str) -> dict[str, bytes]:
    """Every representation of a result, without what names times."""
    path = f"/layout/results/{result}"
    files = {name: client.get(path, params={"format": name}) for name in ("json", *FORMATS)}
    files |= {
        f"list {name}": client.get("/layout/results", params={"format": name})
        for name in ("json", "csv", "jsonl")
    }
    for name in ("gain", "confidence"):
        files[f"queue {name}"] = client.get("/layout/results", params={"order": name})
    assert [response.status_code for response in files.values()] == [200] * len(files)
    contents = {name: response.content for name, response in files.items()}
    for name in ("pagexml", "alto"):
        root = ElementTree.fromstring(contents[name])
        for element in root.iter():
            if element.tag.rpartition("}")[2] in ("Created", "LastChange", "processingDateTime"):
                element.text = ""
        contents[name] = ElementTree.tostring(root)
    return contents


def labels_of_files(shown: dict[str, bytes]) -> Iterator[tuple[str, dict[str, str | None]]]:
    """The labels of the zones as each file says them, by the ids of the zones."""
    result = json.loads(shown["json"])
    yield "json", {zone["id"]: zone["label"] for zone in result["zones"]}
    html = html5lib.parse(shown["html"], namespaceHTMLElements=False)
    yield "html", {e.get("data-zone", ""): e.get("data-label") for e in html.iter() if e.get("data-zone")}
    found: dict[str, str | None] = {}
    for region in ElementTree.fromstring(shown["pagexml"]).iter():
        custom = region.get("custom", "")
        if region.tag.endswith("Region"):
            structure = custom.partition("structure {")[2].partition("}")[0]
            found[region.get("id", "")] = structure.partition("type:")[2].partition(";")[0] or None
    yield "pagexml", found
    root = ElementTree.fromstring(shown["alto"])
    tags = {e.get("ID"): e.get("LABEL") for e in root.iter() if e.tag.endswith("LayoutTag")}
    yield (
        "alto",
        {
            e.get("ID", ""): next((tags[name] for name in e.get("TAGREFS", "").split() if name in tags), None)
            for e in root.iter()
            if e.tag.endswith("TextBlock")
        },
    )


def expected_overlay(result: dict[str, Any]) -> np.ndarray:
    zones = [Zone(zone["id"], tuple(zone["box"]), zone["kind"]) for zone in result["zones"]]
    labelled = tuple(
        RecognizedZone(zone, said["label"], 1.0, None, said["order"])
        for zone, said in zip(zones, result["zones"], strict=True)
    )
    named = result["class"] and ClassMatch(result["class"]["name"], 1, 0.0, 1.0)
    compared = [ClassMatch(each["name"], 1, each["cost"], each["probability"]) for each in result["classes"]]
    classes = (named,) if named else tuple(compared)
    page_ = Page(result["width"], result["height"], tuple(zones))
    return draw_overlay(None, Recognition(page_, labelled, named, classes, result["unknown_probability"]))


def check_shown(
    client: httpx.Client,
    first: dict[str, Any],
    told: dict[str, Any],
    body: dict[str, Any],
    before: dict[str, Any],
) -> None:
    """All representations show the verified page: the sample where there is one, and what was sent."""
    shown = representations(client, first["id"])
    result = json.loads(shown["json"])
    zones = {zone["id"]: zone for zone in result["zones"]}
    verified = told["class"]["verified"]
    if "zones" in body:
        assert [zone["label"] for zone in result["zones"]] == [zone["label"] for zone in body["zones"]]
    said = body.get("labels", {})
    assert {zone: zones[zone]["label"] for zone in said} == said
    assert all(zones[zone]["text"] == text for zone, text in body.get("texts", {}).items())
    if verified is not None:
        sample = client.get(f"/layout/models/{verified}/samples/{told['sample']}").json()
        kept = {(zone["id"], zone["label"], zone.get("text") or "") for zone in sample["zones"]}
        assert {(zone["id"], zone["label"], zone["text"]) for zone in result["zones"]} == kept
    elif "zones" not in body:  # of no class: labels are those that a person has given
        kept = (
            {zone["id"]: zone["label"] for zone in before["zones"]}
            if before["decision"]["reasons"] == []
            else {}
        )
        kept = kept if before["class"] is None else {}
        assert all(zone["label"] == (kept | said).get(name) for name, zone in zones.items())

    assert result["file_name"] == first["file_name"] is not None
    assert all(f"{first['file_name']}".encode() in shown[name] for name in ("pagexml", "alto"))
    # The machine's word stands beside it where it differs, and nowhere else.
    assert (result["class"] or {"name": None})["name"] == verified
    found_class = first["class"] or {"name": None, "probability": first["unknown_probability"]}
    differs = found_class["name"] != verified
    expected = {"class": found_class["name"], "probability": found_class["probability"]}
    assert result.get("found") == (expected if differs else None)
    recognized = {zone["id"]: zone for zone in first["zones"]}
    for name, zone in zones.items():
        was = recognized.get(name)
        differs = was is not None and (was["label"], was["text"]) != (zone["label"], zone["text"])
        assert zone.get("found") == (
            {key: was[key] for key in ("label", "confidence", "text")} if differs and was else None
        )
        assert zone["confidence"] == 1.0
    assert (result["decision"]["action"], result["decision"]["reasons"]) == ("accept", [])

    labels = {name: zone["label"] for name, zone in zones.items()}
    for name, of_file in labels_of_files(shown):
        assert of_file == labels, name
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(shown["png"]))), expected_overlay(result))
    fields = {(field["label"], field["text"], field["value"]) for field in result["fields"]}
    assert {label for label, _, _ in fields} >= {
        zone["label"] for zone in zones.values() if zone["label"] and zone["text"]
    }
    rows = csv.DictReader(io.StringIO(shown["list csv"].decode()))
    of_csv = {
        (row["label"], row["text"], row["value"] or None) for row in rows if row["result"] == first["id"]
    }
    assert of_csv == fields
    lists = [shown[name] for name in ("list json", "queue gain", "queue confidence")]
    entries = [entry for text in lists for entry in json.loads(text)["results"]]
    entries += [json.loads(line) for line in shown["list jsonl"].decode().splitlines()]
    entries = [entry for entry in entries if entry["id"] == first["id"]]
    assert len(entries) == 4
    for entry in entries:
        assert (entry["class"], entry["fields"]) == (verified, result["fields"])
        assert entry["file_name"] == first["file_name"]
        review = {name: entry["review"][name] for name in ("zones", "confidence", "gain", "decision")}
        assert review == {"zones": len(zones), "confidence": 1.0, "gain": 0.0, "decision": "accept"}


@pytest.mark.parametrize("seed", range(5))
def test_what_was_said_is_shown_everywhere(client: httpx.Client, seed: int) -> None:
    chance = random.Random(seed)
    answer = recognize(client, 20 + seed, "memo" if seed == 1 else "letter")
    before = representations(client, answer["id"])
    first = json.loads(before["json"])
    for _ in range(1 + seed % 3):
        shown = client.get(f"/layout/results/{answer['id']}").json()
        body = random_feedback(chance, shown)
        check_shown(client, first, give(client, answer["id"], body), body, shown)
    assert client.delete(f"/layout/results/{answer['id']}/feedback").status_code == 200
    assert representations(client, answer["id"]) == before
    assert client.delete(f"/layout/results/{answer['id']}").status_code == 204


def invoice_zones(seed: int, labelled_rows: int) -> dict[str, Any]:
    """An invoice as another program sends it: a zone for each run of words, those of the first rows with labels."""
    [made_page] = made(ALDER, seed)
    cells = [
        (label, row[label].box)  # type: ignore[index]
        for row in made_page.rows[:labelled_rows]
        for label in ITEMS
    ]
    kept = found_page(made_page)
    zones = []
    for zone in kept["zones"]:
        own = (label for label, box in cells if zone["box"][:2] == [box[0], box[1]])
        zones.append({"id": zone["id"], "box": zone["box"], "text": zone["text"], "label": next(own, None)})
    return {"width": kept["width"], "height": kept["height"], "zones": zones}


def test_cells_of_feedback_show_in_tables_and_lists(client: httpx.Client) -> None:
    for seed in range(3):
        assert client.post("/layout/models/invoice/samples", json=invoice_zones(seed, 2)).status_code == 201
    assert client.patch("/layout/models/invoice/settings", json={"items": list(ITEMS)}).status_code == 200
    made_class = client.post("/layout/models/invoice/initialize")
    assert made_class.json()["warnings"] == []
    sent = invoice_zones(20, 0)
    data = {"zones": json.dumps(sent), "models": "invoice"}
    answer = client.post("/layout", data=data).json()
    rows = answer["tables"][0]["rows"]
    [cell] = [zone for zone in answer["zones"] if zone["box"] == rows[1][3]["box"]]
    body = {"class": "invoice", "labels": {cell["id"]: "amount"}, "texts": {cell["id"]: "77.00"}}
    told = give(client, answer["id"], body)
    assert [each["code"] for each in told["warnings"]] == []
    assert cell["id"] not in {each["zone"] for each in told["wrong"]}
    shown = client.get(f"/layout/results/{answer['id']}").json()
    changed = shown["tables"][0]["rows"][1][3]
    assert (changed["text"], changed["found"]["text"]) == ("77.00", rows[1][3]["text"])
    listed = client.get("/layout/results", params={"format": "csv", "rows": "items"}).text
    assert [row["amount"] for row in csv.DictReader(io.StringIO(listed))][1] == "77.00"
    assert client.delete(f"/layout/results/{answer['id']}/feedback").status_code == 200
    assert client.get(f"/layout/results/{answer['id']}").json()["tables"] == answer["tables"]
