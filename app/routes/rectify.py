"""POST /rectify: photos of pages -> their frontal flat views."""

from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request, Response

from app.access.callers import caller_of
from app.http.known_options import known_parts, with_format
from app.http.ocr_languages import chosen_language
from app.routes.document_uploads import check_photos, document_limits, document_time_limit
from app.routes.kept_pages import keep_photos
from app.routes.long_work import PREFER, answer_now_or_later
from app.routes.page_answers import (
    RECTIFY_HEADERS,
    PageAnswer,
    answer_page,
    choose_pages_encoding,
    documented_page,
    flat_pages,
)
from app.routes.pages_in_time import flatten_pages
from app.routes.sent_uploads import MANY_FILES, UploadFormRoute
from app.schemas.options import AskedPagesFormat, CallbackUrl
from app.schemas.rectify import RectifyForm
from app.state import AppState, State
from app.storage.camera_memory import keep_cameras, known_cameras
from services.contract.answers.rectify import PagesResult, RectifyResult
from services.contract.images import Encoding
from services.errors import InvalidOption
from services.progress import ProgressSink

router = APIRouter(tags=["rectify"], route_class=UploadFormRoute, form_limits={"max_files": MANY_FILES})


@router.post(
    "/rectify",
    operation_id="rectify",
    response_class=Response,
    responses=documented_page(
        RectifyResult,
        RECTIFY_HEADERS,
        pages_model=PagesResult,
    ),
    openapi_extra=PREFER,
    dependencies=[known_parts(RectifyForm)],
)
async def rectify(
    request: Request,
    state: State,
    form: Annotated[RectifyForm, Form(media_type="multipart/form-data")],
    format: Annotated[AskedPagesFormat, Query()] = None,
    callback_url: Annotated[CallbackUrl, Query()] = None,
) -> Response:
    """Flatten photos of pages, taken from any position.

    One photo is one page. Several parts `image`, a TIFF file or a PDF are several pages; they are flattened one after
    another. A page that fails does not lose the others: JSON has its problem, a file leaves it out (header
    `Document-Failed`). To join overlapping photos of one page, use /mosaic.

    The response format follows `Accept`, or the field `format`; else it is an image in the upload's own format
    (HEIC: JPEG).

    The response for several pages is a PDF, a TIFF file, an archive with one image per page (format=zip), the text of
    all pages, or JSON; without `Accept` and `format`, a PDF. `jpeg`, `png` and `webp` hold one page: they are refused
    (`not-acceptable`) for several. With pages=both, an open book is two pages, left before right.

    A page that takes longer than JOB_TIMEOUT_S, and those that are not done within DOCUMENT_TIMEOUT_S, have the problem
    `timed-out`.

    With text=true the page is read: JSON lists the words with their boxes in the flat page and their corners in the
    photo, and a PDF can be searched. The formats hocr, alto, txt and markdown are the text itself.

    With preview=true and format=json, an app gets mesh, outline and advice while the camera is still on the page.
    """
    return await flatten(request, state, with_format(form, format))


async def flatten(
    request: Request, state: AppState, form: RectifyForm, answer: PageAnswer = answer_page
) -> Response:
    """Response of `answer` with the pages that `form` asks for, now or as a job."""
    settings = state.settings
    await check_photos(form.image, settings)
    encoding = await choose_pages_encoding(request, form, form.image[0])
    if form.preview:
        check_preview(form, encoding)
    parameters = replace(
        form.parameters(),
        text=form.text or encoding.needs_text,
        language=chosen_language(form.language, settings),
        keep_photo=not form.preview
        and (settings.keep_photos if form.keep_photo is None else form.keep_photo),
    )
    caller = caller_of(request)

    time_limit = await document_time_limit(form.image, settings)

    async def work(progress: ProgressSink | None) -> Response:
        cameras = await known_cameras(state.store, caller, is_enabled=settings.camera_memory)
        known = replace(parameters, cameras=cameras)
        if time_limit is not None:
            reply = await flatten_pages(state, form.image, known, encoding, time_limit, progress)
        else:
            limits = document_limits(settings)
            reply = await state.engine.submit(
                state.operations.rectify, form.image, known, encoding, limits, progress=progress
            )
        request.state.seat.release()
        if settings.camera_memory:
            await keep_cameras(state.store, caller, flat_pages(reply))
        if parameters.keep_photo:
            await keep_photos(state, caller, reply, [photo.filename for photo in form.image])
        return await answer(request, reply, form.image[0], "-flat")

    return await answer_now_or_later(request, state, work)


def check_preview(form: RectifyForm, encoding: Encoding) -> None:
    """Check that a preview is asked for in JSON, and for nothing that only the whole work gives.

    Raises
    ------
    InvalidOption
    """
    if encoding.format != "json":
        raise InvalidOption("preview: a preview is JSON; send format=json as well.", "preview")
    for name, asked in (
        ("text", form.text),
        ("embed", encoding.embed),
        ("pages", form.pages == "both"),
        ("corners", bool(form.corners)),
        ("rotate", form.rotate != "auto"),
        ("margin", form.margin > 0),
        ("keep_photo", bool(form.keep_photo)),
    ):
        if asked:
            raise InvalidOption(
                f"{name}: a preview does not have it; send the request without {name}, or without preview.",
                name,
            )
