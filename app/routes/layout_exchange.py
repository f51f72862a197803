"""GET /layout/export and POST /layout/import: classes with their models, settings and samples, for another service."""

import asyncio
import json
import zipfile
from collections.abc import Iterator
from functools import partial
from tempfile import SpooledTemporaryFile
from typing import IO, Annotated

from fastapi import APIRouter, Form, Query, Request, Response
from pydantic import AfterValidator, ValidationError
from starlette.responses import StreamingResponse

from app.http.archives import OF_ONE_FILE, SpooledFile, UploadedArchive, shown_detail, shown_name
from app.http.form_parts import FormRoute
from app.http.json_answers import answer_json
from app.http.known_options import known_parts
from app.http.problems import documented, refusal_in
from app.learning.labelled_pages import layout_settings
from app.routes.common_responses import FILE_NAME, FORM, READING, STORE, WORK
from app.routes.layout_settings import settings_answer, settings_changes
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later
from app.schemas.layout import NAMES_PATTERN, checked_names, parse_names
from app.schemas.layout_archives import (
    ArchivedClass,
    ArchiveForm,
    ImportedClass,
    ImportProblem,
    ImportReport,
    Manifest,
)
from app.schemas.options import Absent
from app.state import AppState, State
from models.errors import ModelNotFound, NotStorable, StoreError
from models.repository import Store
from services.errors import DocumentError, InvalidOption, TooLarge
from services.progress import ProgressSink

router = APIRouter(prefix="/layout", tags=["layout models"], route_class=FormRoute)

MANIFEST = "manifest.json"
MOST_FILES = 50_000
"""Samples and models of one archive."""
MOST_MANIFEST_BYTES = 2**20
"""200 classes with types of fields have a tenth of it."""
_MOST_PROBLEMS = 1000
"""Problems that a report lists; the others are counted."""
_IN_MEMORY_BYTES = 2**22
_CHUNK_BYTES = 2**18


@router.get(
    "/export",
    operation_id="export_layout_models",
    response_class=Response,
    responses={
        200: {
            "description": "A ZIP archive: `manifest.json` (classes and settings), `models/NAME/model.json` and "
            "`models/NAME/samples/ID.json`.",
            "content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}},
            "headers": FILE_NAME,
        },
        **documented(*READING),
    },
)
async def export_layout_models(
    state: State,
    models: Annotated[
        Annotated[str, AfterValidator(checked_names)] | Absent,
        Query(
            description="The classes, separated by commas; default: all.",
            json_schema_extra={"pattern": NAMES_PATTERN},
        ),
    ] = None,
) -> Response:
    """Export classes with their newest models, their settings and all their samples, for POST /layout/import."""
    wanted = parse_names(models) if models is not None else None
    known = [model.name for model in await state.store.call(Store.models)]
    for name in wanted or ():
        if name not in known:
            raise ModelNotFound(f"there is no model {name!r}", name)
    file: IO[bytes] = SpooledTemporaryFile(_IN_MEMORY_BYTES)  # noqa: SIM115 (the response closes it)
    try:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            classes = []
            for name in known if wanted is None else wanted:
                classes.append(await state.store.call(lambda store, name=name: _pack(store, name, archive)))  # type: ignore[misc]
            await asyncio.to_thread(_finish, archive, classes)
        file.seek(0)
    except BaseException:
        file.close()
        raise
    headers = {"Content-Disposition": 'attachment; filename="layout-models.zip"'}
    return StreamingResponse(_chunks(file), media_type="application/zip", headers=headers)


def _chunks(file: IO[bytes]) -> Iterator[bytes]:
    with file:
        while chunk := file.read(_CHUNK_BYTES):
            yield chunk


def _finish(archive: zipfile.ZipFile, classes: list[dict[str, object]]) -> None:
    """Write the manifest and the archive's directory, which is long where there are many samples."""
    manifest = {"format": "layout-models", "format_version": 1, "models": classes}
    archive.writestr(MANIFEST, json.dumps(manifest, indent=1))
    archive.close()


def _pack(store: Store, name: str, archive: zipfile.ZipFile) -> dict[str, object]:
    """Write a class into the archive; its entry of the manifest."""
    model = store.model(name)
    if model.document is not None:
        archive.writestr(f"models/{name}/model.json", _json(model.document))
    for sample in store.each_sample(name):
        archive.writestr(f"models/{name}/samples/{sample.id}.json", _json(sample.document))
    return {"name": name, "settings": settings_answer(model.settings).model_dump()}


def _json(document: object) -> str:
    return json.dumps(document, ensure_ascii=False, separators=(",", ":"))


