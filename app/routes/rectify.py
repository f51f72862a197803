"""POST /rectify: one photo of a page -> its frontal flat view."""

from typing import Annotated

from fastapi import APIRouter, Form, Query, Request, Response

from app.form_parts import FormRoute
from app.routes.known_options import known_parts, with_format
from app.routes.long_work import PREFER, answer_now_or_later
from app.routes.page_answers import answer_page, choose_pages_encoding, documented_page
from app.routes.state import State
from app.schemas.options import AskedPagesFormat, CallbackUrl
from app.schemas.rectify import PagesResult, RectifyForm, RectifyResult
from services.progress import ProgressSink

router = APIRouter(tags=["rectify"], route_class=FormRoute)

MOST_FILES = 64
"""More than the route accepts, so that the error for several photos is about photos, not about the form."""


@router.post(
    "/rectify",
    operation_id="rectify",
    response_class=Response,
    responses=documented_page(
        RectifyResult,
        "Document-Kind",
        "planar or curved; for several pages one value each, separated by commas.",
        pages_model=PagesResult,
    ),
    openapi_extra=PREFER,
    dependencies=[known_parts(RectifyForm, "To join overlapping photos, use /mosaic.")],
    form_limits={"max_files": MOST_FILES},
)
async def rectify(
    request: Request,
    state: State,
    form: Annotated[RectifyForm, Form(media_type="multipart/form-data")],
    format: Annotated[AskedPagesFormat, Query()] = None,
    callback_url: Annotated[CallbackUrl, Query()] = None,
) -> Response:
    """Flatten one photo of a page, taken from any position.

    The response format follows `Accept`, or the field `format`; else it is an image in the upload's own format
    (HEIC: JPEG).

    With pages=both, the response for an open book is its two pages, left before right: as a PDF, a TIFF file of two
    pages, an archive with one image per page (format=zip), or JSON; without `Accept` and `format`, as a PDF. `jpeg`,
    `png` and `webp` hold one page: they are refused (`not-acceptable`) when two pages are found.
    """
    form = with_format(form, format)
    encoding = await choose_pages_encoding(request, form, form.image)

    async def work(progress: ProgressSink | None) -> Response:
        reply = await state.engine.submit(
            state.operations.rectify,
            form.image,
            form.parameters(),
            encoding,
            state.settings.image_limits,
            progress=progress,
        )
        request.state.seat.release()
        return answer_page(reply, RectifyResult if form.pages == "main" else PagesResult, form.image, "-flat")

    return await answer_now_or_later(request, state, work)
