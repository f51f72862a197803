"""POST /rectify: options in, representations out."""

import asyncio
import base64
import json
from pathlib import Path

import httpx
import pytest

from app.routes import pages_in_time
from services.contract.answers.rectify import CreasedSheet, PagesResult, RectifyResult
from tests.app.scripted_results import CREASED_SHEET
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_jobs import LATER, until
from tests.app.test_problems import assert_problem


def post(
    client: httpx.Client,
    data: dict[str, str] | None = None,
    accept: str | None = None,
    image: bytes = upload(""),
) -> httpx.Response:
    headers = {} if accept is None else {"Accept": accept}
    return client.post("/rectify", files={"image": ("photo.jpg", image)}, data=data, headers=headers)


def notices(response: httpx.Response) -> dict[str, str]:
    return {notice["code"]: notice["detail"] for notice in response.json()["warnings"]}


def test_an_image_answer_carries_the_facts_as_headers(client: httpx.Client) -> None:
    response = post(client)
    assert response.status_code == 200
    assert response.content == b"flat as jpeg"
    assert response.headers["content-type"] == "image/jpeg"
    assert response.headers["document-kind"] == "planar"
    assert response.headers["document-rotation"] == "180"
    assert response.headers["document-warnings"] == "options, encoding"
    assert response.headers["server-timing"] == "decode;dur=1.2, texture_flow;dur=20.0"
    assert response.headers["vary"] == "Accept"


def test_a_json_answer_is_the_contract_s_result(client: httpx.Client) -> None:
    response = post(client, {"format": "json"})
    assert response.headers["content-type"] == "application/json"
    assert list(response.json()) == [
        "photo", "corners", "orientation", "width", "height", "mesh", "kind", "evidence", "camera", "surface",
        "page", "quality", "text", "warnings", "timings_ms", "image", "image_media_type",
        "page_id",
    ]  # fmt: skip
    assert response.json()["image"] is None
    assert RectifyResult.model_validate(response.json()).mesh.source[1][0] == (0, 9)


def test_a_creased_page_is_answered_as_a_mesh(client: httpx.Client) -> None:
    response = post(client, {"format": "json"}, image=upload("creased"))
    assert response.json()["surface"] == json.loads(json.dumps(CREASED_SHEET))
    surface = RectifyResult.model_validate(response.json()).surface
    assert isinstance(surface, CreasedSheet)
    assert surface.points[2][1] == (8.0, 8.5)
    assert surface.normals[1] == [(0.0, -0.6, 0.8)]
    # The image's headers tell no more of it than of any bent page.
    assert post(client, image=upload("creased")).headers["document-kind"] == "curved"


def test_embed_puts_the_image_into_the_json(client: httpx.Client) -> None:
    response = post(client, {"format": "json", "embed": "true"})
    assert base64.b64decode(response.json()["image"]) == b"flat"


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({}, "kind='auto', focal_length_px=None, region=None, illumination='keep'"),
        ({}, "upright=True"),
        ({"kind": "curved"}, "kind='curved'"),
        ({"upright": "false"}, "upright=False"),
        ({"upright": "False"}, "upright=False"),
        ({"focal_length_px": "2931.5"}, "focal_length_px=2931.5"),
        ({"focal_length_px": ""}, "focal_length_px=None"),
        ({"region": "[[1,2],[3.5,4],[5,-6]]"}, "region=((1.0, 2.0), (3.5, 4.0), (5.0, -6.0))"),
        ({"illumination": "normalize"}, "illumination='normalize'"),
        ({"illumination": "bw"}, "illumination='bw'"),
        ({}, "corners=(), rotate=(None,), margin=0.0"),
        ({"corners": ""}, "corners=()"),
        (
            {"corners": "[[1,2],[30.5,2],[30,20],[2,20]]"},
            "corners=(((1.0, 2.0), (30.5, 2.0), (30.0, 20.0), (2.0, 20.0)),)",
        ),
        (
            {"corners": "[null,[[1,2],[30,2],[30,20],[2,20]]]"},
            "corners=(None, ((1.0, 2.0), (30.0, 2.0), (30.0, 20.0), (2.0, 20.0)))",
        ),
        ({"rotate": "270"}, "rotate=(270,)"),
        ({"rotate": "Auto, 90,auto"}, "rotate=(None, 90, None)"),
        ({"margin": "12.5"}, "margin=12.5"),
        ({}, "keep_photo=False"),
        ({"keep_photo": "true"}, "keep_photo=True"),
        ({}, "crop='sheet', pages='main'"),
        ({"crop": "text"}, "crop='text'"),
        ({"crop": "photo"}, "crop='photo'"),
    ],
)
def test_options_reach_the_operation(client: httpx.Client, data: dict[str, str], expected: str) -> None:
    assert expected in notices(post(client, {**data, "format": "json"}))["options"]


