"""POST /mosaic of the product itself, photos of one page in: the whole page out."""

import base64
import io
from collections.abc import Sequence

import httpx
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from services.contract.answers.mosaic import MosaicResult, Patch
from simulation.pages import own_pages
from simulation.scenes import POSES, photograph
from tests.counts import some
from tests.end_to_end.pictures import encoded

OVERLAPPING = ((0, 0, 800, 720), (0, 480, 800, 1200))
"""Boxes of two crops of a page of 800 x 1200."""
SIZE, PART = (1050, 1350), 1000
"""Width and height of a photo of the whole page, and of the part of it that is sent, px."""


def post(service: httpx.Client, photos: Sequence[Image.Image], **fields: str) -> httpx.Response:
    files = [("images", (f"{index}.png", encoded(photo, "PNG"))) for index, photo in enumerate(photos)]
    return service.post("/mosaic", files=files, data=fields)


def described(service: httpx.Client, photos: Sequence[Image.Image], **fields: str) -> MosaicResult:
    response = post(service, photos, format="json", embed="true", **fields)
    assert response.status_code == 200, response.text
    return MosaicResult.model_validate_json(response.content)


def place(patch: Patch, size: tuple[int, int], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mosaic points (N, 2) of photo points (N, 2), by the mesh (bilinear)."""
    assert patch.mesh is not None
    target = np.array(patch.mesh.target)
    nodes = np.array([patch.mesh.columns, patch.mesh.rows])
    at = points / (np.array(size) - 1) * (nodes - 1)
    i, j = np.minimum(at.astype(int), nodes - 2).T
    s, t = (at - np.stack([i, j], axis=1)).T[..., None]
    upper = (1 - s) * target[j, i] + s * target[j, i + 1]
    lower = (1 - s) * target[j + 1, i] + s * target[j + 1, i + 1]
    placed: NDArray[np.float64] = (1 - t) * upper + t * lower
    return placed


def likeness(
    page: Image.Image, result: MosaicResult, points: NDArray[np.float64], at: NDArray[np.float64]
) -> float:
    """Correlation of the page at `points` with the mosaic at the places `at` of them."""
    assert result.image is not None
    with Image.open(io.BytesIO(base64.b64decode(result.image))) as mosaic:
        found = np.asarray(mosaic.convert("L"), np.float64)
    x, y = np.rint(at).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < result.width) & (y < result.height)
    assert inside.mean() > 0.8  # bare margins may be cropped
    true = np.asarray(page.convert("L"), np.float64)[tuple(points[inside].astype(int).T[::-1])]
    return float(np.corrcoef(true, found[y[inside], x[inside]])[0, 1])


def grid(width: int, height: int) -> NDArray[np.float64]:
    x, y = np.meshgrid(np.arange(0.0, width), np.arange(0.0, height))
    return np.stack([x.ravel(), y.ravel()], axis=1)


@pytest.mark.long
@pytest.mark.parametrize(
    "options", some(2, [{}, {"composition": "average"}, {"illumination": "keep"}, {"base": "1"}])
)
def test_two_scans_make_the_page(service: httpx.Client, page: Image.Image, options: dict[str, str]) -> None:
    crops = [page.crop(box) for box in OVERLAPPING]
    result = described(service, crops, rectify="false", upright="false", **options)
    assert [patch.placed for patch in result.patches] == [True, True]
    assert (result.unplaced, len(result.pairs)) == ([], 1)
    assert result.pairs[0].overlap_fraction == pytest.approx(1 / 3, abs=0.02)
    assert result.base == int(options.get("base", result.base))
    points = grid(800, 720)
    upper = place(result.patches[0], (800, 720), points)
    assert likeness(page, result, points, upper) > 0.95
    lower = place(result.patches[1], (800, 720), points)
    assert likeness(page, result, points + np.array([0.0, 480.0]), lower) > 0.95
    common = points[:, 1] >= 480
    apart = np.linalg.norm(upper[common] - lower[: common.sum()], axis=1)
    assert apart.max() < 1


def test_a_stranger_is_named(service: httpx.Client, page: Image.Image) -> None:
    other = Image.fromarray(own_pages(800, 1200)[4].image)
    photos = [page.crop(OVERLAPPING[0]), other.crop(OVERLAPPING[0]), page.crop(OVERLAPPING[1])]
    result = described(service, photos, rectify="false")
    assert result.unplaced == [1]
    assert [warning.code for warning in result.warnings if "images[1]" in warning.detail] == ["unplaced"]
    assert result.patches[1] == Patch(placed=False, mesh=None, scale=None, sharpness=None)


def test_photos_of_two_pages(service: httpx.Client, page: Image.Image) -> None:
    other = Image.fromarray(own_pages(800, 1200)[4].image)
    response = post(service, [page.crop(OVERLAPPING[0]), other.crop(OVERLAPPING[1])], rectify="false")
    assert (response.status_code, response.json()["code"]) == (422, "not-overlapping")


def test_blank_photos_are_named(service: httpx.Client) -> None:
    response = post(service, [Image.new("RGB", (640, 480), "white")] * 2)
    problem = response.json()
    assert (response.status_code, problem["code"]) == (422, "no-text")
    assert {"images[0]", "images[1]"} <= {word.rstrip(":") for word in problem["detail"].split()}


def test_photos_from_two_places(service: httpx.Client) -> None:
    """The upper part of one photo and the lower part of another, each from its own place."""
    width, height = SIZE
    taken = [photograph(own_pages(800, 1200)[0], pose, 0.0, size=SIZE) for pose in (POSES[0], POSES[1])]
    tops = (0, height - PART)
    parts = [Image.fromarray(photo.image[top : top + PART]) for photo, top in zip(taken, tops, strict=True)]
    result = described(service, parts)
    assert (result.unplaced, result.orientation.mirrored) == ([], False)
    points = grid(800, 1200)[::997]
    places = np.full((2, len(points), 2), np.nan)
    for part, (photo, top) in enumerate(zip(taken, tops, strict=True)):
        seen = photo.truth.page_to_photo(points) - np.array([0.0, top])
        inside = ((seen >= 0) & (seen <= np.array([width, PART]) - 1)).all(axis=1)
        places[part, inside] = place(result.patches[part], (width, PART), seen[inside])
    apart = np.linalg.norm(places[0] - places[1], axis=1)
    assert np.isfinite(apart).mean() > 0.2  # both show these points of the page
    assert np.nanmedian(apart) < 0.5
