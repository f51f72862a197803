"""/layout/unknown-pages and /layout/proposals: pages that fit no class, and proposed changes of the classes."""

from itertools import islice
from typing import Annotated, cast

from fastapi import APIRouter, Query, Request, Response

from app.access.callers import Caller, caller_of
from app.engine.base import TimeLimit
from app.http.json_answers import answer_json
from app.http.json_bodies import refuse_body
from app.http.paging import LINK, MOST_LISTED, Cursor, Limit, first_of, link_next
from app.http.problems import documented
from app.learning.labelled_pages import layout_settings
from app.routes.common_responses import BODY, READING, STORE, WORK
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later
from app.schemas.layout_proposals import UnknownPage, UnknownPageList, UnknownPageSummary
from app.schemas.layout_samples import without_words
from app.schemas.options import CallbackUrl
from app.state import State
from models.errors import UnknownPageNotFound
from models.records import StoredUnknownPage
from models.repository import Store
from services.contract.answers.proposals import Merge, NewClass, Proposals, Split
from services.contract.layout_models import MOST_COMPARED_SAMPLES, PageDocument
from services.contract.page_json import SampleJson
from services.progress import ProgressSink

router = APIRouter(prefix="/layout", tags=["layout proposals"])

MOST_SAMPLES_TOGETHER = 1600
"""Largest number of samples of all models: their documents have 30 MB, and a worker needs a minute for them."""
LEAST_SAMPLES = 4
"""Smallest number of samples of one model, however many models there are; smaller halves cannot be compared."""


@router.get(
    "/unknown-pages",
    operation_id="unknown_layout_pages",
    responses={200: {"headers": LINK}, **documented(*STORE)},
)
async def unknown_layout_pages(
    request: Request,
    response: Response,
    state: State,
    limit: Limit = MOST_LISTED,
    cursor: Cursor = None,
) -> UnknownPageList:
    """Pages that fit no class, newest first, without their zones. The newest are kept for some weeks."""

    def summarize(store: Store) -> list[UnknownPageSummary]:
        return [
            UnknownPageSummary(
                id=page.id, result=page.result_id, zones=len(page.page["zones"]), created=page.created_at
            )
            for page in store.each_unknown_page()
            if caller.sees(page.owner) and (cursor is None or page.id < cursor)
        ]

    caller = caller_of(request)
    pages, has_more = first_of(reversed(await state.store.call(summarize)), limit)
    if has_more:
        link_next(request, state, response, pages[-1].id)
    return UnknownPageList(pages=pages)


@router.get("/unknown-pages/{id}", operation_id="unknown_layout_page", responses=documented(*READING))
async def unknown_layout_page(request: Request, state: State, id: str) -> UnknownPage:
    """One page that fits no class, to be labelled and sent to POST /layout/models/{name}/samples."""
    caller = caller_of(request)
    page = await state.store.call(lambda store: _own_page(store, id, caller))
    return UnknownPage.model_validate(
        {**without_words(page.page), "id": page.id, "result": page.result_id, "created": page.created_at}
    )


@router.delete(
    "/unknown-pages/{id}",
    operation_id="forget_unknown_layout_page",
    status_code=204,
    response_class=Response,
    responses=documented(*READING),
)
async def forget_unknown_layout_page(request: Request, state: State, id: str) -> None:
    """Delete an unknown page, for example after it has become a sample."""

    caller = caller_of(request)

    def forget(store: Store) -> None:
        _own_page(store, id, caller)
        if not store.forget_unknown_pages([id]):
            raise UnknownPageNotFound(f"there is no unknown page {id!r}, or it has expired", id)

    await state.store.call(forget)


@router.post(
    "/proposals",
    operation_id="propose_layout_classes",
    response_class=Response,
    responses={
        200: {"description": "The proposals; nothing was changed.", "model": Proposals},
        **ACCEPTED,
        **documented("conflict", "invalid-option", *STORE, *BODY, *WORK),
    },
    openapi_extra=PREFER,
)
async def propose_layout_classes(
    request: Request, state: State, callback_url: Annotated[CallbackUrl, Query()] = None
) -> Response:
    """Find new classes among the unknown pages, models to merge, and models to split.

    A new class is at least three similar unknown pages. Models with at least three samples are compared with each
    other; models with at least eight are checked for a split. Nothing changes: every proposal lists the requests that
    carry it out.
    """
    await refuse_body(request)
    caller = caller_of(request)

    async def work(progress: ProgressSink | None) -> Response:
        unknown, classes = await state.store.call(lambda store: _read_all(store, caller))
        found = await state.engine.submit(
            state.operations.propose_classes,
            unknown,
            classes,
            layout_settings(state.settings),
            time_limit=TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S"),
            progress=progress,
        )
        request.state.seat.release()
        for group in found.new_classes:
            group.next = _steps_to_a_class(group)
        for merge in found.merges:
            merge.next = _steps_to_merge(merge)
        for split in found.splits:
            split.next = _steps_to_split(split)
        return await answer_json(lambda: found)

    return await answer_now_or_later(request, state, work)


def _own_page(store: Store, page_id: str, caller: Caller) -> StoredUnknownPage:
    """An unknown page of the caller. Raises `UnknownPageNotFound`."""
    page = store.unknown_page(page_id)
    if not caller.sees(page.owner):
        raise UnknownPageNotFound(f"there is no unknown page {page_id!r}, or no longer", page_id)
    return page


def _read_all(store: Store, caller: Caller) -> tuple[list[PageDocument], dict[str, list[PageDocument]]]:
    """The caller's unknown pages, newest first, and samples of every model."""
    pages = [page for page in store.each_unknown_page() if caller.sees(page.owner)]
    unknown = [PageDocument(page.id, cast(SampleJson, page.page)) for page in pages[::-1]]
    names = [model.name for model in store.models() if model.samples]
    each = max(LEAST_SAMPLES, min(MOST_COMPARED_SAMPLES, MOST_SAMPLES_TOGETHER // max(1, len(names))))
    classes = {}
    for name in names[: MOST_SAMPLES_TOGETHER // LEAST_SAMPLES]:
        newest = islice(store.each_sample(name, newest_first=True), each)
        classes[name] = [PageDocument(sample.id, sample.document) for sample in newest][::-1]
    return unknown, classes


def _steps_to_a_class(found: NewClass) -> list[str]:
    return [
        f"GET /layout/unknown-pages/{found.typical}: label its zones, and give the recurring zones of the other "
        "pages the same labels.",
        "POST /layout/models/{name}/samples with each labelled page, under the name of the new class.",
        "POST /layout/models/{name}/initialize to make its first model.",
        "DELETE /layout/unknown-pages/{id} for each page.",
    ]


def _steps_to_merge(found: Merge) -> list[str]:
    kept, gone = found.models
    rename = " with its labels renamed as `labels` says" if found.labels else ""
    return [
        f"GET /layout/models/{gone}/samples/{{id}}, then POST /layout/models/{kept}/samples: each sample{rename}.",
        f"POST /layout/models/{kept}/initialize to make a model from all samples.",
        f"DELETE /layout/models/{gone}.",
    ]


def _steps_to_split(found: Split) -> list[str]:
    name = found.model
    return [
        f"GET /layout/models/{name}/samples/{{id}}, then POST /layout/models/{{other}}/samples: each sample of the "
        "smaller part, and other samples that belong to it but were not compared.",
        f"DELETE /layout/models/{name}/samples/{{id}}: the same samples.",
        f"POST /layout/models/{name}/initialize and POST /layout/models/{{other}}/initialize to make both models.",
    ]
