"""Kept photos: answered again without being sent, bound in any order, their owner's alone, and gone in time."""

import io
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pikepdf
import pytest
from PIL import Image
from pydantic import ValidationError

from app.schemas.kept_pages import RenderRequest
from services.contract.answers.rectify import RectifyResult
from tests.app.scripts import upload
from tests.app.serving import POLL_S, serving
from tests.app.test_layout_images import files_in
from tests.app.test_problems import assert_problem

ALICE, BOB, ADMIN = ({"X-API-Key": key} for key in ("alice-secret", "bob-secret", "root-secret"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("photos")


@pytest.fixture(scope="module")
def client(folder: Path) -> Iterator[httpx.Client]:
    keys = ("alice:alice-secret", "bob:bob-secret", "admin:root-secret")
    with serving(api_keys=keys, data_dir=folder) as client:
        yield client


def keep(client: httpx.Client, key: dict[str, str] = ALICE, **data: str) -> str:
    """The path of a page whose photo was kept."""
    files = {"image": ("my page.png", upload(""))}
    asked = {"keep_photo": "true", "format": "json", **data}
    answer = client.post("/rectify", files=files, data=asked, headers=key)
    assert answer.status_code == 200, answer.text
    return f"/pages/{answer.json()['page_id']}"


def render(client: httpx.Client, path: str, **body: Any) -> httpx.Response:
    return client.post(f"{path}/render", json=body, headers=ALICE)


def picture_of(answer: httpx.Response) -> Image.Image:
    assert answer.status_code == 200, answer.text
    return Image.open(io.BytesIO(answer.content)).convert("RGB")


def test_an_image_answer_names_the_kept_page_in_a_header(client: httpx.Client) -> None:
    files = {"image": ("photo.jpg", upload(""))}
    kept = client.post("/rectify", files=files, data={"keep_photo": "true"}, headers=ALICE)
    assert client.get(f"/pages/{kept.headers['document-page-id']}", headers=ALICE).status_code == 200
    assert "document-page-id" not in client.post("/rectify", files=files, headers=ALICE).headers


def test_a_kept_page_is_described_and_its_photo_is_shown(client: httpx.Client) -> None:
    path = keep(client)
    described = RectifyResult.model_validate(client.get(path, headers=ALICE).json())
    assert (described.page_id, described.width, described.height) == (path.removeprefix("/pages/"), 80, 60)
    photo = client.get(f"{path}/photo", headers=ALICE)
    assert photo.headers["content-type"] == "image/jpeg"
    assert picture_of(photo).size == (80, 60)
    assert picture_of(client.get(f"{path}/photo?width=40", headers=ALICE)).size == (40, 30)
    assert picture_of(client.get(f"{path}/photo?width=4000", headers=ALICE)).size == (80, 60)


def test_it_is_answered_again_and_what_was_said_counts_from_then_on(client: httpx.Client) -> None:
    path = keep(client)
    assert picture_of(render(client, path)).size == (80, 60)
    turned = render(client, path, rotate=90, format="json").json()
    assert (turned["width"], turned["height"], turned["orientation"]["rotation_deg"]) == (60, 80, 90)
    assert turned["orientation"]["photo_rotation_deg"] == 90
    assert turned["mesh"]["source"][0][0] == [0, 59]
    assert turned["page_id"] == path.removeprefix("/pages/")
    described = client.get(path, headers=ALICE).json()
    assert {**described, "timings_ms": 0} == {**turned, "timings_ms": 0}, (
        "the page is described as it was answered last"
    )
    picture = picture_of(render(client, path))
    assert picture.size == (60, 80), "the turn stays"
    (red, _, no_blue), (no_red, _, blue) = (np.asarray(picture)[40, x].tolist() for x in (50, 10))
    assert min(red, blue) > 150, "what was at the top is at the right"
    assert max(no_red, no_blue) < 50
    wide = picture_of(render(client, path, margin=10, rotate="auto"))
    assert wide.size == (96, 76)
    assert wide.getpixel((2, 2)) == (255, 255, 255), "beyond the photo"
    assert picture_of(render(client, path, max_width=48)).size == (48, 38)


def test_a_page_is_described_at_full_size_however_it_was_shown(client: httpx.Client) -> None:
    path = keep(client, max_width="40")
    assert client.get(path, headers=ALICE).json()["width"] == 80
    assert render(client, path, rotate=90, max_width=30, format="json").json()["width"] == 30
    described = client.get(path, headers=ALICE).json()
    assert (described["width"], described["height"]) == (60, 80)
    assert described["mesh"]["source"][0][0] == [0, 59]


def test_other_corners_are_analysed_and_kept(client: httpx.Client, folder: Path) -> None:
    path = keep(client)
    corners = [[10, 5], [70, 8], [68, 50], [12, 55]]
    answer = render(client, path, corners=corners, format="json").json()
    assert answer["corners"] == corners
    assert answer["timings_ms"]["analysis"] > 0
    source = answer["mesh"]["source"]
    assert [source[0][0], source[0][-1], source[-1][-1], source[-1][0]] == corners
    again = render(client, path, rotate=180, format="json").json()
    assert again["corners"] == corners[2:] + corners[:2]
    assert [name for name in files_in(folder) if name.isdigit()], "the photo is still there"
    assert client.get(f"{path}/photo", headers=ALICE).status_code == 200


def test_corners_that_were_given_can_be_taken_back(client: httpx.Client) -> None:
    path = keep(client)
    found = render(client, path, format="json").json()
    given = render(client, path, corners=[[10, 5], [70, 8], [68, 50], [12, 55]], format="json").json()
    again = render(client, path, corners="Auto", format="json").json()
    assert given["corners"] != found["corners"] == again["corners"]
    assert again["mesh"] == found["mesh"]


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"corners": [[10, 5], [70, 8], [68, 50]]}, "corners"),
        ({"corners": [[10, 5], [68, 50], [70, 8], [12, 55]]}, "corners"),
        ({"corners": "here"}, "corners"),
        ({"corners": [["a", 1], [70, 8], [68, 50], [12, 55]]}, "corners[0][0]"),
        ({"rotate": 45}, "rotate"),
        ({"margin": 21}, "margin"),
        ({"illumination": "sepia"}, "illumination"),
        ({"crop": "all"}, "crop"),
        ({"format": "hocr"}, "format"),
        ({"turn": 90}, "turn"),
    ],
)
def test_what_is_said_is_checked(client: httpx.Client, body: dict[str, Any], field: str) -> None:
    answer = render(client, keep(client), **body)
    assert_problem(answer, 422, "invalid-option")
    assert answer.json()["field"] == field