@pytest.mark.parametrize("quality", ["1", "100"])
def test_encoding_options_reach_the_operation(client: httpx.Client, quality: str) -> None:
    detail = notices(post(client, {"format": "json", "quality": quality}))["encoding"]
    assert detail.startswith(f"Encoding(format='json', quality={quality}, embed=False, pages_format='json',")


def test_size_and_format_of_an_embedded_picture_reach_the_operation(client: httpx.Client) -> None:
    asked = {"format": "json", "embed_format": "WebP", "max_width": "800", "max_height": "30000"}
    response = post(client, asked)
    assert base64.b64decode(response.json()["image"]) == b"flat", "embed_format includes the image"
    detail = notices(response)["encoding"]
    assert "embed=True, pages_format='json', embed_format='webp', max_width=800, max_height=30000," in detail


def test_a_preview_is_not_turned_upright(client: httpx.Client) -> None:
    detail = notices(post(client, {"format": "json", "preview": "true"}))["options"]
    assert "upright=False" in detail
    assert "preview=True" in detail


def test_an_app_can_draw_on_the_photo(client: httpx.Client) -> None:
    result = post(client, {"format": "json"}).json()
    assert result["photo"] == {"width": 40, "height": 30}
    assert result["corners"] == [[1, 1], [39, 1.5], None, [1, 29]]
    assert result["image_media_type"] is None


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("kind", "round"),
        ("upright", "perhaps"),
        ("upright", "0"),
        ("focal_length_px", "0"),
        ("focal_length_px", "-3"),
        ("focal_length_px", "nan"),
        ("focal_length_px", "inf"),
        ("focal_length_px", "1e7"),
        ("focal_length_px", "long"),
        ("illumination", "bright"),
        ("format", "gif"),
        ("crop", "page"),
        ("paper", "a6"),
        ("paper", "210"),
        ("paper", "9x297"),
        ("pages", "2"),
        ("quality", "0"),
        ("quality", "101"),
        ("quality", "80.5"),
        ("embed", "maybe"),
        ("region", "[[1,2],[3,4]"),
        ("region", "[[1,2],[3,4]]"),
        ("region", "[[1,2],[3,4],[5]]"),
        ("region", "[[1,2],[3,4],[5,true]]"),
        ("region", "[[1,2],[3,4],[5,null]]"),
        ("region", "[[1,2],[3,4],[5,NaN]]"),
        ("region", "[[1,2],[3,4],[5,1e999]]"),
        ("region", "[[1,2],[3,4],[5,1e7]]"),
        ("region", "[[1,2],[3,4],[5,6,7]]"),
        ("region", '{"a": 1}'),
        ("region", "[" * 30_000),
        ("region", f"[{','.join(['[1,2]'] * 201)}]"),
        ("regoin", "[[1,2],[3,4],[5,6]]"),
    ],
)
def test_a_bad_option_is_named(client: httpx.Client, field: str, value: str) -> None:
    response = post(client, {field: value})
    problem = response.json()
    assert (response.status_code, problem["code"], problem["field"]) == (422, "invalid-option", field)
    assert problem["detail"].startswith(f"{field}: ")
    assert len(problem["detail"]) < 300


