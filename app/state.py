"""State of the app, as routes use it."""

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request

from app.access.tokens import Tokens
from app.engine.base import Engine
from app.http.upload_places import UploadPlaces
from app.jobs.registry import Jobs
from app.jobs.service import JobService
from app.learning.locks import ModelLocks
from app.metrics import Metrics
from app.review.order import ReviewOrder
from app.settings import Settings
from app.storage.blobs import BlobAccess
from app.storage.disk_space import DiskSpace
from app.storage.kept_images import KeptImages
from app.storage.layout_store import LayoutStore
from app.storage.uploads import KeptUploads
from services.contract.operations import Operations


@dataclass(frozen=True, slots=True)
class AppState:
    """Objects of one app; `create_app` creates them."""

    settings: Settings
    engine: Engine
    operations: Operations
    store: LayoutStore
    metrics: Metrics
    locks: ModelLocks
    jobs: Jobs
    disk: DiskSpace
    blobs: BlobAccess
    images: KeptImages
    sample_images: KeptImages
    photos: KeptImages
    job_service: JobService
    review_order: ReviewOrder
    tokens: Tokens
    uploads: KeptUploads
    places: UploadPlaces


def app_state(request: Request) -> AppState:
    """The state of the app that serves this request."""
    return cast(AppState, request.app.state.document_rectification)


State = Annotated[AppState, Depends(app_state)]