@router.post(
    "/import",
    operation_id="import_layout_models",
    response_class=Response,
    responses={
        200: {"description": "What became of each class.", "model": ImportReport},
        **ACCEPTED,
        **documented("conflict", "invalid-model", "invalid-option", *FORM, *STORE, *WORK),
    },
    openapi_extra=PREFER,
    dependencies=[known_parts(ArchiveForm)],
)
async def import_layout_models(
    request: Request, state: State, form: Annotated[ArchiveForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Import classes that GET /layout/export has exported, from this or another service.

    A class that exists gets the samples that it does not have, the settings, and the model as a new version unless it
    is the newest one. A file that cannot be used does not stop the others; the response names it.
    """
    archive, manifest, paths = await asyncio.to_thread(
        _open, form.archive.file, state.settings.max_archive_bytes
    )

    async def work(progress: ProgressSink | None) -> Response:
        imported: list[ImportedClass] = []
        problems = _Problems(request)
        for number, each in enumerate(manifest.models):
            if progress is not None:
                progress("models", number / len(manifest.models))
            imported.append(await _import_class(state, archive, each.name, paths[each.name], problems))
        for each, report in zip(
            manifest.models, imported, strict=True
        ):  # now that the classes they continue exist
            await _import_settings(state, each, report, problems)
        request.state.seat.release()
        return await answer_json(partial(ImportReport, models=imported))

    return await answer_now_or_later(request, state, work)


def _open(file: IO[bytes], most_bytes: int) -> tuple[UploadedArchive, Manifest, dict[str, list[str]]]:
    """The archive, its manifest, and by the names of its classes the paths of their files.

    Raises
    ------
    InvalidOption, TooLarge
    """
    archive = UploadedArchive(file, "archive", most_bytes, MOST_FILES)
    if MANIFEST not in archive:
        raise InvalidOption(
            f"archive: it has no {MANIFEST}; send what GET /layout/export answers.", "archive"
        )
    try:
        manifest = Manifest.model_validate_json(archive.read(MANIFEST, MOST_MANIFEST_BYTES))
    except (InvalidOption, TooLarge) as error:
        raise type(error)(f"archive: {MANIFEST}: {error.detail}", "archive") from error
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        where = ".".join(map(str, first["loc"]))[:80]
        raise InvalidOption(f"archive: {MANIFEST}: {where}: {first['msg']}.", "archive") from error
    paths: dict[str, list[str]] = {}
    for each in manifest.models:
        if each.name in paths:
            raise InvalidOption(f"archive: {MANIFEST}: it has the class {each.name!r} twice.", "archive")
        paths[each.name] = []
    for packed in archive.files():
        folder, name, path = (*packed.path.split("/", 2), "", "")[:3]
        if folder == "models" and path and name in paths:
            paths[name].append(packed.path)
    return archive, manifest, paths


class _Problems:
    """The problems of one import, which lists a bounded number of them in the reports of its classes."""

    def __init__(self, request: Request) -> None:
        self._scope = request.scope
        self._left = _MOST_PROBLEMS

    def add(self, report: ImportedClass, path: str, error: DocumentError | StoreError) -> None:
        """Add what is wrong with a file to the report of its class, or count it there."""
        refusal = refusal_in(error, self._scope)
        if self._left == 0:
            report.more_problems += 1
            return
        self._left -= 1
        report.problems.append(
            ImportProblem(file=shown_name(path), code=refusal.code, detail=shown_detail(refusal.detail))
        )


async def _import_class(
    state: AppState, archive: UploadedArchive, name: str, paths: list[str], problems: _Problems
) -> ImportedClass:
    settings = state.settings
    report = ImportedClass(
        name=name, version=None, changed=False, samples_added=0, samples_known=0, problems=[], more_problems=0
    )
    for path in paths:
        path_in_class = path.split("/", 2)[2]
        folder, _, rest = path_in_class.partition("/")
        try:
            if folder == "samples" and rest:
                content = SpooledFile(archive, path, settings.max_zones_file_bytes)
                document = await state.engine.submit(
                    state.operations.import_sample, content, layout_settings(settings)
                )
                stored = await state.store.call(
                    lambda store, document=document: store.add_sample(  # type: ignore[misc]
                        name,
                        document,
                        max_samples=settings.max_samples_per_model,
                        max_models=settings.max_models,
                    )
                )
                if stored.created:
                    report.samples_added += 1
                else:
                    report.samples_known += 1
            elif path_in_class == "model.json":
                content = SpooledFile(archive, path, settings.max_model_bytes)
                report.version, report.changed = await _import_model(state, name, content)
        except (DocumentError, StoreError) as error:
            if error.code not in OF_ONE_FILE:
                raise
            problems.add(report, path, error)
    return report


async def _import_model(state: AppState, name: str, content: SpooledFile) -> tuple[int, bool]:
    """The newest version of the class, and whether it is new."""
    draft = await state.engine.submit(state.operations.import_model, name, content)

    def write(store: Store) -> tuple[int, bool]:
        try:
            newest = store.model(name)
        except ModelNotFound:
            newest = None
        if newest is not None and newest.version is not None and newest.document == draft.document:
            return newest.version, False
        most = state.settings.max_models
        made = store.add_version(name, draft.document, "import", max_models=most).version
        assert made is not None
        return made, True

    return await state.store.call(write)


async def _import_settings(
    state: AppState, entry: ArchivedClass, report: ImportedClass, problems: _Problems
) -> None:
    """Take over the settings of a class; what cannot be taken over is added to the problems of its report."""
    try:
        await state.store.call(
            lambda store: store.change_settings(entry.name, **settings_changes(entry.settings))
        )
    except (ModelNotFound, NotStorable) as error:
        problems.add(report, MANIFEST, error)