def test_pages_are_bound_in_their_order_each_as_it_was_last_answered(client: httpx.Client) -> None:
    first, second = keep(client), keep(client)
    render(client, second, rotate=270, illumination="bw")
    ids = [path.removeprefix("/pages/") for path in (second, first, second)]
    answer = client.post("/pages/bind", json={"pages": ids, "format": "pdf"}, headers=ALICE)
    assert answer.headers["content-type"] == "application/pdf"
    assert "my page-flat.pdf" in answer.headers["content-disposition"]
    with pikepdf.open(io.BytesIO(answer.content)) as document:
        sizes = [(float(page.mediabox[2]), float(page.mediabox[3])) for page in document.pages]
    assert [width < height for width, height in sizes] == [True, False, True]
    tiff = client.post("/pages/bind", json={"pages": ids, "format": "tiff"}, headers=ALICE)
    assert getattr(Image.open(io.BytesIO(tiff.content)), "n_frames", 1) == 3
    for body in ({"pages": []}, {"pages": ids, "format": "jpeg"}, {}):
        assert_problem(client.post("/pages/bind", json=body, headers=ALICE), 422, "invalid-option")
    gone = client.post("/pages/bind", json={"pages": [ids[0], "nothing"]}, headers=ALICE)
    assert_problem(gone, 404, "not-found")


def test_reading_a_page_changes_nothing_that_was_said(client: httpx.Client) -> None:
    path = keep(client)
    turned = render(client, path, rotate=90, format="json").json()
    assert client.get(path, headers=ALICE).json() == {**turned, "timings_ms": {}}
    small = render(client, path, format="json", max_width=20).json()
    assert (small["width"], small["orientation"]["rotation_deg"]) == (20, 90)
    assert client.get(path, headers=ALICE).json()["width"] == turned["width"] == 60
    assert_problem(render(client, path, text=True, language="xx1"), 422, "invalid-option")
    assert_problem(render(client, path, language="nolanguage"), 422, "invalid-option")
    bound = {"pages": [path.removeprefix("/pages/")], "format": "txt", "language": "nolanguage"}
    assert_problem(client.post("/pages/bind", json=bound, headers=ALICE), 422, "invalid-option")


def test_a_page_is_its_owners_and_admins_see_all(client: httpx.Client) -> None:
    path = keep(client)
    for method, hidden in (("GET", path), ("GET", f"{path}/photo"), ("DELETE", path)):
        assert_problem(client.request(method, hidden, headers=BOB), 404, "not-found")
    for hidden in (f"{path}/render", "/pages/bind"):
        body = {} if hidden.endswith("render") else {"pages": [path.removeprefix("/pages/")]}
        assert_problem(client.post(hidden, json=body, headers=BOB), 404, "not-found")
    assert client.get(path, headers=ADMIN).status_code == 200


PATHS = ("/rectify", "/rectify/pages", "/mosaic", "/mosaic/json")


