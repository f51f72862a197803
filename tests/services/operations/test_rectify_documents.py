"""Several photos, TIFF files and PDFs in one request; a page that fails does not lose the others."""

import io
import json
import weakref
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pikepdf
import pypdfium2
import pytest
from PIL import Image

from app.http.representations import image_headers
from services.contract.images import DocumentLimits, Encoding, ImageLimits, PageReply
from services.contract.rectify import RectifyParameters
from services.errors import InvalidOption, NotAcceptable, NotDoneInTime, NoText, TooLarge, UndecodableImage
from services.operations import rectify, rectify_documents
from services.operations.rectify_documents import bind_done_pages, rectify_uploads
from tests.services.imaging.files import make_file
from tests.services.operations.documents import document_of
from tests.services.operations.pipelines import RectifyPipeline, turned_mesh

PHOTO = np.random.default_rng(1).integers(0, 256, (40, 60, 3), dtype=np.uint8)
JPEG, PNG = make_file(PHOTO, "JPEG"), make_file(PHOTO[:30], "PNG")
PARAMETERS = RectifyParameters()
JSON = Encoding("json", pages_format="json")
pytestmark = pytest.mark.usefixtures("pipeline")


def run(
    *uploads: bytes, encoding: Encoding | None = None, limits: DocumentLimits | None = None, **options: Any
) -> PageReply:
    """The reply, as a PDF where no encoding is given."""
    encoding = encoding or Encoding("pdf", pages_format="pdf")
    return rectify_uploads(uploads, RectifyParameters(**options), encoding, limits or DocumentLimits())


def pages_of(reply: PageReply) -> list[dict[str, Any]]:
    """Of its document."""
    pages = document_of(reply)["pages"]
    assert isinstance(pages, list)
    return pages


def tiff_of(*frames: np.ndarray) -> bytes:
    """A TIFF file of several pages."""
    buffer = io.BytesIO()
    first, *others = map(Image.fromarray, frames)
    first.save(buffer, "TIFF", save_all=True, append_images=others, dpi=(150, 150))
    return buffer.getvalue()


def test_one_photo_is_answered_as_before() -> None:
    reply = run(JPEG, encoding=Encoding())
    assert reply.media_type == "image/jpeg"
    assert "pages" not in document_of(reply)


def test_photos_are_pages_in_their_order() -> None:
    reply = run(JPEG, PNG)
    sizes = np.array([page.get_size() for page in pypdfium2.PdfDocument(reply.body)])
    assert sizes == pytest.approx(np.array([(40, 60), (30, 60)]) * 0.24)  # 300 dpi
    assert [page["width"] for page in pages_of(reply)] == [40, 30]


@pytest.mark.parametrize("uploads", [(JPEG,), (JPEG, PNG)], ids=["one", "several"])
def test_a_pdf_without_text_has_its_version_and_title(uploads: tuple[bytes, ...]) -> None:
    body = run(*uploads, encoding=Encoding("pdf", pages_format="pdf", title="Minutes")).body
    assert body.startswith(b"%PDF-1.7\n")
    with pikepdf.open(io.BytesIO(body)) as document:
        assert document.docinfo["/Title"] == "Minutes"


def test_pages_of_files_are_pages_too(pipeline: RectifyPipeline) -> None:
    pipeline.mesh = turned_mesh(PHOTO)
    pdf = run(JPEG, PNG).body
    reply = run(
        tiff_of(PHOTO, PHOTO[:20], PHOTO[:10]), pdf, JPEG, encoding=Encoding("json", pages_format="json")
    )
    assert len(pages_of(reply)) == 6
    single = run(tiff_of(PHOTO), encoding=Encoding("tiff", pages_format="tiff"))
    with Image.open(io.BytesIO(single.body)) as picture:
        assert picture.info["dpi"] == (150, 150)


