"""POST /mosaic: photos and options in, representations out, problems that name the photo."""

import base64
from collections.abc import Sequence
from typing import get_args

import httpx
import pytest

from services.contract.answers.mosaic import MosaicResult
from services.contract.images import AnswerFormat
from tests.app.raw import connect, form, head, read_answer
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_health import sample
from tests.app.test_problems import assert_problem
from tests.app.test_uploads import code, until_sample

TWO = (upload(""), upload(""))
PNG, HEIC = (start + upload("") for start in (b"\x89PNG\r\n\x1a\n", b"\0\0\0\x18ftypheic"))


def post(
    client: httpx.Client,
    data: dict[str, str] | None = None,
    images: Sequence[bytes] = TWO,
    accept: str = "*/*",
) -> httpx.Response:
    files = [("images", ("photo.jpg", image)) for image in images]
    return client.post("/mosaic", files=files, data=data, headers={"Accept": accept})


def notices(response: httpx.Response) -> dict[str, str]:
    return {notice["code"]: notice["detail"] for notice in response.json()["warnings"]}


def test_an_image_answer_carries_the_facts_as_headers(client: httpx.Client) -> None:
    response = post(client, images=[*TWO, upload("")])
    assert (response.status_code, response.content) == (200, b"flat as jpeg")
    assert response.headers["content-type"] == "image/jpeg"
    assert response.headers["document-rotation"] == "90"
    assert response.headers["document-unplaced"] == "2"
    assert response.headers["document-warnings"] == "options, encoding, limits, bytes"
    assert response.headers["server-timing"] == "decode;dur=1.2, block_matches;dur=20.0"
    assert response.headers["vary"] == "Accept"
    assert "document-kind" not in response.headers


def test_a_json_answer_is_the_contract_s_result(client: httpx.Client) -> None:
    response = post(client, {"format": "json"})
    assert list(response.json()) == [
        "width", "height", "base", "orientation", "patches", "pairs", "surface", "unplaced", "text", "warnings",
        "timings_ms", "image", "image_media_type", "page_id",
    ]  # fmt: skip
    result = MosaicResult.model_validate(response.json())
    assert result.patches[0].mesh is not None
    assert result.patches[0].mesh.target == [[(0, 0), (19, 0)], [(0, 9), (19, 9)]]
    assert (result.patches[1].placed, result.unplaced, result.image) == (False, [1], None)


def test_embed_puts_the_image_into_the_json(client: httpx.Client) -> None:
    response = post(client, {"embed": "true"}, accept="application/json")
    assert base64.b64decode(response.json()["image"]) == b"flat"


def test_photos_arrive_whole_and_in_their_order(client: httpx.Client) -> None:
    images = [upload("") + b" " * size for size in (5, 3_000_000, 0, 1_500_000)]
    assert notices(post(client, {"format": "json"}, images))["bytes"] == str([len(image) for image in images])


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({}, "rectify=True, base=None, composition='selective', illumination='normalize'"),
        ({}, "upright=True"),
        ({"rectify": "false"}, "rectify=False"),
        ({"base": "auto"}, "base=None"),
        ({"base": "1"}, "base=1"),
        ({"base": ""}, "base=None"),
        ({"composition": "average"}, "composition='average'"),
        ({"illumination": "keep"}, "illumination='keep'"),
        ({"upright": "false"}, "upright=False"),
    ],
)
def test_options_reach_the_operation(client: httpx.Client, data: dict[str, str], expected: str) -> None:
    assert expected in notices(post(client, {**data, "format": "json"}))["options"]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("base", "2"),
        ("base", "15"),
        ("base", "16"),
        ("base", "-1"),
        ("base", "01"),
        ("base", "1.0"),
        ("base", "first"),
        ("composition", "sharp"),
        ("rectify", "1"),
        ("upright", "perhaps"),
        ("illumination", "bright"),
        ("format", "gif"),
        ("quality", "0"),
        ("embed", "maybe"),
        ("kind", "planar"),
    ],
)
def test_a_bad_option_is_named(client: httpx.Client, field: str, value: str) -> None:
    problem = assert_problem(post(client, {field: value}), 422, "invalid-option")
    assert problem["field"] == field
    assert str(problem["detail"]).startswith(f"{field}: ")


@pytest.mark.parametrize("photos", [2, 16])
def test_so_many_photos_are_a_mosaic(client: httpx.Client, photos: int) -> None:
    assert post(client, images=[upload("")] * photos).status_code == 200


@pytest.mark.parametrize(("photos", "advice"), [(1, "/rectify"), (17, "2 to 16 photos"), (64, "not of 64.")])
def test_too_few_and_too_many_photos(client: httpx.Client, photos: int, advice: str) -> None:
    problem = assert_problem(post(client, images=[upload("")] * photos), 422, "invalid-option")
    assert problem["field"] == "images"
    assert advice in str(problem["detail"])


