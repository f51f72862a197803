"""What a worker makes of documents: results page by page, archives, and refusals that name the page."""

import io
import json
import pickle
import zipfile
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from services.contract.images import DocumentLimits
from services.contract.layout import (
    DocumentReply,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    ModelDocument,
    StackReply,
)
from services.errors import InvalidOption, NotAcceptable, NoText, TooLarge, UndecodableImage
from services.imaging.codec import encode_image
from services.layout.page import Page
from services.layout.recognition.stack import StackParts
from services.operations import layout, layout_documents
from services.operations.layout_documents import recognize_uploads
from services.operations.layout_models import initialize_from_samples, measure_sample
from services.progress import progress_to
from simulation.labelled_pages import document_pages
from tests.services.imaging.files import make_file
from tests.services.layout.samples import page_from
from tests.services.operations.documents import document_of as as_json_of
from tests.services.operations.pipelines import reject_constant

SETTINGS = LayoutSettings()
LETTER = [page_from(page) for page in document_pages(np.random.default_rng(3), "letter", 3, draw=False)]
SHEETS = [np.full((40, 60 + index), 255, np.uint8) for index in range(3)]
PNGS = [make_file(sheet, "PNG") for sheet in SHEETS]


def tiff() -> bytes:
    buffer = io.BytesIO()
    first, *others = map(Image.fromarray, SHEETS)
    first.save(buffer, "TIFF", save_all=True, append_images=others)
    return buffer.getvalue()


def stored(name: str, place: int, continues: str | None) -> ModelDocument:
    samples: list[dict[str, Any]] = []
    for seed in range(2):
        page = document_pages(np.random.default_rng(100 + seed), "letter", 3, draw=False)[place]
        samples.append(measure_sample(None, json.dumps(page.document()).encode(), SETTINGS))
    draft = initialize_from_samples(name, samples, SETTINGS)
    return ModelDocument(name, 3 + place, json.dumps(draft.document).encode(), continues=continues)


@pytest.fixture(scope="module")
def models() -> list[ModelDocument]:
    return [stored("letter", 0, None), stored("letter-2", 2, "letter")]