@pytest.mark.parametrize("pages", ["main", "both"])
def test_pixels_are_let_go_before_the_next_page_begins(
    pipeline: RectifyPipeline, monkeypatch: pytest.MonkeyPatch, pages: str
) -> None:
    kept: list[weakref.ref[Any]] = []
    alive: list[int] = []

    def watch(photo: Any, *rest: Any) -> Any:
        alive.append(sum(known() is not None for known in kept))
        found = pipeline.rectify_spread(photo, *rest) if pages == "both" else pipeline(photo, *rest)
        results = found.pages if pages == "both" else (found,)
        kept.extend(weakref.ref(pixels) for pixels in (photo, *(result.image for result in results)))
        return found

    monkeypatch.setattr(rectify, "rectify_spread" if pages == "both" else "rectify", watch)
    run(JPEG, JPEG, JPEG, pages=pages)
    assert alive == [0, 0, 0]


def test_a_tiff_and_an_archive_hold_all() -> None:
    with Image.open(
        io.BytesIO(run(JPEG, PNG, encoding=Encoding("tiff", pages_format="tiff")).body)
    ) as picture:
        assert getattr(picture, "n_frames", 1) == 2  # type: ignore[attr-defined]
    archive = run(PNG, b"nothing", JPEG, encoding=Encoding("zip", pages_format="zip")).body
    with zipfile.ZipFile(io.BytesIO(archive)) as files:
        assert files.namelist() == ["page-01.png", "page-03.png"]


def test_an_archive_of_json_files_has_what_json_has() -> None:
    for uploads in ((PNG, b"nothing", JPEG), (JPEG,)):
        zipped = run(*uploads, encoding=Encoding("zip", pages_format="zip", archive="json"))
        with zipfile.ZipFile(io.BytesIO(zipped.body)) as files:
            assert files.namelist() == [f"page-0{number}.json" for number in range(1, len(uploads) + 1)]
            pages = [json.loads(files.read(name)) for name in files.namelist()]
        assert pages == (pages_of(zipped) if len(uploads) > 1 else [document_of(zipped)])
        plain = run(*uploads, encoding=Encoding("json", pages_format="json"))
        described = pages_of(plain) if len(uploads) > 1 else [document_of(plain)]
        assert [page.get("mesh") for page in pages] == [page.get("mesh") for page in described]


def test_a_page_that_fails_does_not_lose_the_others() -> None:
    reply = run(JPEG, JPEG[:200], b"no image", PNG)
    assert len(pypdfium2.PdfDocument(reply.body)) == 2
    pages = pages_of(reply)
    assert [page.get("problem", {}).get("code") for page in pages] == [
        None, "undecodable-image", "unsupported-media-type", None,
    ]  # fmt: skip
    assert pages[1]["problem"]["field"] == "image[1]"
    assert pages[2]["problem"]["detail"].startswith("image[2]: ")
    assert document_of(reply)["warnings"][0]["code"] == "pages-failed"


def test_when_all_fail_the_first_problem_is_the_answer() -> None:
    with pytest.raises(UndecodableImage, match=r"image\[0\]"):
        run(JPEG[:200], b"no image")


