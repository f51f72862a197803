"""POST /mosaic: several overlapping photos of one page -> the whole page."""

from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request, Response

from app.access.callers import caller_of
from app.engine.base import TimeLimit
from app.http.known_options import known_parts, with_format
from app.http.ocr_languages import chosen_language
from app.routes.kept_pages import keep_photos
from app.routes.long_work import PREFER, answer_now_or_later
from app.routes.page_answers import MOSAIC_HEADERS, PageAnswer, answer_page, choose_encoding, documented_page
from app.routes.sent_uploads import MANY_FILES, UploadFormRoute
from app.schemas.mosaic import MosaicForm
from app.schemas.options import AskedFormat, CallbackUrl
from app.state import AppState, State
from app.storage.camera_memory import known_cameras
from services.contract.answers.mosaic import MosaicResult
from services.contract.mosaic import MosaicLimits
from services.progress import ProgressSink

router = APIRouter(tags=["mosaic"], route_class=UploadFormRoute, form_limits={"max_files": MANY_FILES})


@router.post(
    "/mosaic",
    operation_id="mosaic",
    response_class=Response,
    responses=documented_page(
        MosaicResult,
        MOSAIC_HEADERS,
        ("not-overlapping",),
    ),
    openapi_extra=PREFER,
    dependencies=[known_parts(MosaicForm)],
)
async def mosaic(
    request: Request,
    state: State,
    form: Annotated[MosaicForm, Form(media_type="multipart/form-data")],
    format: Annotated[AskedFormat, Query()] = None,
    callback_url: Annotated[CallbackUrl, Query()] = None,
) -> Response:
    """Join overlapping photos of one page, in any order and from any positions, into the whole flat page.

    The response format follows `Accept`, or the field `format`; else it is an image in the first photo's own format
    (HEIC: JPEG). Photos that could not be placed are listed.
    """
    return await join(request, state, with_format(form, format))


async def join(
    request: Request, state: AppState, form: MosaicForm, answer: PageAnswer = answer_page
) -> Response:
    """Response of `answer` with the page that `form` asks for, now or as a job."""
    encoding = await choose_encoding(request, form, form.images[0])
    parameters = form.parameters()
    language = chosen_language(form.language, state.settings)
    parameters = replace(parameters, text=form.text or encoding.needs_text, language=language)
    settings, caller = state.settings, caller_of(request)
    photo_limits = replace(settings.image_limits, max_bytes=settings.max_mosaic_upload_bytes)

    async def work(progress: ProgressSink | None) -> Response:
        cameras = await known_cameras(state.store, caller, is_enabled=settings.camera_memory)
        reply = await state.engine.submit(
            state.operations.mosaic,
            form.images,
            replace(parameters, cameras=cameras),
            encoding,
            MosaicLimits(photo_limits, settings.max_mosaic_megapixels),
            time_limit=TimeLimit(settings.mosaic_timeout_s, "MOSAIC_TIMEOUT_S"),
            progress=progress,
        )
        request.state.seat.release()
        if parameters.keep_photo:
            await keep_photos(state, caller, reply, [photo.filename for photo in form.images])
        return await answer(request, reply, form.images[0], "-mosaic")

    return await answer_now_or_later(request, state, work)