def test_200_points_are_a_region(client: httpx.Client) -> None:
    assert post(client, {"region": f"[{','.join(['[1,2]'] * 200)}]"}).status_code == 200


PNG, WEBP, TIFF, HEIC = (
    head + upload("") for head in (b"\x89PNG\r\n\x1a\n", b"RIFF\0\0\0\0WEBP", b"II*\0", b"\0\0\0\x18ftypheic")
)
BROWSER = "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,image/webp,*/*;q=0.8"


@pytest.mark.parametrize(
    ("image", "field", "accept", "expected"),
    [
        (upload(""), None, "*/*", "jpeg"),
        (PNG, None, "*/*", "png"),
        (PNG, None, "image/*", "png"),
        (WEBP, None, None, "webp"),
        (TIFF, None, "*/*", "tiff"),
        (HEIC, None, "*/*", "jpeg"),
        (b"unknown" + upload(""), None, "*/*", "None"),
        (PNG, "jpeg", "application/json", "jpeg"),
        (PNG, "pdf", "text/html", "pdf"),
        (PNG, None, "application/pdf", "pdf"),
        (PNG, None, "image/jpeg;q=0.5, image/tiff;q=0.7", "tiff"),
        (PNG, None, BROWSER, "webp"),
    ],
)
def test_what_comes_back(
    client: httpx.Client, image: bytes, field: str | None, accept: str | None, expected: str
) -> None:
    response = post(client, {} if field is None else {"format": field}, accept, image)
    assert response.text == f"flat as {expected}"


def test_json_by_accept(client: httpx.Client) -> None:
    response = post(client, accept="application/json, image/*;q=0.1")
    assert response.json()["kind"] == "planar"


@pytest.mark.parametrize("accept", ["image/heic", "text/html", "image/*;q=0"])
def test_no_representation_fits(client: httpx.Client, accept: str) -> None:
    response = post(client, accept=accept)
    assert (response.status_code, response.json()["code"]) == (406, "not-acceptable")


def test_both_pages_are_a_list_in_json(client: httpx.Client) -> None:
    response = post(client, {"pages": "both", "format": "json", "embed": "true"}, image=upload("pages-2"))
    assert list(response.json()) == ["pages", "warnings", "timings_ms"]
    found = PagesResult.model_validate(response.json())
    assert [base64.b64decode(page.image or "") for page in found.pages] == [b"flat", b"flat"]


def test_one_page_is_a_list_too_where_both_were_asked_for(client: httpx.Client) -> None:
    response = post(client, {"pages": "both", "format": "json"})
    assert len(PagesResult.model_validate(response.json()).pages) == 1


def test_of_two_pages_the_headers_tell_both(client: httpx.Client) -> None:
    response = post(client, {"pages": "both", "format": "pdf"}, image=upload("pages-2"))
    assert (response.text, response.headers["content-type"]) == ("2 as pdf", "application/pdf")
    assert response.headers["document-pages"] == "2"
    assert response.headers["document-kind"] == "planar, planar"
    assert response.headers["document-rotation"] == "180, 180"
    assert response.headers["document-warnings"] == "whole, options, encoding"
    assert response.headers["server-timing"] == "decode;dur=1.2"


@pytest.mark.parametrize(
    ("image", "field", "accept", "expected"),
    [
        (upload("pages-2"), None, "*/*", "2 as pdf"),
        (upload("pages-2"), "zip", None, "2 as zip"),
        (upload("pages-2"), "tiff", None, "2 as tiff"),
        (upload("pages-2"), None, "image/*", "2 as tiff"),
        (upload("pages-2"), None, "application/zip", "2 as zip"),
        (b"II*\0" + upload("pages-2"), None, "*/*", "2 as tiff"),
        (upload(""), None, "*/*", "1 as jpeg"),
        (upload(""), "png", None, "1 as png"),
        (upload(""), None, "application/zip", "1 as zip"),
    ],
)
def test_what_comes_back_of_both_pages(
    client: httpx.Client, image: bytes, field: str | None, accept: str | None, expected: str
) -> None:
    data = {"pages": "both"} | ({} if field is None else {"format": field})
    assert post(client, data, accept, image).text == expected