def test_progress_counts_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The share at which each page is decoded."""
    from services.progress import progress_to

    told: list[tuple[str, float]] = []
    with progress_to(lambda stage, share: told.append((stage, share))):
        run(JPEG, PNG, JPEG)
    decoded = [share for stage, share in told if stage == "decode"]
    assert decoded == pytest.approx([0, 0.95 / 3, 0.95 * 2 / 3])


def test_limits_of_a_document() -> None:
    with pytest.raises(TooLarge, match="2 pages"):
        run(JPEG, PNG, JPEG, limits=DocumentLimits(max_pages=2))
    with pytest.raises(TooLarge, match="MAX_DOCUMENT_MEGAPIXELS"):
        run(JPEG, PNG, limits=DocumentLimits(max_megapixels=0.004))
    small = DocumentLimits(ImageLimits(max_megapixels=0.002))
    pages = pages_of(run(JPEG, PNG, limits=small))  # one is too large, the other is not
    assert pages[0]["problem"]["code"] == "too-large"


def test_what_several_pages_cannot_have(pipeline: RectifyPipeline) -> None:
    with pytest.raises(InvalidOption, match="region"):
        run(JPEG, PNG, region=((0, 0), (1, 0), (1, 1)))
    with pytest.raises(NotAcceptable, match="pdf, tiff, zip or json"):
        run(JPEG, PNG, encoding=Encoding("jpeg", pages_format=None))
    assert pipeline.calls == []


def test_books_among_several_photos_give_two_pages_each(pipeline: RectifyPipeline) -> None:
    pipeline.pages = 2
    assert len(pages_of(run(JPEG, PNG, pages="both"))) == 4


class Stopped(BaseException):
    """In place of the kill of a worker that works for too long."""


def stopped_at(
    page: int,
    journal: Path,
    monkeypatch: pytest.MonkeyPatch,
    *uploads: bytes,
    encoding: Encoding = JSON,
) -> None:
    """Flatten the uploads until this page begins."""
    flatten, begun = rectify.flatten_picture, []

    def flatten_or_stop(*arguments: Any) -> Any:
        begun.append(arguments)
        if len(begun) > page:
            raise Stopped
        return flatten(*arguments)

    journal.touch()
    monkeypatch.setattr(rectify_documents, "flatten_picture", flatten_or_stop)
    with pytest.raises(Stopped):
        rectify_uploads(uploads, PARAMETERS, encoding, DocumentLimits(), str(journal))


REASON = "the work took too long."


def test_pages_that_are_done_outlive_their_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = tmp_path / "journal"
    whole = run(JPEG, PNG, b"no image", JPEG, PNG, encoding=JSON)
    stopped_at(3, journal, monkeypatch, JPEG, PNG, b"no image", JPEG, PNG, JPEG)
    with journal.open("ab") as file:
        file.write((1000).to_bytes(8) + b"half a page")
    reply = bind_done_pages(str(journal), JSON, REASON)
    expected, pages = pages_of(whole)[:4], pages_of(reply)
    for page in (*expected, *pages):
        page.pop("timings_ms", None)
    assert pages[:4] == expected
    assert [page["problem"] for page in pages[4:]] == [
        {"code": "timed-out", "detail": f"image[{index}]: {REASON}", "field": f"image[{index}]"}
        for index in (4, 5)
    ]
    (warning,) = document_of(reply)["warnings"]
    assert warning["code"] == "pages-failed"
    assert warning["detail"].endswith("3, 5, 6. JSON has the reason.")


def test_another_worker_goes_on_behind_the_page_that_was_too_slow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal, uploads = tmp_path / "journal", (JPEG, PNG, JPEG, b"no image", PNG)
    with monkeypatch.context() as patched:
        stopped_at(1, journal, patched, *uploads)
    with journal.open("ab") as file:
        file.write((1000).to_bytes(8) + b"half a page")
    reply = rectify_uploads(uploads, PARAMETERS, JSON, DocumentLimits(), str(journal), REASON)
    pages, expected = pages_of(reply), pages_of(run(*uploads, encoding=JSON))
    expected[1] = {"problem": {"code": "timed-out", "detail": f"image[1]: {REASON}", "field": "image[1]"}}
    for page in (*expected, *pages):
        page.pop("timings_ms", None)
    assert pages == expected
    again = bind_done_pages(str(journal), JSON, REASON)  # all of it is in the file
    assert [page.get("problem") for page in pages_of(again)] == [page.get("problem") for page in pages]


def test_a_file_of_the_pages_that_are_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = tmp_path / "journal"
    pdf = Encoding("pdf", pages_format="pdf")
    stopped_at(2, journal, monkeypatch, JPEG, PNG, JPEG, encoding=pdf)
    reply = bind_done_pages(str(journal), pdf, REASON)
    assert len(pypdfium2.PdfDocument(reply.body)) == 2


@pytest.mark.parametrize("page", [0, None])
def test_without_a_page_that_is_done_the_answer_is_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, page: int | None
) -> None:
    journal = tmp_path / "journal"
    if page is None:  # not even begun
        journal.touch()
    else:
        stopped_at(page, journal, monkeypatch, JPEG, PNG)
    with pytest.raises(NotDoneInTime, match=REASON.capitalize()):
        bind_done_pages(str(journal), JSON, REASON)


def test_every_page_has_its_corners_and_its_turn(pipeline: RectifyPipeline) -> None:
    corners = ((1.0, 1.0), (50.0, 1.0), (50.0, 25.0), (1.0, 25.0))
    run(JPEG, PNG, corners=(None, corners), rotate=(90, None))
    asked = [(call[1].page_corners, call[1].page_turn) for call in pipeline.calls]
    assert asked == [(None, 90), (corners, None)]
    pipeline.calls.clear()
    run(JPEG, PNG, rotate=(180,))
    assert [call[1].page_turn for call in pipeline.calls] == [180, 180]
    for options in ({"corners": (corners,)}, {"rotate": (90, None, None)}):
        with pytest.raises(InvalidOption) as refused:
            run(JPEG, PNG, **options)
        assert refused.value.field == next(iter(options))


def test_both_pages_of_a_photo_among_several_keep_the_notices_about_them(pipeline: RectifyPipeline) -> None:
    pipeline.pages = 1
    reply = run(JPEG, PNG, pages="both")
    assert [[w["code"] for w in page["warnings"]] for page in pages_of(reply)] == [
        ["of-all", "focal-length-unknown"]
    ] * 2


def test_a_page_without_text_among_several_is_kept_unless_it_shall_be_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stand_in = rectify.rectify  # type: ignore[attr-defined]

    def refuse_small(photo: np.ndarray, *rest: Any) -> Any:
        if photo.shape[0] < 40:
            raise NoText("a short note.")
        return stand_in(photo, *rest)

    monkeypatch.setattr(rectify, "rectify", refuse_small)
    kept = run(JPEG, PNG, rotate=(None, 90))
    assert pages_of(kept)[1]["warnings"][0]["code"] == "kept-as-it-is"
    assert (pages_of(kept)[1]["width"], pages_of(kept)[1]["height"]) == (30, 60)
    assert pages_of(kept)[1]["orientation"]["photo_rotation_deg"] == 90
    assert image_headers(kept.answer)["Document-Warnings"] == "focal-length-unknown, kept-as-it-is"
    assert pages_of(run(JPEG, PNG, on_no_text="refuse"))[1]["problem"]["code"] == "no-text"
    with pytest.raises(NoText):
        run(PNG)


@pytest.mark.parametrize(("look", "filters"), [("bw", "/CCITTFaxDecode"), ("gray", "/DCTDecode")])
def test_looks_of_a_scanner_are_those_of_every_page(look: str, filters: str) -> None:
    pages = [np.full((400, 300, 3), 245, np.uint8) for _ in range(2)]
    for page in pages:
        page[100:103, 40:260] = 30
    uploads = [make_file(page, "PNG") for page in pages]
    with pikepdf.open(io.BytesIO(run(*uploads, illumination=look).body)) as document:
        for page in document.pages:
            (image,) = page.get_images().values()  # type: ignore[attr-defined]
            assert filters in str(image.Filter)
            assert str(image.ColorSpace) == "/DeviceGray"
    reply = run(*uploads, illumination=look, encoding=Encoding("tiff", pages_format="tiff"))
    with Image.open(io.BytesIO(reply.body)) as picture:
        assert getattr(picture, "n_frames", 1) == 2
        for frame in range(2):
            picture.seek(frame)
            assert (picture.mode, picture.info["compression"]) == (
                ("1", "group4") if look == "bw" else ("L", "tiff_lzw")
            )