def test_no_photos_at_all(client: httpx.Client) -> None:
    problem = assert_problem(
        client.post("/mosaic", files={"image": upload("")}, data={"base": "0"}), 422, "invalid-option"
    )
    assert problem["field"] == "image"
    assert_problem(client.post("/mosaic", content=b""), 400, "bad-request")


def test_photos_must_be_files(client: httpx.Client) -> None:
    files = [("images", ("photo.jpg", upload(""))), ("images", (None, b"no file"))]
    assert assert_problem(client.post("/mosaic", files=files), 400, "bad-request")["field"] == "images"


def test_more_files_than_a_form_may_have(client: httpx.Client) -> None:
    assert_problem(post(client, images=[upload("")] * 65), 400, "bad-request")


@pytest.mark.parametrize("script", ["undecodable-image", "unsupported-media-type", "too-large", "no-text"])
def test_a_bad_photo_is_named(client: httpx.Client, script: str) -> None:
    response = post(client, images=[*TWO, upload(script)])
    problem = assert_problem(response, response.status_code, script)
    assert problem["field"] == "images[2]"
    assert str(problem["detail"]).startswith("images[2]: ")


def test_photos_that_do_not_overlap(client: httpx.Client) -> None:
    assert_problem(post(client, images=[upload("not-overlapping")] * 2), 422, "not-overlapping")


@pytest.mark.parametrize(
    ("first", "field", "accept", "expected"),
    [
        (upload(""), None, "*/*", "jpeg"),
        (PNG, None, "*/*", "png"),
        (HEIC, None, "image/*", "jpeg"),
        (PNG, None, "image/jpeg;q=0.5, image/tiff;q=0.7", "tiff"),
        (PNG, "pdf", "image/png", "pdf"),
    ],
)
def test_what_comes_back(
    client: httpx.Client, first: bytes, field: AnswerFormat | None, accept: str, expected: str
) -> None:
    assert expected in get_args(AnswerFormat)
    data = {} if field is None else {"format": field}
    assert post(client, data, [first, upload("")], accept).text == f"flat as {expected}"


def test_no_representation_fits(client: httpx.Client) -> None:
    assert_problem(post(client, accept="text/html"), 406, "not-acceptable")


def test_its_limits_are_its_own() -> None:
    with serving(
        max_upload_bytes=2000,
        max_mosaic_upload_bytes=100_000,
        max_megapixels=3,
        max_mosaic_megapixels=7,
        job_timeout_s=20,
        mosaic_timeout_s=0.5,
    ) as client:
        large = upload("") + b" " * 40_000
        told = notices(post(client, {"format": "json"}, [large, large]))["limits"]
        assert "max_megapixels=3.0" in told
        assert told.endswith("max_megapixels=7.0)")
        with connect(client) as connection:
            connection.sendall(head(100_001, "/mosaic"))  # and nothing of the body
            answer = read_answer(connection)
        assert (answer.status, code(answer)) == (413, "too-large")
        assert b"MAX_MOSAIC_UPLOAD_BYTES" in answer.body
        response = client.post("/rectify", files={"image": large})
        assert "(MAX_UPLOAD_BYTES)" in str(assert_problem(response, 413, "too-large")["detail"])
        problem = assert_problem(post(client, images=[upload("hang"), upload("")]), 504, "timed-out")
        assert "0.5 s (MOSAIC_TIMEOUT_S)" in str(problem["detail"])
        assert client.post("/rectify", files={"image": upload("sleep 0.7")}).status_code == 200
        assert post(client).status_code == 200


def test_sixteen_photos_over_the_limit_can_read_the_refusal() -> None:
    with serving(max_mosaic_upload_bytes=1_000_000) as client, connect(client) as connection:
        body = form(*[upload("") + b" " * 100_000] * 16, field="images")
        connection.sendall(head(len(body), "/mosaic") + body)
        answer = read_answer(connection)
        assert (answer.status, code(answer)) == (413, "too-large")
        assert connection.recv(1) == b""  # closed in order, not reset


def test_a_client_that_leaves_stops_its_mosaic() -> None:
    with serving(queue_length=0) as client:
        body = form(upload(""), upload("hang"), field="images")
        connection = connect(client)
        connection.sendall(head(len(body), "/mosaic") + body)
        until_sample(client, "engine_running", 1)
        connection.close()
        until_sample(client, "engine_admitted", 0)
        assert post(client).status_code == 200
        text = client.get("/metrics").text
        assert sample(text, 'jobs_total{outcome="cancelled"}') == 1
        assert sample(text, 'http_requests_total{method="POST",path="/mosaic",status="499"}') == 1


def test_a_worker_that_dies_costs_one_mosaic(client: httpx.Client) -> None:
    assert_problem(post(client, images=[upload(""), upload("segfault")]), 500, "worker-died")
    assert post(client).status_code == 200
