"""/layout/models/{name}/settings and /health: settings of a model, and its error rates."""

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter, Request

from app.http.json_bodies import json_request, read_json
from app.http.preconditions import Conflict
from app.http.problems import documented
from app.routes.common_responses import BODY, READING
from app.schemas.layout_models import Health, ModelName
from app.schemas.layout_settings import ModelHealthReport, Settings, SettingsBody, TypedField
from app.state import State
from models.errors import NotStorable
from models.feedback_records import ModelHealth
from models.records import ModelSettings
from models.repository import Store

router = APIRouter(prefix="/layout/models/{name}", tags=["layout models"])


@router.get("/health", operation_id="layout_model_health", responses=documented(*READING))
async def layout_model_health(state: State, name: ModelName) -> ModelHealthReport:
    """Error rates of recognition on pages of this class, computed from feedback: recent ones and earlier ones."""
    health = await state.store.call(lambda store: store.health(name))
    return ModelHealthReport(name=name, **health_of(health).model_dump())


@router.get("/settings", operation_id="layout_model_settings", responses=documented(*READING))
async def layout_model_settings(state: State, name: ModelName) -> Settings:
    """Settings of a model. They do not belong to a version."""
    settings = await state.store.call(lambda store: store.settings(name))
    return settings_answer(settings)


@router.patch(
    "/settings",
    operation_id="change_layout_model_settings",
    responses=documented("conflict", *READING, *BODY),
    openapi_extra=json_request(SettingsBody),
)
async def change_layout_model_settings(request: Request, state: State, name: ModelName) -> Settings:
    """Change the given settings and keep the others; null restores a default (RFC 7396)."""
    body = await read_json(request, SettingsBody)
    changes = settings_changes(body)

    def write(store: Store) -> ModelSettings:
        if store.model_summary(name).name == body.continues:
            raise Conflict(f"continues: {name} cannot continue itself.", "continues")
        try:
            return store.change_settings(name, **changes)
        except NotStorable as error:  # the names are valid, so another class's `continues` conflicts
            raise Conflict(f"{error.detail}.", "continues") from error

    return settings_answer(await state.store.call(write))


def settings_changes(body: SettingsBody) -> dict[str, Any]:
    """The settings that a request gives, as `Store.change_settings` takes them."""
    changes = body.model_dump(include=body.model_fields_set)
    if body.fields is not None:
        changes["fields"] = {
            label: None if each is None else each.setting() for label, each in body.fields.items()
        }
    return changes


def settings_answer(settings: ModelSettings) -> Settings:
    """The settings of a model as a response."""
    given = asdict(settings)
    given["fields"] = {
        label: TypedField(**{**asdict(each), "languages": list(each.languages)})
        for label, each in settings.fields.items()
    }
    given["items"] = list(settings.items)
    return Settings(**given)


def health_of(health: ModelHealth) -> Health:
    """Health as a part of responses."""
    return Health(
        feedbacks=health.feedbacks,
        recent=health.recent,
        recent_zone_error=_rounded(health.recent_zone_error),
        recent_class_error=_rounded(health.recent_class_error),
        recent_text_error=_rounded(health.recent_text_error),
        earlier_zone_error=_rounded(health.earlier_zone_error),
        last_feedback=health.last_feedback_at,
    )


def _rounded(error: float | None) -> float | None:
    return None if error is None else round(error, 4)