@pytest.mark.parametrize("path", PATHS)
def test_kept_photos_stand_for_files(client: httpx.Client, path: str) -> None:
    """In the places of their parts among the files, with their names."""
    one, other = (keep(client).removeprefix("/pages/") for _ in range(2))
    part = "image" if "rectify" in path else "images"
    sent = [("kept_page", (None, one)), (part, ("sent.png", upload(""))), ("kept_page", (None, other))]
    asked = {"format": "json"} if path in ("/rectify", "/mosaic") else {}
    answer = client.post(path, files=sent, data=asked, headers=ALICE)
    assert answer.status_code == 200, answer.text
    assert len(answer.json()["pages" if "rectify" in path else "patches"]) == 3
    if asked:
        file = client.post(path, files=sent, data={"format": "pdf"}, headers=ALICE)
        assert "my page-" in file.headers["content-disposition"]
    assert client.get(f"/pages/{one}/photo", headers=ALICE).status_code == 200, "it is still kept"


def test_a_job_has_the_photo_of_both_pages_itself(client: httpx.Client) -> None:
    """Not the id of the page, which is deleted meanwhile."""
    page = keep(client).removeprefix("/pages/")
    asked = {"kept_page": page, "pages": "both", "format": "json"}
    job = client.post("/rectify", data=asked, headers={**ALICE, "Prefer": "respond-async"}).json()
    client.delete(f"/pages/{page}", headers=ALICE)
    while not client.get(f"/jobs/{job['id']}", headers=ALICE).json()["ended"]:
        time.sleep(POLL_S)
    assert client.get(job["links"]["result"], headers=ALICE).json()["pages"]


def test_photos_that_cannot_stand_for_files_are_refused(client: httpx.Client) -> None:
    page = keep(client).removeprefix("/pages/")

    def refused(
        code: str, status: int, key: dict[str, str] = ALICE, path: str = "/rectify", **data: Any
    ) -> None:
        assert_problem(client.post(path, data=data, headers=key), status, code)

    refused("not-found", 404, BOB, kept_page=page)
    refused("not-found", 404, kept_page="nothing")
    refused("invalid-option", 422, path="/mosaic", kept_page=page)  # one photo
    refused("invalid-option", 422, path="/layout", kept_page=page)
    assert client.post("/rectify", data={"kept_page": ["", page]}, headers=ADMIN).status_code == 200
    file = client.post("/rectify", files={"kept_page": ("a.png", upload(""))}, headers=ALICE)
    assert assert_problem(file, 422, "invalid-option")["field"] == "kept_page"


def test_nothing_is_left_of_a_deleted_page(client: httpx.Client, folder: Path) -> None:
    before = files_in(folder)
    path = keep(client)
    assert len(files_in(folder)) == len(before) + 1
    deleted = client.delete(path, headers=ALICE)
    assert (deleted.status_code, deleted.headers.get("content-type")) == (204, None)
    assert files_in(folder) == before
    for method, gone in (("GET", path), ("GET", f"{path}/photo"), ("DELETE", path)):
        assert_problem(client.request(method, gone, headers=ALICE), 404, "not-found")


def test_photos_are_kept_as_the_operator_says_and_pictures_of_results_are_another_thing(
    tmp_path: Path,
) -> None:
    files = {"image": ("photo.jpg", upload(""))}

    def page_id(client: httpx.Client, **data: str) -> object:
        return client.post("/rectify", files=files, data={"format": "json", **data}).json()["page_id"]

    with serving(keep_photos=True, data_dir=tmp_path / "a") as client:
        assert page_id(client)
        assert page_id(client, keep_photo="false") is None
        assert page_id(client, preview="true") is None
    with serving(keep_images=True, data_dir=tmp_path / "b") as client:
        assert page_id(client) is None


def test_photos_expire_and_give_way_to_newer_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.storage.expiry.PURGE_EVERY_S", POLL_S)
    with serving(data_dir=tmp_path, max_kept_photos_bytes=20_000) as client:
        paths = [keep(client, {}) for _ in range(12)]
        deadline = time.monotonic() + 20
        while client.get(f"{paths[0]}/photo").status_code != 404:
            assert time.monotonic() < deadline
            time.sleep(POLL_S)
        assert "MAX_KEPT_PHOTOS_BYTES" in client.get(f"{paths[0]}/photo").json()["detail"]
        assert client.get(f"{paths[-1]}/photo").status_code == 200
    with serving(data_dir=tmp_path, result_ttl_s=1) as client:
        path = keep(client, {})
        while client.get(path).status_code != 404 or len(files_in(tmp_path)) > 11:
            assert time.monotonic() < deadline + 20
            time.sleep(POLL_S)
        json.dumps(path)


@pytest.mark.parametrize(
    ("name", "value"), [("quality", True), ("max_width", True), ("margin", True), ("text", 1)]
)
def test_json_s_true_is_no_number(name: str, value: object) -> None:
    with pytest.raises(ValidationError):
        RenderRequest.model_validate({name: value})
