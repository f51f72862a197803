"""Pictures that are kept with results: who gets them, in which sizes, and when they are gone."""

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.storage.blobs import FOLDER
from app.storage.kept_images import KeptImages
from models.errors import StoreUnavailable
from tests.app.scripted_layout import PAGE
from tests.app.scripts import JPEG, upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

PICTURE = JPEG + b"page"
ALICE, BOB, ADMIN = ({"X-API-Key": key} for key in ("alice-secret", "bob-secret", "root-secret"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("kept")


@pytest.fixture(scope="module")
def client(folder: Path) -> Iterator[httpx.Client]:
    keys = ("alice:alice-secret", "bob:bob-secret", "admin:root-secret")
    with serving(api_keys=keys, data_dir=folder) as client:
        yield client


def recognize(
    client: httpx.Client, key: dict[str, str] = ALICE, pages: int = 1, **data: str
) -> dict[str, Any]:
    files = [("image", ("page.png", upload("")))] * pages
    response = client.post("/layout", files=files, data=data, headers=key)
    assert response.status_code == 200, response.text
    result: dict[str, Any] = response.json()
    return result


def image_path(result: dict[str, Any]) -> str:
    return f"/layout/results/{result['id']}/image"


def files_in(folder: Path) -> list[str]:
    # Files and folders may go while they are listed; `os.walk` passes over them.
    return sorted(name for _, _, names in os.walk(folder / FOLDER) for name in names)


def test_a_picture_is_kept_where_it_was_asked_for(client: httpx.Client) -> None:
    result = recognize(client, keep_image="true")
    assert result["image"] == {"width": 20, "height": 30, "bytes": len(PICTURE)}
    answer = client.get(image_path(result), headers=ALICE)
    assert (answer.content, answer.headers["content-type"]) == (PICTURE, "image/jpeg")
    assert client.get(f"/layout/results/{result['id']}", headers=ALICE).json()["image"] == result["image"]
    head = client.head(image_path(result), headers=ALICE)
    assert (head.content, head.headers["content-length"]) == (b"", str(len(PICTURE)))


def test_a_browser_asks_again_and_gets_304(client: httpx.Client) -> None:
    path = image_path(recognize(client, keep_image="true"))
    first = client.get(path, headers=ALICE)
    assert first.headers["cache-control"] == "private, no-cache"
    again = client.get(path, headers={**ALICE, "If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize(("width", "asked"), [(19, b" at most 19 wide"), (20, b""), (30_000, b"")])
def test_a_smaller_picture_is_made_by_a_worker(client: httpx.Client, width: int, asked: bytes) -> None:
    path = image_path(recognize(client, keep_image="true"))
    assert client.get(path, params={"width": width}, headers=ALICE).content == PICTURE + asked
    assert client.get("/health/ready").json()["admitted"] == 0


def test_only_its_owner_gets_a_picture(client: httpx.Client) -> None:
    path = image_path(recognize(client, keep_image="true"))
    assert_problem(client.get(path, headers=BOB), 404, "not-found")
    assert client.get(path, headers=ADMIN).content == PICTURE
    token = client.post("/tokens", headers=ALICE).json()["token"]
    assert client.get(path, params={"token": token}).content == PICTURE, "a link in a page has no header"


def test_without_the_wish_there_is_none(client: httpx.Client, folder: Path) -> None:
    before = files_in(folder)
    result = recognize(client)
    assert result["image"] is None
    problem = assert_problem(client.get(image_path(result), headers=ALICE), 404, "not-found")
    assert "keep_image" in str(problem["detail"])
    assert files_in(folder) == before


def test_zones_alone_have_no_picture(client: httpx.Client) -> None:
    answer = client.post("/layout", data={"zones": json.dumps(PAGE), "keep_image": "true"}, headers=ALICE)
    assert_problem(answer, 422, "invalid-option")
    assert answer.json()["field"] == "keep_image"


def test_pages_of_a_document_have_pictures_of_their_own(client: httpx.Client, folder: Path) -> None:
    before = len(files_in(folder))
    document = recognize(client, pages=3, keep_image="true")
    assert len(files_in(folder)) == before + 3
    for page in document["pages"]:
        assert client.get(image_path(page), headers=ALICE).content == PICTURE
    problem = assert_problem(client.get(image_path(document), headers=ALICE), 404, "not-found")
    assert "Its pages have results of their own" in str(problem["detail"])
    client.delete(f"/layout/results/{document['id']}", headers=ALICE).raise_for_status()
    assert len(files_in(folder)) == before


def test_a_picture_goes_with_its_result(client: httpx.Client, folder: Path) -> None:
    before = files_in(folder)
    result = recognize(client, keep_image="true")
    assert len(files_in(folder)) == len(before) + 1
    client.delete(f"/layout/results/{result['id']}", headers=ALICE).raise_for_status()
    assert files_in(folder) == before
    assert_problem(client.get(image_path(result), headers=ALICE), 404, "not-found")


def test_it_is_sent_as_jpeg_only(client: httpx.Client) -> None:
    path = image_path(recognize(client, keep_image="true"))
    assert_problem(client.get(path, headers={**ALICE, "Accept": "image/webp"}), 406, "not-acceptable")
    assert client.get(path, headers={**ALICE, "Accept": "image/webp, image/*;q=0.8"}).content == PICTURE


def test_a_result_whose_picture_cannot_be_kept_is_not_kept(
    client: httpx.Client, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fail(*_: object) -> None:
        raise StoreUnavailable("the disk is full")

    before = files_in(folder)
    monkeypatch.setattr(KeptImages, "keep", fail)
    answer = client.post("/layout", files={"image": upload("")}, data={"keep_image": "true"}, headers=ALICE)
    assert_problem(answer, 503, "store-unavailable")
    assert files_in(folder) == before


def test_the_setting_holds_unless_a_request_overrides_it(tmp_path: Path) -> None:
    with serving(keep_images=True, data_dir=tmp_path) as client:
        assert recognize(client)["image"] is not None
        assert recognize(client, keep_image="false")["image"] is None
    assert len(files_in(tmp_path)) == 1


def until(condition: Any) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_expired_pictures_are_deleted_without_any_request(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.storage.expiry.PURGE_EVERY_S", 0.1)
    with serving(keep_images=True, data_dir=tmp_path, result_ttl_s=2) as client:
        path = image_path(recognize(client))
        assert client.get(path).content == PICTURE
        until(lambda: files_in(tmp_path) == [])
        assert_problem(client.get(path), 404, "not-found")


def test_the_oldest_pictures_give_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.storage.expiry.PURGE_EVERY_S", 0.1)
    room = 2 * len(PICTURE)
    with serving(keep_images=True, data_dir=tmp_path, max_kept_images_bytes=room) as client:
        results = [recognize(client) for _ in range(4)]
        until(lambda: len(files_in(tmp_path)) == 2)
        statuses = [client.get(image_path(result)).status_code for result in results]
        assert statuses == [404, 404, 200, 200]
        assert "MAX_KEPT_IMAGES_BYTES" in client.get(image_path(results[0])).json()["detail"]
        assert client.get(f"/layout/results/{results[0]['id']}").status_code == 200, "the result stays"


def test_a_drawn_page_says_where_the_page_is_in_it(client: httpx.Client) -> None:
    answer = client.post("/layout", files={"image": upload("")}, data={"format": "png"}, headers=ALICE)
    assert (answer.headers["document-scale"], answer.headers["document-offset"]) == ("1.5, 1.25", "0, 60")


def test_a_photo_that_was_flattened_comes_with_its_flat_page(client: httpx.Client) -> None:
    flat = recognize(client, rectify="true")["page"]
    assert list(flat) == ["photo", "corners", "orientation", "width", "height", "mesh"]
    assert recognize(client)["page"] is None
