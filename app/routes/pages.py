"""Pages for people: the landing page, and the documentation with scripts and styles of this service."""

from html import escape
from importlib.resources import files
from pathlib import Path

from fastapi import APIRouter
from fastapi.openapi.docs import get_swagger_ui_html
from starlette.responses import HTMLResponse
from starlette.staticfiles import StaticFiles

from app import __version__
from app.routes.state import State

router = APIRouter(include_in_schema=False)

ASSETS_PATH = "/docs/assets"
TITLE = "Document rectification"

_LANDING = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 1.1rem/1.5 system-ui, sans-serif; max-width: 42rem; margin: 3rem auto; padding: 0 1rem; }}
code {{ background: #eee; color: #222; padding: 0 .2rem; }}
</style>
</head>
<body>
<main>
<h1>{title}</h1>
<p>This service makes flat pages from photos of documents, and labels what is on them.</p>
<ul>
<li><code>POST /rectify</code>: one photo of a page in, the flat page out.</li>
<li><code>POST /mosaic</code>: overlapping photos of one page in, the whole page out.</li>
<li><code>POST /layout</code>: a page in, its class and the labels of its zones out.</li>
</ul>
<p>For example: <code>curl -F image=@photo.jpg {root}/rectify -o flat.jpg</code></p>
<ul>
<li><a href="{root}/docs">All requests, to read and to try</a></li>
<li><a href="{root}/openapi.json">OpenAPI document, to generate clients</a></li>
<li><a href="{root}/health/ready">State of the service</a></li>
</ul>
<p>Version {version}</p>
</main>
</body>
</html>
"""


def assets() -> StaticFiles:
    """Scripts and styles of Swagger UI, from the package `fastapi-offline`."""
    return StaticFiles(directory=Path(str(files("fastapi_offline"))) / "static")


@router.get("/")
async def landing(state: State) -> HTMLResponse:
    """What this service is, with links."""
    root = escape(state.settings.root_path)
    return HTMLResponse(_LANDING.format(title=TITLE, root=root, version=escape(__version__)))


@router.get("/docs")
async def docs(state: State) -> HTMLResponse:
    """Swagger UI; the browser loads nothing from other hosts."""
    root = state.settings.root_path
    return get_swagger_ui_html(
        openapi_url=f"{root}/openapi.json",
        title=TITLE,
        swagger_js_url=f"{root}{ASSETS_PATH}/swagger-ui-bundle.js",
        swagger_css_url=f"{root}{ASSETS_PATH}/swagger-ui.css",
        swagger_favicon_url=f"{root}{ASSETS_PATH}/favicon.png",
        swagger_ui_parameters={"validatorUrl": None, "tryItOutEnabled": True},
    )