@pytest.mark.parametrize(("field", "accept"), [("jpeg", None), ("webp", "*/*"), (None, "image/png")])
def test_an_image_format_does_not_hold_two_pages(
    client: httpx.Client, field: str | None, accept: str | None
) -> None:
    data = {"pages": "both"} | ({} if field is None else {"format": field})
    response = post(client, data, accept, upload("pages-2"))
    assert (response.status_code, response.json()["code"]) == (406, "not-acceptable")


def test_an_archive_of_one_page(client: httpx.Client) -> None:
    response = post(client, {"format": "zip"})
    assert (response.text, response.headers["content-type"]) == ("flat as zip", "application/zip")


def test_a_large_upload_passes_through(client: httpx.Client) -> None:
    image = upload("") + b" " * 5_000_000
    assert post(client, image=image).content == b"flat as jpeg"


def post_several(client: httpx.Client, *scripts: str, **data: str) -> httpx.Response:
    """Several photos that follow scripts."""
    return client.post(
        "/rectify", files=[("image", ("p.jpg", upload(script))) for script in scripts], data=data
    )


def test_several_photos_are_a_pdf_unless_another_format_is_asked_for(client: httpx.Client) -> None:
    response = post_several(client, "", "")
    assert (response.content, response.headers["content-type"]) == (b"2 as pdf", "application/pdf")
    assert response.headers["document-pages"] == "2"
    assert "document-failed" not in response.headers
    assert post_several(client, "", "", format="txt").text == "2 as txt"


def test_a_failed_page_is_in_the_answer_with_its_problem(client: httpx.Client) -> None:
    response = post_several(client, "", "no-text", "", format="json")
    result = PagesResult.model_validate(response.json())
    assert [hasattr(page, "problem") for page in result.pages] == [False, True, False]
    problem = response.json()["pages"][1]["problem"]
    assert (problem["code"], problem["status"], problem["field"]) == ("no-text", 422, "image[1]")
    assert problem["request_id"] == response.headers["x-request-id"]
    headers = post_several(client, "", "no-text", "").headers
    assert (headers["document-pages"], headers["document-failed"]) == ("2", "2 no-text")


def test_text_formats_imply_reading(client: httpx.Client) -> None:
    assert "text=True, language=None" in notices(post(client, {"format": "json", "text": "true"}))["options"]
    response = post(client, {"format": "hocr"})
    assert response.headers["content-type"].startswith("text/vnd.hocr+html")
    assert response.headers["content-disposition"] == 'inline; filename="photo-flat.html"'
    assert post(client, accept="text/markdown").headers["content-type"].startswith("text/markdown")


def test_the_language_reaches_the_operation(client: httpx.Client) -> None:
    told = notices(post(client, {"format": "json", "text": "true", "language": "eng+chi_sim"}))["options"]
    assert "language='eng+chi_sim'" in told
    for wrong in ("../eng", "eng+", "e", "eng fra", "eng+" * 9 + "eng"):
        assert post(client, {"language": wrong}).json()["field"] == "language"


def test_an_operator_chooses_languages() -> None:
    with serving(ocr_languages="deu, eng") as client:
        assert "language='deu'" in notices(post(client, {"format": "json"}))["options"]
        refused = post(client, {"format": "json", "language": "eng+fra"})
        assert (refused.status_code, refused.json()["code"]) == (422, "invalid-option")
        assert "fra is not read by this server; OCR_LANGUAGES has deu, eng" in refused.json()["detail"]
        assert client.get("/health/ready").json()["languages"] == ["eng", "fra"]
        assert 'ocr_language{language="fra"} 1.0' in client.get("/metrics").text


