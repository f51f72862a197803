"""The application, and the server that runs it."""

import asyncio
import logging
import signal
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import uvicorn
from fastapi import Depends, FastAPI
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import ValidationError
from pydantic_core import ErrorDetails
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartParser

from app import __version__
from app.access.keyring import Keyring
from app.access.tokens import SECRET, Tokens
from app.engine.absent import AbsentEngine
from app.engine.base import Engine
from app.engine.local import LocalEngine, PoolLimits
from app.http.known_options import KnownQueryOptions
from app.http.middleware import add_middleware, methods_of
from app.http.problems import FrameworkErrors
from app.http.upload_places import UploadPlaces
from app.interprocess_lock import InterprocessLock
from app.jobs.service import JobService
from app.learning.locks import ModelLocks
from app.logs import configure_logs
from app.metrics import Metrics
from app.openapi.document import serve_description
from app.processors import usable_processors
from app.review.order import ReviewOrder
from app.roles import InvalidKeys
from app.routes import (
    audit,
    cameras,
    health,
    kept_pages,
    layout,
    layout_exchange,
    layout_feedback,
    layout_images,
    layout_models,
    layout_proposals,
    layout_result,
    layout_results,
    layout_sample_archives,
    layout_samples,
    layout_settings,
    layout_training,
    layout_versions,
    mosaic,
    pages,
    rectify,
    review,
    shortcuts,
    tokens,
    uploads,
)
from app.routes import jobs as job_routes
from app.routes.sent_uploads import MANY_FILES
from app.run_folder import run_folder
from app.settings import Settings
from app.state import AppState
from app.storage.blobs import BlobAccess
from app.storage.disk_space import DiskSpace
from app.storage.expiry import deleting_expired
from app.storage.kept_images import KeptImages
from app.storage.layout_store import LayoutStore, ResultLimits
from app.storage.uploads import KeptUploads
from models.records import UploadBounds
from models.repository import Store
from services.contract.operations import Operations
from services.heap import keep_few_heaps
from services.layout.content.content_settings import InvalidContentSettings, read_settings

log = logging.getLogger(__name__)

ROUTERS = (
    rectify.router,
    kept_pages.router,
    cameras.router,
    mosaic.router,
    uploads.router,
    shortcuts.router,
    layout.router,
    layout_images.router,
    layout_feedback.router,
    layout_result.router,
    layout_results.router,
    layout_models.router,
    layout_samples.router,
    layout_sample_archives.router,
    layout_exchange.router,
    layout_training.router,
    layout_versions.router,
    layout_settings.router,
    layout_proposals.router,
    review.router,
    audit.router,
    job_routes.router,
    tokens.router,
    health.router,
)
LEARNING_LOCK = "learning.lock"
"""Lock file in the data folder, shared by the services that use that folder."""
TAGS = {
    "rectify": "One photo of a page in, the flat page out.",
    "pages": "Kept photos: other corners, turns and looks, and files of several pages, without sending them again.",
    "mosaic": "Overlapping photos of one page in, the whole page out.",
    "uploads": "Files in pieces over bad networks (tus 1.0.0); forms take their ids in place of files.",
    "layout": "A page or a document in, its class and the labels of its zones out.",
    "layout feedback": "What a person corrects; the models learn from it.",
    "layout models": "Models of document classes: their samples, versions, training and settings.",
    "layout proposals": "Pages of no known class; new classes, classes to merge and to split.",
    "review": "Pages that a person should look at, and who changed what.",
    "jobs": "Work whose answer comes later (`Prefer: respond-async`).",
    "tokens": "Short-lived tokens for links that cannot have an API key.",
    "health": "Whether the service is up, and its metrics.",
}
MAX_FIELD_BYTES = 64 * 1024
"""Largest option field. 200 points of a region need a tenth of it. The zones of a page have their own limit."""
MOST_HEAPS = 2
"""Of the server, for all its threads: with one heap for each, what they had freed added up to 100 MB."""
MultiPartParser.spool_max_size = 256 * 1024
"""Bytes of an uploaded file that stay in memory: 64 mosaics of 16 photos may arrive at once."""


