"""`python -m app remeasure`: images of samples are kept, measured again, and models get new versions."""

import json
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.learning.remeasuring import remeasure
from app.main import create_app
from app.settings import Settings
from app.storage.blobs import FOLDER
from tests.app.scripted import OPERATIONS
from tests.app.scripted_layout import PAGE
from tests.app.scripts import upload
from tests.app.serving import SETTINGS, serving
from tests.app.test_layout_sample_archives import archive


def labelled(text: str) -> dict[str, Any]:
    return {**PAGE, "zones": [{**PAGE["zones"][0], "label": "sender", "text": text}]}


def add(client: httpx.Client, name: str, text: str, image: bytes | None = None) -> str:
    path = f"/layout/models/{name}/samples"
    files = {"zones": (None, json.dumps(labelled(text)))} | ({"image": ("a.png", image)} if image else {})
    added = client.post(path, files=files)
    added.raise_for_status()
    return str(added.json()["id"])


def images(folder: Path) -> dict[str, int]:
    """Bytes of the kept images by the ids of their samples."""
    found = (folder / FOLDER / "sample-images").rglob("*")
    return {path.parent.name: path.stat().st_size for path in found if path.is_file()}


def test_all_samples_with_images_are_measured_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.learning.remeasuring.configure_logs", lambda level: None)
    picture = upload("kept")
    with serving(data_dir=tmp_path) as client:
        ids = [add(client, "letter", "with", picture), add(client, "letter", "without")]
        assert add(client, "letter", "with", picture) == ids[0]
        files = {"memo/1.json": json.dumps(labelled("archive")).encode(), "memo/1.png": picture}
        path = "/layout/models/memo/samples/archive"
        report = client.post(path, files={"archive": ("a.zip", archive(files))}).json()
        ids.append(report["pages"][0]["id"])
        deleted = add(client, "memo", "deleted", picture)
        client.delete(f"/layout/models/memo/samples/{deleted}").raise_for_status()
        client.post("/layout/models/letter/initialize").raise_for_status()
        kept = images(tmp_path)
        assert {kept[ids[0]], kept[ids[2]]} == {len(picture)}
        assert ids[1] not in kept
        app = create_app(Settings(**{**SETTINGS, "data_dir": tmp_path}), OPERATIONS)
        assert remeasure(["letter", "memo", "nobody"], app) == 1
        said = capsys.readouterr().out.splitlines()
        assert "letter: 2 samples; 1 measured again, 1 of them changed, 0 failed; 1 have no image" in said[1]
        assert "Version 2 of the model is made from 2 samples: 1 by segmentation of" in said[1]
        assert "It has no model yet." in said[2]
        assert "nobody" in said[3]
        newest, first = client.get("/layout/models/letter/versions").json()["versions"]
        assert (first["version"], newest["version"], newest["origin"]) == (1, 2, "initialize")
        assert newest["note"].endswith(f"1 by segmentation of {len(picture)} bytes, 1 without")
        sample = client.get(f"/layout/models/letter/samples/{ids[0]}").json()
        assert sample["segmentation"] == f"of {len(picture)} bytes"
        assert client.get(f"/layout/models/letter/samples/{ids[1]}").json()["segmentation"] is None


def test_the_first_page_of_a_new_class_keeps_its_picture(tmp_path: Path) -> None:
    """Feedback that makes a class has no upload; the picture of the result is the image of the sample."""
    with serving(data_dir=tmp_path, blob_url="") as client:
        kept = {}
        for name, keep in (("new", "true"), ("other", "false")):
            sent = client.post("/layout", files={"image": upload("")}, data={"keep_image": keep}).json()
            body = {"class": name, "new_class": True, "labels": {"z1": "title", "z2": None}}
            told = client.post(f"/layout/results/{sent['id']}/feedback", json=body).json()
            kept[told["sample"]] = sent["image"]
    with_picture = {sample: image["bytes"] for sample, image in kept.items() if image}
    assert images(tmp_path) == with_picture
    assert len(with_picture) == 1
