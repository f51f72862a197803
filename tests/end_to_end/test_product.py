"""The product itself, `python -m app`: pictures in, pictures and JSON out."""

import base64
import io
from pathlib import Path

import httpx
import img2pdf
import numpy as np
import pikepdf
import pytest
from PIL import Image

from services.contract.answers.rectify import RectifyResult, Strips
from simulation.pages import own_pages
from simulation.scenes import BOOK, POSES, photograph
from tests.counts import some
from tests.end_to_end.pictures import bomb, encoded, noise
from tests.end_to_end.processes import Service

MEDIA_TYPES = {
    "JPEG": "image/jpeg",
    "PNG": "image/png",
    "WEBP": "image/webp",
    "TIFF": "image/tiff",
    "HEIF": "image/jpeg",
}


def post(service: httpx.Client, photo: bytes, accept: str = "*/*", **fields: str) -> httpx.Response:
    return service.post(
        "/rectify", files={"image": ("photo", photo)}, data=fields, headers={"Accept": accept}
    )


@pytest.mark.long
@pytest.mark.parametrize("format_", some(2, [*MEDIA_TYPES]))
def test_a_page_comes_back_in_its_own_format(service: httpx.Client, page: Image.Image, format_: str) -> None:
    response = post(service, encoded(page, format_))
    assert (response.status_code, response.headers["content-type"]) == (200, MEDIA_TYPES[format_])
    assert response.headers["document-kind"] == "planar"
    assert response.headers["document-rotation"] in {"0", "90", "180", "270"}
    assert "decode;dur=" in response.headers["server-timing"]
    with Image.open(io.BytesIO(response.content)) as flat:
        flat.load()
        assert min(flat.size) > 100
    assert np.asarray(flat.convert("L")).std() > 5  # there is something on it


def test_the_json_is_the_contract_s(service: httpx.Client, page: Image.Image) -> None:
    response = post(service, encoded(page, "JPEG"), accept="application/json", embed="true")
    assert response.status_code == 200
    result = RectifyResult.model_validate_json(response.content)
    assert result.image is not None
    with Image.open(io.BytesIO(base64.b64decode(result.image))) as flat:
        assert flat.size == (result.width, result.height)
    assert len(result.mesh.source) == result.mesh.rows
    assert {len(row) for row in result.mesh.source} == {result.mesh.columns}


def test_a_bent_page_comes_back_in_strips(service: httpx.Client) -> None:
    size = (900, 1160)
    photo = photograph(own_pages(700, 1090)[0], POSES[0], 0.0, BOOK, size=size)
    response = post(service, encoded(Image.fromarray(photo.image), "PNG"), accept="application/json")
    assert response.status_code == 200
    result = RectifyResult.model_validate_json(response.content)
    assert (result.kind, result.warnings) == ("curved", [])
    assert isinstance(result.surface, Strips)
    assert len(result.surface.rulings) == len(result.surface.normals) + 1 > 10
    places = np.array([ruling.point for ruling in result.surface.rulings])
    angles = np.radians([ruling.angle_deg for ruling in result.surface.rulings])
    seen = photo.truth.on_page(places)
    off = (angles - photo.truth.rulings(places) + np.pi / 2) % np.pi - np.pi / 2
    assert seen.mean() > 0.8
    assert np.degrees(np.abs(off[seen])).mean() < 2.0
    assert result.camera.focal_length_px is not None
    assert abs(result.camera.focal_length_px / photo.truth.focal_length_px - 1) < 0.1
    normals = np.array(result.surface.normals)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    assert np.ptp(normals[:, 0]) > 0.3  # it bends


def test_a_pdf_has_one_page(service: httpx.Client, page: Image.Image) -> None:
    response = post(service, encoded(page, "JPEG"), format="pdf")
    assert response.headers["content-type"] == "application/pdf"
    with pikepdf.open(io.BytesIO(response.content)) as document:
        assert len(document.pages) == 1


BAD = {
    "empty": (b"", {415}),
    "text": (b"no picture at all", {415}),
    "svg": (b"<svg xmlns='http://www.w3.org/2000/svg'/>", {415}),
    "gif": (encoded(noise("P"), "GIF"), {415}),
    "pdf without text": (img2pdf.convert(encoded(noise("RGB"), "JPEG")), {200}),
    "bomb": (bomb(), {413}),
    "cut JPEG": (encoded(noise("RGB"), "JPEG")[:-900], {422}),
    "cut PNG": (encoded(noise("RGB"), "PNG")[:-900], {422}),
    "only a signature": (b"\xff\xd8\xff\xe0", {415, 422}),
    "CMYK": (encoded(noise("CMYK"), "JPEG"), {200, 422}),
    "palette": (encoded(noise("P"), "PNG"), {200, 422}),
    "alpha": (encoded(noise("RGBA"), "PNG"), {200, 422}),
    "16 bits": (encoded(Image.fromarray(np.zeros((60, 80), np.uint16)), "PNG"), {200, 422}),
    "animated": (encoded(noise("RGB"), "WEBP", save_all=True, append_images=[noise("RGB")]), {200, 422}),
    "one pixel": (encoded(Image.new("RGB", (1, 1)), "PNG"), {200, 422}),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_gets_a_problem(service: httpx.Client, name: str) -> None:
    photo, expected = BAD[name]
    response = post(service, photo)
    assert response.status_code in expected
    if response.status_code != 200:
        assert response.headers["content-type"] == "application/problem+json"
        assert response.json()["status"] == response.status_code


def test_the_server_itself_loads_no_arrays(
    product: Service, service: httpx.Client, page: Image.Image
) -> None:
    assert post(service, encoded(page, "JPEG")).status_code == 200
    maps = Path(f"/proc/{product.process.pid}/maps").read_text(encoding="utf-8")
    assert "numpy" not in maps
    assert "cv2" not in maps