def create_app(settings: Settings | None = None, operations: Operations | None = None) -> FastAPI:
    """The service as an ASGI application; its workers start with its lifespan.

    Raises
    ------
    InvalidKeys
        When the keys of API_KEYS and API_KEYS_FILE cannot be used.
    """
    settings = settings or Settings()
    operations = operations or Operations()
    routes = [
        route for router in (*ROUTERS, pages.router) for route in router.routes if isinstance(route, APIRoute)
    ]
    methods = methods_of(routes)
    keyring, tokens = Keyring(settings.api_keys, settings.api_keys_file), Tokens(settings.token_ttl_s)
    metrics = Metrics(methods)
    engine = _engine(settings, operations, metrics)
    metrics.watch(engine.status)
    store = LayoutStore(
        settings.data_dir,
        ResultLimits(
            settings.result_ttl_s, settings.max_results, settings.max_unknown_pages, settings.unknown_ttl_s
        ),
        database_url=settings.database_url,
        timeout_s=settings.store_timeout_s,
    )
    locks = ModelLocks(InterprocessLock(None if settings.database_url else settings.data_dir / LEARNING_LOCK))
    blobs = BlobAccess(settings.blob_url, settings.data_dir)
    images, sample_images, photos = _pictures(blobs, store, settings)
    kept_uploads = KeptUploads(
        blobs,
        store,
        UploadBounds(
            settings.max_kept_uploads, settings.most_uploads_per_key, settings.max_kept_uploads_bytes
        ),
        settings.upload_ttl_s,
    )
    places = UploadPlaces(settings.max_uploads, settings.min_body_bytes_per_s)
    review_order = ReviewOrder(store, engine, operations, settings)
    disk = DiskSpace(() if settings.database_url else (settings.data_dir,), settings.min_free_disk_bytes)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        _check_content_features(settings.content_features)
        async with store.opened():  # first: a service that cannot store anything must not start
            tokens.use(await store.call(lambda store: store.secret(SECRET)))
            await blobs.open()
            await engine.start()
            log.info(
                "workers are warm", extra={"workers": settings.workers, **engine.status().facts._asdict()}
            )
            await job_service.start()
            try:
                async with (
                    deleting_expired(store, images, sample_images, photos, kept_uploads),
                    review_order.kept(),
                    keyring.watched(),
                ):
                    yield
            finally:
                begin_s = time.monotonic()
                await job_service.stop(settings.shutdown_grace_s)
                await engine.drain(max(0.0, begin_s + settings.shutdown_grace_s - time.monotonic()))
                await blobs.close()
                locks.close()

    app = FastAPI(
        title="Document rectification",
        summary="Photos of documents in; flat pages, their classes and the labels of their parts out.",
        version=__version__,
        lifespan=lifespan,
        openapi_url=None,  # `serve_description` serves it
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        dependencies=[Depends(KnownQueryOptions(routes))],
        form_limits={"max_fields": 50, "max_files": 4, "max_part_size": MAX_FIELD_BYTES},
    )
    _add_routes(app, settings)
    answer = FrameworkErrors(methods)
    app.add_exception_handler(HTTPException, answer)
    app.add_exception_handler(RequestValidationError, answer)
    job_service = JobService(app, answer, store, blobs, settings)
    metrics.watch_jobs(job_service.facts)
    app.state.document_rectification = AppState(
        settings,
        engine,
        operations,
        store,
        metrics,
        locks,
        job_service.jobs,
        disk,
        blobs,
        images,
        sample_images,
        photos,
        job_service,
        review_order,
        tokens,
        kept_uploads,
        places,
    )
    add_middleware(app, settings, engine, job_service.jobs, metrics, routes, keyring, tokens, places)
    serve_description(app, TAGS, keys=settings.has_keys, root_path=settings.root_path)
    return app


def _add_routes(app: FastAPI, settings: Settings) -> None:
    for router in ROUTERS:
        if router is layout.router:
            # The limit of one field must be reached before that of all fields, because its message names the field.
            spare = settings.max_zones_bytes + MAX_FIELD_BYTES
            # The form accepts more files than a stack may have pages: the error is about pages, not about the form.
            files = max(MANY_FILES, 2 * settings.max_pages, 2 * settings.max_stack_pages)
            app.include_router(router, form_limits={"max_part_size": spare, "max_files": files})
        else:
            app.include_router(router)
    app.include_router(pages.router)
    app.mount(pages.ASSETS_PATH, pages.assets())
    app.mount(pages.STATIC_PATH, pages.static_files())


