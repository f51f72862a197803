"""Pages for people: the page at `/`, and the documentation, with scripts and styles of this service."""

from html import escape
from importlib.resources import files
from pathlib import Path

from fastapi import APIRouter
from starlette.responses import HTMLResponse
from starlette.staticfiles import StaticFiles

from app import __version__
from app.state import State

router = APIRouter(include_in_schema=False)

ASSETS_PATH = "/docs/assets"
TITLE = "Document rectification"

STATIC_PATH = "/static"
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


@router.get("/docs")
async def docs(state: State) -> HTMLResponse:
    """Swagger UI; the browser loads nothing from other hosts."""
    html = (_STATIC / "docs.html").read_text(encoding="utf-8")
    return HTMLResponse(html.replace("{root}", escape(state.settings.root_path)).replace("{title}", TITLE))
