"""/layout/unknown-pages and /layout/proposals: pages that fitted no class, and what the set of classes may lack."""

from itertools import islice
from typing import Any

from fastapi import APIRouter, Request, Response

from app.engine.base import TimeLimit
from app.problems import documented
from app.routes.labelled_pages import layout_settings
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later
from app.routes.state import State
from app.routes.usual_problems import BODY, READING, STORE, WORK
from app.schemas.layout_proposals import Proposals, UnknownPage, UnknownPageList, UnknownPageSummary
from models.errors import UnknownPageNotFound
from models.repository import Store
from services.contract.layout_models import StoredPage
from services.progress import ProgressSink

router = APIRouter(prefix="/layout", tags=["layout proposals"])

MOST_SAMPLES = 24
"""Of a model, the newest; more tell the same (`services.layout.discovery.class_samples`)."""
MOST_SAMPLES_TOGETHER = 1600
"""Of all models: as documents they have 30 MB, and a worker looks at them for a minute."""
LEAST_SAMPLES = 4
"""Of a model, however many there are; two halves of fewer tell nothing."""


@router.get(
    "/unknown-pages",
    operation_id="unknown_layout_pages",
    responses=documented(*STORE),
)
async def unknown_layout_pages(state: State) -> UnknownPageList:
    """Pages that fitted no class, newest first, without their zones; the newest are kept for some weeks."""

    def summarize(store: Store) -> list[UnknownPageSummary]:
        return [
            UnknownPageSummary(
                id=page.id, result=page.result_id, zones=len(page.page["zones"]), created=page.created_at
            )
            for page in store.each_unknown_page()
        ]

    return UnknownPageList(pages=(await state.store.call(summarize))[::-1])


@router.get("/unknown-pages/{id}", operation_id="unknown_layout_page", responses=documented(*READING))
async def unknown_layout_page(state: State, id: str) -> UnknownPage:
    """One page that fitted no class, to be labelled and sent to POST /layout/models/{name}/samples."""
    page = await state.store.call(lambda store: store.unknown_page(id))
    return UnknownPage.model_validate(
        {**page.page, "id": page.id, "result": page.result_id, "created": page.created_at}
    )


@router.delete(
    "/unknown-pages/{id}",
    operation_id="forget_unknown_layout_page",
    status_code=204,
    responses=documented(*READING),
)
async def forget_unknown_layout_page(state: State, id: str) -> None:
    """Forget a page that has become a sample, or that nobody shall be asked about again."""

    def forget(store: Store) -> None:
        if not store.forget_unknown_pages([id]):
            raise UnknownPageNotFound(f"there is no unknown page {id!r}, or no longer", id)

    await state.store.call(forget)


@router.post(
    "/proposals",
    operation_id="propose_layout_classes",
    response_class=Response,
    responses={
        200: {"description": "What was found; nothing was changed.", "model": Proposals},
        **ACCEPTED,
        **documented(*STORE, *BODY, *WORK),
    },
    openapi_extra=PREFER,
)
async def propose_layout_classes(request: Request, state: State) -> Response:
    """Look for new classes among the unknown pages, for models to merge, and for models to split.

    A new class is three unknown pages or more that are alike. Models of three samples or more are compared with each
    other, those of eight or more with themselves. Nothing changes: every proposal says which requests carry it out.
    """

    async def work(progress: ProgressSink | None) -> Response:
        unknown, classes = await state.store.call(_read_all)
        found = await state.engine.submit(
            state.operations.propose_classes,
            unknown,
            classes,
            layout_settings(state.settings),
            time_limit=TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S"),
            progress=progress,
        )
        request.state.seat.release()
        for key, steps in (
            ("new_classes", _steps_to_a_class),
            ("merges", _steps_to_merge),
            ("splits", _steps_to_split),
        ):
            found[key] = [{**each, "next": steps(each)} for each in found[key]]
        answer = Proposals.model_validate(found)
        return Response(answer.model_dump_json(), media_type="application/json")

    return await answer_now_or_later(request, state, work)


def _read_all(store: Store) -> tuple[list[StoredPage], dict[str, list[StoredPage]]]:
    """Unknown pages, newest first, and samples of every model."""
    unknown = [StoredPage(page.id, page.page) for page in store.each_unknown_page()][::-1]
    names = [model.name for model in store.models() if model.samples]
    each = max(LEAST_SAMPLES, min(MOST_SAMPLES, MOST_SAMPLES_TOGETHER // max(1, len(names))))
    classes = {}
    for name in names[: MOST_SAMPLES_TOGETHER // LEAST_SAMPLES]:
        newest = islice(store.each_sample(name, newest_first=True), each)
        classes[name] = [StoredPage(sample.id, sample.document) for sample in newest][::-1]
    return unknown, classes


def _steps_to_a_class(found: dict[str, Any]) -> list[str]:
    return [
        f"GET /layout/unknown-pages/{found['typical']}: give its zones their labels, and the same labels to the "
        "recurring zones of the other pages.",
        "POST /layout/models/{name}/samples with each labelled page, under the name of the new class.",
        "POST /layout/models/{name}/initialize makes its first model.",
        "DELETE /layout/unknown-pages/{id} of each page.",
    ]


def _steps_to_merge(found: dict[str, Any]) -> list[str]:
    kept, gone = found["models"]
    rename = " with its labels renamed as `labels` says" if found["labels"] else ""
    return [
        f"GET /layout/models/{gone}/samples/{{id}}, then POST /layout/models/{kept}/samples: each sample{rename}.",
        f"POST /layout/models/{kept}/initialize makes a model of all.",
        f"DELETE /layout/models/{gone}.",
    ]


def _steps_to_split(found: dict[str, Any]) -> list[str]:
    name = found["model"]
    return [
        f"GET /layout/models/{name}/samples/{{id}}, then POST /layout/models/{{other}}/samples: each sample of the "
        "smaller part, and those that were not looked at and belong to it.",
        f"DELETE /layout/models/{name}/samples/{{id}}: the same samples.",
        f"POST /layout/models/{name}/initialize and POST /layout/models/{{other}}/initialize make both models.",
    ]