@pytest.fixture(autouse=True)
def eyes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages are seen by their widths: 60, 61 and 62 are those of the letter."""
    monkeypatch.setattr(layout, "ocr_engine", lambda language: None)
    monkeypatch.setattr(layout_documents, "ocr_engine", lambda language: None)
    monkeypatch.setattr(layout, "fine_page", lambda image, *_: (LETTER[image.shape[1] - 60], None))


def recognized(
    images: list[bytes], models: list[ModelDocument], options: LayoutOptions | None = None
) -> LayoutReply | DocumentReply | StackReply:
    return recognize_uploads(images, None, None, models, options or LayoutOptions(), SETTINGS)


@pytest.mark.parametrize("uploads", [PNGS, [tiff()]], ids=["three images", "a tiff file"])
def test_the_answer_is_the_contracts(uploads: list[bytes], models: list[ModelDocument]) -> None:
    reply = recognized(uploads, models)
    assert isinstance(reply, DocumentReply)
    json.loads(
        json.dumps([as_json_of(reply), *[[as_json_of(page), page.page] for page in reply.pages]]),
        parse_constant=reject_constant,
    )
    pages = [page.answer for page in reply.pages]
    document = reply.answer.model_copy(update={"pages": pages})
    assert (reply.body, reply.media_type) == (b"", "application/json")
    assert document.class_ is not None
    assert (document.class_.name, document.class_.model_version) == ("letter", 3)
    assert [page.part for page in document.pages] == ["first", "continuation", "continuation"]
    assert {page.document_class for page in document.pages} == {"letter"}
    last = document.pages[2].class_
    assert last is not None
    assert (last.name, last.model_version) == ("letter-2", 5)
    assert {"decode", "zones", "matching", "models", "encode"} <= document.timings_ms.keys()
    assert pickle.loads(pickle.dumps(reply)) == reply


def test_each_page_can_be_recognized_again(models: list[ModelDocument]) -> None:
    reply = recognized(PNGS, models)
    assert isinstance(reply, DocumentReply)
    zones = json.dumps(reply.pages[2].page).encode()
    again = recognize_uploads([], zones, None, models, LayoutOptions(), SETTINGS)
    assert isinstance(again, LayoutReply)
    assert (as_json_of(again)["part"], as_json_of(again)["document_class"]) == ("continuation", "letter")


def test_one_page_is_answered_as_one_page(models: list[ModelDocument]) -> None:
    for images, options in (
        (PNGS[:1], LayoutOptions()),
        ([tiff()], LayoutOptions(page=1)),
        (PNGS, LayoutOptions(page=1)),
    ):
        reply = recognized(images, models, options)
        assert isinstance(reply, LayoutReply)
        assert as_json_of(reply)["part"] == "first"
        assert as_json_of(reply)["document_class"] == "letter"
    with pytest.raises(InvalidOption, match="no page 4"):
        recognized(PNGS, models, LayoutOptions(page=4))


def test_a_page_of_a_pdf_is_a_page(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = []
    monkeypatch.setattr(
        layout, "fine_page", lambda image, *_: sizes.append(image.shape) or (Page(60, 40, ()), None)
    )
    reply = recognized([encode_image(SHEETS[0], "pdf", 100, 200.0)], [])
    assert isinstance(reply, LayoutReply)
    assert sizes == [(40, 60, 3)]


@pytest.mark.parametrize(("form", "root"), [("pagexml", b"<PcGts"), ("alto", b"<alto")])
def test_files_of_several_pages_come_in_an_archive(
    models: list[ModelDocument], form: Any, root: bytes
) -> None:
    for uploads, names, told, places in (
        ([tiff()], ("letter.tif",), "letter.tif#page=2", [0, 0, 0]),
        (PNGS, ("a.png", "b.png", "c.png"), "b.png", [0, 1, 2]),
    ):
        reply = recognized(uploads, models, LayoutOptions(format=form, image_names=names))
        assert isinstance(reply, DocumentReply)
        assert reply.media_type == "application/zip"
        assert [page.upload for page in reply.pages] == places
        with zipfile.ZipFile(io.BytesIO(reply.body)) as archive:
            assert archive.namelist() == ["page-01.xml", "page-02.xml", "page-03.xml"]
            texts = [archive.read(name) for name in archive.namelist()]
        assert all(root in text for text in texts)
        assert told.encode() in texts[1]


def test_several_pages_are_no_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layout, "fine_page", lambda *_: pytest.fail("refused before anything is read"))
    with pytest.raises(InvalidOption, match="3 pages; name one as `page`"):
        recognized(PNGS, [], LayoutOptions(format="png"))
    for form in ("png", "pagexml"):
        with pytest.raises(NotAcceptable, match="3 pages; name one as `page`"):
            recognized(PNGS, [], LayoutOptions(format=form, format_named=False))  # type: ignore[arg-type]


def test_refusals_name_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    def flatten(pixels: Any, *_: object) -> Any:
        raise NoText("no text")

    monkeypatch.setattr(layout, "rectify", flatten)
    with pytest.raises(NoText, match=r"^image\[0\]: no text$") as caught:
        recognized(PNGS, [], LayoutOptions(rectify=True))
    assert caught.value.field == "image[0]"
    with pytest.raises(NoText, match=r"^page 1: no text$"):
        recognized([tiff()], [], LayoutOptions(rectify=True))
    with pytest.raises(UndecodableImage, match=r"^image\[1\]: The PDF") as damaged:
        recognized([PNGS[0], b"%PDF-1.7\n"], [])
    assert damaged.value.field == "image[1]"
    narrow = replace(SETTINGS, document=DocumentLimits(max_pages=2))
    with pytest.raises(TooLarge, match="MAX_PAGES"):
        recognize_uploads([tiff()], None, None, [], LayoutOptions(), narrow)
    narrow = replace(SETTINGS, document=DocumentLimits(max_megapixels=0.005))
    with pytest.raises(TooLarge, match="MAX_DOCUMENT_MEGAPIXELS"):
        recognize_uploads(PNGS, None, None, [], LayoutOptions(), narrow)


def test_of_an_image_with_zones_the_first_page_counts() -> None:
    zones = json.dumps({"width": 60, "height": 40, "zones": []}).encode()
    reply = recognize_uploads([tiff()], zones, None, [], LayoutOptions(), SETTINGS)
    assert isinstance(reply, LayoutReply)


def test_pages_unlike_their_class_are_told(
    models: list[ModelDocument], monkeypatch: pytest.MonkeyPatch
) -> None:
    (paper,) = (page_from(page) for page in document_pages(np.random.default_rng(1), "plain", 1, draw=False))
    pages = [LETTER[0], LETTER[2], paper]
    monkeypatch.setattr(layout, "fine_page", lambda image, *_: (pages[image.shape[1] - 60], None))
    reply = recognized(PNGS, models)
    assert isinstance(reply, DocumentReply)
    warnings: Any = as_json_of(reply)["warnings"]
    assert [(notice["code"], notice["detail"][:8]) for notice in warnings] == [("unlike-page", "pages[2]")]
    assert as_json_of(reply.pages[2])["class"] is None


def test_progress_runs_through_the_pages(models: list[ModelDocument]) -> None:
    told: list[tuple[str, float]] = []
    with progress_to(lambda stage, share: told.append((stage, share))):
        recognized(PNGS, models)
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert [stage for stage, _ in told].count("zones") == 3
    assert max(shares) <= 1


def test_a_stack_is_parted_into_its_documents(models: list[ModelDocument]) -> None:
    first, _, last = PNGS
    reply = recognized([first, last, first, last, last], models, LayoutOptions(split=True))
    assert isinstance(reply, StackReply)
    assert [[page.upload for page in document.pages] for document in reply.documents] == [[0, 1], [2, 3, 4]]
    for document in reply.documents:
        assert document.answer.class_ is not None
        assert document.answer.class_.name == "letter"
        assert document.pages[0].answer.part == "first"
        assert {"decode", "zones", "beginnings", "matching", "models"} <= document.answer.timings_ms.keys()
    json.dumps([as_json_of(document) for document in reply.documents])
    assert pickle.loads(pickle.dumps(reply)) == reply


def test_one_page_is_a_stack_of_one_document(models: list[ModelDocument]) -> None:
    reply = recognized(PNGS[:1], models, LayoutOptions(split=True))
    assert isinstance(reply, StackReply)
    assert [len(document.pages) for document in reply.documents] == [1]


def test_what_is_not_sure_of_a_stack_is_said(
    models: list[ModelDocument], monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = StackParts((0, 2), (1.0, 0.3, 0.7))
    monkeypatch.setattr(layout_documents, "part_stack", lambda *_: parts)
    reply = recognized(PNGS, models, LayoutOptions(split=True))
    assert isinstance(reply, StackReply)
    said = [
        [warning.detail for warning in document.answer.warnings if warning.code == "unsure-beginning"]
        for document in reply.documents
    ]
    assert [len(each) for each in said] == [1, 1]
    assert "pages[1] may begin another document (0.30)" in said[0][0]
    assert "pages[0] may go on with the document before (0.30)" in said[1][0]
