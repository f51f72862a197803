"""Pages for people: the page at `/`, and the documentation, with scripts and styles of this service."""

import json
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path

from fastapi import APIRouter
from starlette.responses import HTMLResponse, Response
from starlette.staticfiles import StaticFiles

from app import __version__
from app.http.browser_rules import SERVICE_WORKER_PATH
from app.state import State

router = APIRouter(include_in_schema=False)

ASSETS_PATH = "/docs/assets"
TITLE = "Document rectification"

STATIC_PATH = "/static"
SHOWN = frozenset({".js", ".css", ".svg", ".png", ".jpg", ".json"})
"""Endings of the files that the page shows, also without a network."""
NOT_SHOWN = frozenset({"service_worker", "docs"})
_STATIC = Path(str(files("app"))) / "static"


def assets() -> StaticFiles:
    """Scripts and styles of Swagger UI, from the package `fastapi-offline`."""
    return StaticFiles(directory=Path(str(files("fastapi_offline"))) / "static")


def static_files() -> StaticFiles:
    """Scripts and styles of the page at `/`, which are part of this package."""
    return StaticFiles(directory=_STATIC)


@router.get("/")
async def page(state: State) -> HTMLResponse:
    """The page in which a person flattens photos, corrects layouts and looks after models."""
    html = (_STATIC / "index.html").read_text(encoding="utf-8")
    return HTMLResponse(
        html.replace("{root}", escape(state.settings.root_path)).replace("{version}", escape(__version__))
    )


@router.get(SERVICE_WORKER_PATH)
async def service_worker() -> Response:
    """The script that shows the page without a network. It is at the root, as it may serve only what lies below it."""
    script = (_STATIC / "service_worker.js").read_text(encoding="utf-8")
    named = script.replace("{files}", json.dumps(_files_of_page())).replace("{version}", __version__)
    return Response(named, media_type="text/javascript")


@cache
def _files_of_page() -> list[str]:
    """Paths of the page's files below the prefix of the service, without the worker and the licences."""
    found = sorted(path for path in _STATIC.rglob("*") if path.is_file() and path.suffix in SHOWN)
    return [f"static/{path.relative_to(_STATIC).as_posix()}" for path in found if path.stem not in NOT_SHOWN]


@router.get("/docs")
async def docs(state: State) -> HTMLResponse:
    """Swagger UI; the browser loads nothing from other hosts."""
    html = (_STATIC / "docs.html").read_text(encoding="utf-8")
    return HTMLResponse(html.replace("{root}", escape(state.settings.root_path)).replace("{title}", TITLE))
