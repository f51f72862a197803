"""POST /layout/models/{name}/samples/archive: many labelled pages at once."""

import asyncio
from collections import Counter
from dataclasses import dataclass
from typing import IO, Annotated

from fastapi import APIRouter, Form, Request, Response

from app.http.archives import OF_ONE_FILE, SpooledFile, UploadedArchive, shown_detail, shown_name
from app.http.form_parts import FormRoute
from app.http.json_answers import answer_json
from app.http.known_options import known_parts
from app.http.problems import documented, refusal_in
from app.http.zip_directory import ArchivedFile
from app.learning.labelled_pages import layout_settings
from app.routes.common_responses import FORM, IMAGE, STORE, WORK
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later
from app.schemas.layout_archives import ArchiveForm, FileProblem, FileReport, SamplesReport
from app.schemas.layout_models import ModelName
from app.state import AppState, State
from models.errors import StoreError
from models.records import StoredSample
from services.errors import DocumentError, InvalidOption
from services.progress import ProgressSink

router = APIRouter(prefix="/layout/models/{name}/samples", tags=["layout models"], route_class=FormRoute)

_ZONES = {".json", ".xml", ".page", ".alto"}
_IMAGES = {".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".heic", ".heif"}


@dataclass(frozen=True, slots=True)
class _Page:
    """The files of one page: those of one name, in any folder."""

    zones: ArchivedFile | None
    image: ArchivedFile | None
    others: tuple[ArchivedFile, ...] = ()

    @property
    def files(self) -> list[str]:
        named = [file for file in (self.zones, self.image) if file is not None]
        return [shown_name(file.path) for file in (*named, *self.others)]


@router.post(
    "/archive",
    operation_id="add_layout_samples",
    response_class=Response,
    responses={
        200: {"description": "What became of each page.", "model": SamplesReport},
        **ACCEPTED,
        **documented("not-found", "conflict", *FORM, *IMAGE, *STORE, *WORK),
    },
    openapi_extra=PREFER,
    dependencies=[known_parts(ArchiveForm)],
)
async def add_layout_samples(
    request: Request,
    state: State,
    name: ModelName,
    form: Annotated[ArchiveForm, Form(media_type="multipart/form-data")],
) -> Response:
    """Add the labelled pages of a ZIP archive: zones as JSON, PAGE-XML or ALTO, and perhaps images of the same names.

    `scans/17.png` belongs to `page/17.xml`: folders do not matter. Each page becomes a sample as by POST
    /layout/models/{name}/samples. A page that fails does not stop the others; the response says why. A repeated archive
    adds nothing.
    """
    most_bytes = state.settings.max_archive_bytes
    archive, pages = await asyncio.to_thread(_open, form.archive.file, most_bytes)
    if not any(page.zones is not None for page in pages):
        raise InvalidOption(
            "archive: it has no labelled pages; add their zones as files of JSON, PAGE-XML or ALTO (.json, .xml).",
            "archive",
        )

    async def work(progress: ProgressSink | None) -> Response:
        reports = []
        for number, page in enumerate(pages):
            if progress is not None:
                progress("samples", number / len(pages))
            reports.append(await _add(request, state, name, archive, page))
        request.state.seat.release()
        counts = Counter(report.status for report in reports)
        return await answer_json(
            lambda: SamplesReport(
                model=name,
                added=counts["added"],
                known=counts["known"],
                failed=counts["failed"],
                ignored=counts["ignored"],
                pages=reports,
            )
        )

    return await answer_now_or_later(request, state, work)


def _open(file: IO[bytes], most_bytes: int) -> tuple[UploadedArchive, list[_Page]]:
    archive = UploadedArchive(file, "archive", most_bytes)
    return archive, _pages_of(archive.files())


def _pages_of(files: list[ArchivedFile]) -> list[_Page]:
    """The files by pages, in the order of their first file. Files of other kinds, and second ones, stay alone."""
    pages: dict[str, _Page] = {}
    for file in files:
        known = pages.get(file.stem, _Page(None, None))
        if file.suffix in _ZONES and known.zones is None:
            known = _Page(file, known.image, known.others)
        elif file.suffix in _IMAGES and known.image is None:
            known = _Page(known.zones, file, known.others)
        else:
            known = _Page(known.zones, known.image, (*known.others, file))
        pages[file.stem] = known
    return list(pages.values())


async def _add(
    request: Request, state: AppState, name: str, archive: UploadedArchive, page: _Page
) -> FileReport:
    """Make a sample of one page; errors about the page are part of the report.

    Raises
    ------
    DocumentError, StoreError
        When the cause is not the page: the service is shutting down, the store is not available.
    """
    if page.zones is None:
        return FileReport(files=page.files, status="ignored", id=None, problem=None)
    try:
        if any(file.suffix in _ZONES | _IMAGES for file in page.others):
            raise InvalidOption(
                "several files of this name have zones, or are images; give each page a name of its own.",
                "archive",
            )
        sample = await _store(state, name, archive, page.zones, page.image)
    except (DocumentError, StoreError) as error:
        if error.code not in OF_ONE_FILE:
            raise
        refusal = refusal_in(error, request.scope)
        problem = FileProblem(code=refusal.code, detail=shown_detail(refusal.detail))
        return FileReport(files=page.files, status="failed", id=None, problem=problem)
    return FileReport(
        files=page.files, status="added" if sample.created else "known", id=sample.id, problem=None
    )


async def _store(
    state: AppState, name: str, archive: UploadedArchive, zones: ArchivedFile, image: ArchivedFile | None
) -> StoredSample:
    settings = state.settings
    described = SpooledFile(archive, zones.path, settings.max_zones_file_bytes)
    picture = None if image is None else SpooledFile(archive, image.path, settings.max_upload_bytes)
    measured = await state.engine.submit(
        state.operations.measure_sample_file, picture, described, layout_settings(settings)
    )
    sample = await state.store.call(
        lambda store: store.add_sample(
            name,
            measured.document,
            max_samples=settings.max_samples_per_model,
            max_models=settings.max_models,
        )
    )
    await state.sample_images.keep({sample.id: b"" if picture is None else await picture.read()})
    return sample
