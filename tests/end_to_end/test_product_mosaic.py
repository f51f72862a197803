"""POST /mosaic of the product itself: what it makes of bad photos, and how fast it says so."""

from collections.abc import Sequence

import httpx
import pytest
from PIL import Image

from tests.end_to_end.pictures import bomb, encoded, noise


def post(service: httpx.Client, photos: Sequence[bytes], **fields: str) -> httpx.Response:
    files = [("images", (f"photo-{index}", photo)) for index, photo in enumerate(photos)]
    return service.post("/mosaic", files=files, data=fields)


def problem_of(response: httpx.Response) -> tuple[int, str, str | None]:
    assert response.headers["content-type"] == "application/problem+json"
    problem = response.json()
    assert problem["status"] == response.status_code
    return response.status_code, problem["code"], problem.get("field")


@pytest.mark.parametrize("number", [1, 17])
def test_the_number_of_photos(service: httpx.Client, page: Image.Image, number: int) -> None:
    response = post(service, [encoded(page, "JPEG")] * number)
    assert problem_of(response) == (422, "invalid-option", "images")
    assert ("/rectify" in response.json()["detail"]) == (number == 1)


BAD = {
    "empty": (b"", 415, "unsupported-media-type"),
    "text": (b"no picture at all", 415, "unsupported-media-type"),
    "bomb": (bomb(), 413, "too-large"),
    "cut": (encoded(noise("RGB"), "JPEG")[:-900], 422, "undecodable-image"),
    "no pixels": (bomb(60, 80), 422, "undecodable-image"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_photo_is_named(service: httpx.Client, page: Image.Image, name: str) -> None:
    photo, status, code = BAD[name]
    response = post(service, [encoded(page, "PNG"), photo, encoded(page, "PNG")])
    assert problem_of(response) == (status, code, "images[1]")


def test_the_pixels_of_all_photos_are_judged_by_their_headers(service: httpx.Client) -> None:
    response = post(service, [bomb(7000, 8600)] * 4)
    assert problem_of(response) == (413, "too-large", "images")
    assert "240.8 megapixels together" in response.json()["detail"]


@pytest.mark.parametrize("rectify", ["true", "false"])
def test_blank_photos(service: httpx.Client, rectify: str) -> None:
    blank = encoded(Image.new("RGB", (640, 480), "white"), "PNG")
    status, code, _ = problem_of(post(service, [blank, blank], rectify=rectify))
    assert status == 422
    assert code in {"no-text", "not-overlapping"}