@pytest.mark.parametrize("is_job", [False, True])
def test_a_page_that_hangs_loses_no_other(is_job: bool) -> None:
    """Also where native code never returns, so that the worker is killed."""
    with serving(job_timeout_s=1) as client:
        files = [("image", upload(script)) for script in ("", "no-text", "hang", "", "")]
        headers = LATER if is_job else {}
        answer = client.post("/rectify", files=files, data={"format": "json"}, headers=headers)
        if is_job:
            assert until(client, answer.headers["location"])["state"] == "succeeded"
            answer = client.get(answer.headers["location"] + "/result")
        assert answer.status_code == 200
        problems = [page.get("problem", {}).get("code") for page in answer.json()["pages"]]
        assert problems == [None, "no-text", "timed-out", None, None]
        assert "JOB_TIMEOUT_S" in answer.json()["pages"][2]["problem"]["detail"]


def test_pages_that_are_done_are_answered_when_the_time_of_all_ends() -> None:
    with serving(document_timeout_s=1) as client:
        files = [("image", upload(script)) for script in ("", "hang", "")]
        answer = client.post("/rectify", files=files, data={"format": "json"})
        problems = [page.get("problem", {}).get("code") for page in answer.json()["pages"]]
        assert problems == [None, "timed-out", "timed-out"]
        assert "DOCUMENT_TIMEOUT_S" in answer.json()["pages"][1]["problem"]["detail"]
        nothing = client.post("/rectify", files=files[1:], data={"format": "json"})
        assert_problem(nothing, 504, "timed-out")


def test_a_document_of_one_page_has_the_time_of_all(tmp_path: Path) -> None:
    journal = tmp_path / "journal"

    async def is_stuck(content: bytes) -> bool:
        journal.write_bytes(content)
        attempt = pages_in_time._Attempt(journal, 0.02, None)
        attempt.note("started", 0.0)
        work = asyncio.get_running_loop().create_future()
        asyncio.get_running_loop().call_later(0.2 if not content else 60, work.cancel)
        return await attempt.is_stuck(work)

    assert asyncio.run(is_stuck(b"names of pages"))
    assert not asyncio.run(is_stuck(b""))


@pytest.mark.parametrize(
    ("data", "field"),
    [
        ({"corners": "[[1,2],[30,2],[30,20]]"}, "corners"),
        ({"corners": "[[1,2],[30,2],[30,20],[2,20],[1,9]]"}, "corners"),
        ({"corners": "[[1,2],[30,2],[30,NaN],[2,20]]"}, "corners"),
        ({"corners": "[[1,2],[30,2],[30,1e9],[2,20]]"}, "corners"),
        ({"corners": "[[1,2],[30,2],[30,true],[2,20]]"}, "corners"),
        ({"corners": "[]"}, "corners"),
        ({"corners": "[[]]"}, "corners"),
        ({"corners": "{}"}, "corners"),
        ({"corners": "here"}, "corners"),
        ({"corners": "[[1,2],[30,2],[30,20],[2,20]]", "pages": "both"}, "corners"),
        ({"corners": "[[1,2],[30,2],[30,20],[2,20]]", "region": "[[1,2],[30,2],[30,20]]"}, "corners"),
        ({"corners": "[[1,2],[30,2],[30,20],[2,20]]", "preview": "true", "format": "json"}, "corners"),
        ({"rotate": "90", "preview": "true", "format": "json"}, "rotate"),
        ({"margin": "5", "preview": "true", "format": "json"}, "margin"),
        ({"rotate": "45"}, "rotate"),
        ({"rotate": "90,"}, "rotate"),
        ({"margin": "20.5"}, "margin"),
        ({"margin": "-1"}, "margin"),
        ({"margin": "nan"}, "margin"),
        ({"illumination": "colour"}, "illumination"),
    ],
)
def test_what_a_person_says_is_checked(client: httpx.Client, data: dict[str, str], field: str) -> None:
    response = post(client, data)
    assert_problem(response, 422, "invalid-option")
    assert response.json()["field"] == field
