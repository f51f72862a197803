"""What every request passes before its route."""

from collections.abc import Iterable

from fastapi import FastAPI
from fastapi.routing import APIRoute
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware

from app.access.audit import Audit
from app.access.authentication import ApiKeys
from app.access.keyring import Keyring
from app.access.tokens import Tokens
from app.engine.base import Engine
from app.http.body_limits import body_limits_of
from app.http.browser_rules import OwnSite, SecurityHeaders
from app.http.octets import Octets
from app.http.paths import MOSAIC_PATHS, RECTIFY_PATHS, UPLOAD_PATHS, PlainPaths
from app.http.problems import ProblemBoundary
from app.http.transfer import ConditionalGet, HeadAndOptions, RootPath
from app.http.tus import options_headers
from app.http.upload_places import UploadPlaces
from app.http.uploads import BodyGuard, UploadAdmission
from app.jobs.forwarding import JobAdmission
from app.jobs.registry import Jobs
from app.logs import RequestLog
from app.metrics import Metrics
from app.roles import RoleRules
from app.settings import Settings

WORK = frozenset(
    {
        *(("POST", path) for path in (*RECTIFY_PATHS, *MOSAIC_PATHS)),
        ("GET", "/pages/{id}/photo"),
        ("POST", "/pages/{id}/render"),
        ("POST", "/pages/bind"),
        ("POST", "/layout"),
        ("PUT", "/layout/models/{name}"),
        ("POST", "/layout/models/{name}/samples"),
        ("POST", "/layout/models/{name}/samples/archive"),
        ("POST", "/layout/import"),
        ("POST", "/layout/models/{name}/initialize"),
        ("POST", "/layout/models/{name}/train"),
        ("GET", "/layout/models/{name}/versions/{version}/diff"),
        ("POST", "/layout/results/{id}/feedback"),
        ("DELETE", "/layout/results/{id}/feedback"),
        ("POST", "/layout/proposals"),
    }
)
"""Requests that need a seat in the engine."""
LATER = frozenset(
    {
        *(("POST", path) for path in (*RECTIFY_PATHS, *MOSAIC_PATHS)),
        ("POST", "/layout"),
        ("POST", "/layout/models/{name}/initialize"),
        ("POST", "/layout/models/{name}/train"),
        ("POST", "/layout/models/{name}/samples/archive"),
        ("POST", "/layout/import"),
        ("POST", "/layout/proposals"),
    }
)
"""Those that may be jobs."""


OPENAPI_PATH = "/openapi.json"
COMMON_HEADERS = frozenset(
    {"ETag", "Location", "Retry-After", "X-Request-ID", "Content-Disposition", "Link", "Allow"}
)
"""Response headers of many routes."""
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
COMPRESSED_FROM_BYTES = 4096
"""Smaller responses are sent faster than they are compressed."""
COMPRESSION = 5
"""gzip's level: 9 takes three times as long for 3 % less JSON."""
COMPACT_TYPES = (
    *DEFAULT_EXCLUDED_CONTENT_TYPES,
    "application/pdf",
    "image/tiff",
    "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
)
"""Responses that gzip would not make smaller."""


def add_middleware(
    app: FastAPI,
    settings: Settings,
    engine: Engine,
    jobs: Jobs,
    metrics: Metrics,
    routes: list[APIRoute],
    keyring: Keyring,
    tokens: Tokens,
    places: UploadPlaces,
) -> None:
    """Add everything that every request passes before its route.

    The middleware that is added last is the outermost: prefix, log, security headers, body limits, origins, files as
    bytes, compression, errors, paths that name nothing, requests of other sites, API keys, roles, list of changes,
    methods, admission to the queue of jobs and to the engine.
    """
    app.add_middleware(UploadAdmission, engine=engine, work=WORK, places=places)
    app.add_middleware(
        JobAdmission,
        jobs=jobs,
        work=WORK,
        later=LATER,
        places=places,
        queue_timeout_s=settings.queue_timeout_s,
        forwards=not settings.workers,
    )
    app.add_middleware(ConditionalGet)
    app.add_middleware(
        HeadAndOptions,
        methods=methods_of(routes),
        more=dict.fromkeys(UPLOAD_PATHS, options_headers(settings.largest_upload[0])),
    )
    app.add_middleware(Audit)
    app.add_middleware(RoleRules)
    app.add_middleware(ApiKeys, keyring=keyring, tokens=tokens)
    app.add_middleware(OwnSite, origins=settings.cors_origins)
    app.add_middleware(PlainPaths)
    app.add_middleware(ProblemBoundary)
    app.add_middleware(
        GZipMiddleware,
        minimum_size=COMPRESSED_FROM_BYTES,
        compresslevel=COMPRESSION,
        exclude_content_types=COMPACT_TYPES,
    )
    app.add_middleware(Octets)
    if settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=settings.cors_origins,
            allow_methods=METHODS,
            allow_headers=("*",),
            expose_headers=_headers_of(routes),
        )
    limits, of_path = body_limits_of(settings)
    app.add_middleware(BodyGuard, limits=limits, of_path=of_path)
    app.add_middleware(SecurityHeaders, has_other_origins=bool(settings.cors_origins))
    app.add_middleware(RequestLog, metrics=metrics)
    app.add_middleware(RootPath, root_path=settings.root_path)


def methods_of(routes: Iterable[APIRoute]) -> dict[str, frozenset[str]]:
    """Methods of each path template."""
    methods: dict[str, frozenset[str]] = {OPENAPI_PATH: frozenset({"GET"})}
    for route in routes:
        methods[route.path] = methods.get(route.path, frozenset()) | (route.methods or set())
    return methods


def _headers_of(routes: Iterable[APIRoute]) -> list[str]:
    """Response headers that browser apps of other origins may read: documented ones and common ones."""
    documented = {
        header
        for route in routes
        for response in route.responses.values()
        for header in response.get("headers", ())
    }
    return sorted(documented | COMMON_HEADERS)
