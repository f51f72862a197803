"""Cameras: remembered by key, used after three photos, listed, forgotten; never in the way of a photo."""

import math
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from models.repository import Store
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem
from tests.app.test_rectify import notices

ALICE, BOB = ({"X-API-Key": key} for key in ("alice-secret", "bob-secret"))


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    folder = tmp_path_factory.mktemp("cameras")
    with serving(api_keys=("alice:alice-secret", "bob:bob-secret"), data_dir=folder) as client:
        yield client


def flatten(client: httpx.Client, key: dict[str, str], camera: str) -> httpx.Response:
    data = {"format": "json", "camera": camera}
    response = client.post("/rectify", files={"image": upload("")}, data=data, headers=key)
    assert response.status_code == 200, response.text
    return response


def test_a_camera_is_remembered_by_its_key(client: httpx.Client) -> None:
    assert "cameras=()" in notices(flatten(client, ALICE, "tablet 3"))["options"]
    for _ in range(2):
        flatten(client, ALICE, "tablet 3")
    (camera,) = client.get("/cameras", headers=ALICE).json()["cameras"]
    assert (camera["name"], camera["photos"], camera["decides"]) == ("tablet 3", 3, True)
    # 25 pixels and a photo of 40 x 30: half the diagonal is 25.
    assert camera["field_of_view_deg"] == pytest.approx(90.0, abs=0.01)
    assert "CameraMemory(name='tablet 3'" in notices(flatten(client, ALICE, "tablet 3"))["options"]
    assert client.get("/cameras", headers=BOB).json() == {"cameras": []}
    assert "cameras=()" in notices(flatten(client, BOB, "another"))["options"]


def test_a_mosaic_knows_the_cameras_of_its_key(client: httpx.Client) -> None:
    for _ in range(3):
        flatten(client, ALICE, "wide")
    files = [("images", upload("")), ("images", upload(""))]
    for key, known in ((ALICE, True), (BOB, False)):
        data = {"format": "json", "camera": "wide"}
        told = notices(client.post("/mosaic", files=files, data=data, headers=key))["options"]
        assert "camera='wide'" in told
        assert ("CameraMemory(name='wide'" in told) is known
    counts = {
        each["name"]: each["photos"] for each in client.get("/cameras", headers=ALICE).json()["cameras"]
    }
    assert counts["wide"] == 3, "photos of a mosaic show parts of a page, and teach nothing"


def test_a_camera_is_forgotten_by_its_key_only(client: httpx.Client) -> None:
    flatten(client, ALICE, "phone")
    assert_problem(client.delete("/cameras/phone", headers=BOB), 404, "not-found")
    assert client.delete("/cameras/phone", headers=ALICE).status_code == 204
    assert_problem(client.delete("/cameras/phone", headers=ALICE), 404, "not-found")
    assert "phone" not in client.get("/cameras", headers=ALICE).text


@pytest.mark.parametrize("name", [" ", "-a", "a/b", "x" * 101])
def test_a_name_is_a_token(client: httpx.Client, name: str) -> None:
    response = client.post("/rectify", files={"image": upload("")}, data={"camera": name}, headers=ALICE)
    assert_problem(response, 422, "invalid-option")


def test_the_store_keeps_the_newest_photos_and_cameras(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store.sqlite3") as store:
        store.remember_cameras(None, {"a": [(math.log(2), 0.02)] * 30})
        store.remember_cameras("anna", {str(number): [(0.1, 0.02)] for number in range(60)})
        ((memory, _),) = store.cameras(None)
        assert (memory.name, memory.photos) == ("a", 24)
        assert memory.log_focal == pytest.approx(math.log(2), abs=1e-4)
        assert len(store.cameras("anna")) == 50
        assert not store.forget_camera("anna", "a")
        assert store.forget_camera(None, "a")
        assert store.cameras(None) == []