def _pictures(
    blobs: BlobAccess, store: LayoutStore, settings: Settings
) -> tuple[KeptImages, KeptImages, KeptImages]:
    """Pictures of results, images of samples, and kept photos."""
    return (
        KeptImages(blobs, store, settings.max_kept_images_bytes),
        KeptImages(blobs, store, settings.max_sample_images_bytes, "sample-images", Store.kept_samples),
        KeptImages(blobs, store, settings.max_kept_photos_bytes, "kept-photos", Store.kept_pages),
    )


def _engine(settings: Settings, operations: Operations, metrics: Metrics) -> Engine:
    if not settings.workers:
        return AbsentEngine()
    return LocalEngine(
        PoolLimits(
            workers=settings.workers,
            processors=usable_processors(),
            queue_length=settings.queue_length,
            job_timeout_s=settings.job_timeout_s,
            queue_timeout_s=settings.queue_timeout_s,
            worker_memory_bytes=settings.worker_memory_bytes,
            jobs_per_worker=settings.jobs_per_worker,
            worker_resident_bytes=settings.worker_resident_bytes,
        ),
        warm_up=operations.warm_up,
        warm_up_arguments=(settings.content_features,),
        preload=operations.modules,
        observe=metrics.observe_job,
    )


def _check_content_features(path: Path | None) -> None:
    """Raise if workers could not use the settings file; the error names the wrong entry.

    Raises
    ------
    InvalidContentSettings
    """
    if path is None:
        return
    try:
        read_settings(path)
    except InvalidContentSettings as error:
        log.error("the content features (CONTENT_FEATURES) cannot be used: %s", error)
        raise error.with_traceback(None) from None  # the server logs the error; omit its traceback


def _settings_of_environment() -> Settings:
    """The settings; where some are wrong, the process ends with a sentence for each."""
    try:
        return Settings()
    except ValidationError as error:
        wrong = [each for each in error.errors() if each["type"] != "default_factory_not_called"]
        sys.exit("\n".join(map(_sentence_of, wrong)))


def _sentence_of(wrong: ErrorDetails) -> str:
    """What is wrong with a setting, or with several together."""
    said = wrong["msg"].removeprefix("Value error, ")
    return f"{str(wrong['loc'][0]).upper()}: {said}" if wrong["loc"] else said


def _configure_process(settings: Settings) -> None:
    """Logs go to standard output. Until the service listens to SIGHUP, that signal does not end it."""
    configure_logs(settings.log_level)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)


def _app(settings: Settings) -> FastAPI:
    """The application; where its keys cannot be used, the process ends with a sentence."""
    try:
        return create_app(settings)
    except InvalidKeys as error:
        sys.exit(str(error))


def work(app: FastAPI | None = None, settings: Settings | None = None) -> None:
    """Run jobs, without HTTP, until SIGTERM or SIGINT. Running jobs may then finish within the grace period."""
    settings = settings or _settings_of_environment()
    _configure_process(settings)
    if not settings.workers:
        sys.exit("WORKERS=0: a process that only runs jobs needs workers.")
    app = app or _app(settings)

    async def run_jobs() -> None:
        stopping = asyncio.Event()
        for number in (signal.SIGTERM, signal.SIGINT):
            asyncio.get_running_loop().add_signal_handler(number, stopping.set)
        async with app.router.lifespan_context(app):
            log.info("the worker takes jobs")
            await stopping.wait()

    with run_folder():
        asyncio.run(run_jobs())


def serve(app: FastAPI | None = None, settings: Settings | None = None) -> None:
    """Run the service until SIGTERM or SIGINT. Requests in progress may then finish within the grace period."""
    keep_few_heaps(MOST_HEAPS)
    settings = settings or _settings_of_environment()
    _configure_process(settings)
    app = app or _app(settings)
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            host=settings.host,
            port=settings.port,
            ssl_certfile=settings.tls_certificate,
            lifespan="on",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_keep_alive=settings.keep_alive_s,
            timeout_graceful_shutdown=settings.shutdown_grace_s,
        )
    )
    # uvicorn raises the signal again after its shutdown; this handler makes the exit status 0.
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))
    try:
        with run_folder():
            server.run()
    except KeyboardInterrupt:
        sys.exit(0)
