"""All settings, read from the environment. Names contain units."""

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, FilePath, field_validator, model_validator
from pydantic_settings import NoDecode

from app.http.settings import MIB, RequestSettings
from app.processors import usable_workers, worker_memory_bytes
from app.review.decisions import read_tolerated_errors
from services.contract.images import ImageLimits

FEWEST_SECRET_BYTES = 24
"""Of the secret that signs callbacks, as Standard Webhooks asks."""


class Settings(RequestSettings):
    """Each field is an environment variable with the same name in capitals (`port`: PORT)."""

    # Workers
    workers: int = Field(
        default_factory=usable_workers,
        ge=0,
        le=256,
        description="Worker processes; default: the processors that the service may use, also by its CPU quota, as far "
        "as its memory suffices. 0: all work is done by workers of other processes that share DATABASE_URL.",
    )
    queue_length: int = Field(
        default=16,
        ge=0,
        description="Requests that may wait for a worker; further requests get 503 `busy`.",
    )
    queue_timeout_s: float = Field(
        default=60.0, gt=0, description="A request that gets no worker within this time gets 503 `busy`."
    )
    job_timeout_s: float = Field(
        default=30.0,
        gt=0,
        description="Work that takes longer is stopped: 504 `timed-out`. Of several pages of /rectify each has this "
        "limit.",
    )
    mosaic_timeout_s: float = Field(
        default=120.0, gt=0, description="Time limit of a mosaic; eight photos of 3 megapixels take 18 s."
    )
    document_timeout_s: float = Field(
        default=300.0,
        gt=0,
        description="Time limit of several images, a TIFF file or a PDF. Text recognition takes most of it, 2 to 8 s "
        "a page.",
    )
    model_timeout_s: float = Field(
        default=120.0,
        gt=0,
        description="Time limit of initializing and of training a layout model, and of proposals.",
    )
    worker_memory_bytes: int = Field(
        default_factory=lambda settings: worker_memory_bytes(settings.get("workers", 1) or 1),
        ge=0,
        description="Address space of a worker (RLIMIT_AS); 0: no limit. Default: 4 GiB, or less where all workers "
        "would exceed the memory of the machine or of the control group.",
    )
    worker_resident_bytes: int = Field(
        default=1536 * MIB,
        ge=0,
        description="A worker that keeps more memory than this after a job is replaced; 0: no limit.",
    )
    jobs_per_worker: int = Field(default=200, ge=1, description="A worker is replaced after this many jobs.")

    # Jobs (`Prefer: respond-async`)
    job_ttl_s: int = Field(
        default=3600, ge=1, description="A job and its result are kept this long after its end."
    )
    job_lease_s: float = Field(
        default=15.0,
        ge=1,
        description="A job whose worker does not report for this long is given to another worker.",
    )
    max_jobs: int = Field(
        default=1000,
        ge=1,
        description="Most unfinished jobs; further ones get 503 `busy`. Most jobs that are kept: over the limit, those "
        "that ended first are removed.",
    )
    max_jobs_per_key: int = Field(
        default=0, ge=0, description="Most unfinished jobs of one API key; 0: half of MAX_JOBS."
    )
    max_job_input_bytes: int = Field(
        default=4096 * MIB,
        ge=1024,
        description="Uploads of all unfinished jobs together; over it: 503 `busy`.",
    )
    max_job_result_bytes: int = Field(
        default=512 * MIB,
        ge=1024,
        description="Results of all jobs together; over the limit, the oldest are removed.",
    )
    callback_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Comma-separated hosts that `callback_url` of a job may name (hooks.example.org, *.example.org; *: "
        "any host of the internet). Needs CALLBACK_SECRET.",
    )
    callback_internal_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Those of CALLBACK_HOSTS, by name, that may have addresses of the own network.",
    )
    callback_secret: str = Field(
        default="",
        description="Secret by which callbacks are signed (Standard Webhooks): whsec_ and at least 24 bytes in base64.",
        repr=False,
    )
    max_job_listeners: int = Field(
        default=100,
        ge=1,
        description="Most clients that listen to events of jobs; further ones get 503 `busy`.",
    )

    # OCR and content features
    ocr_languages: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Comma-separated languages that requests may ask for, by Tesseract's names (eng,deu,fra); the "
        "first one is read where a request names none. Default: what is installed, English first.",
    )
    content_features: FilePath | None = Field(
        default=None,
        description="Settings file of content features (word lists and patterns); it overrides the built-in ones.",
    )

    # Store
    data_dir: Path = Field(
        default=Path("data"),
        description="Folder of the database of layout models, samples, feedback and results; created if missing.",
    )
    database_url: str = Field(
        default="",
        description="PostgreSQL database (postgresql://user:password@host/name, in UTF-8), used instead of the "
        "file layout.sqlite3 in DATA_DIR; several services may share it.",
        repr=False,
    )
    blob_url: str = Field(
        default="",
        description="Bucket of uploads and answers of jobs (s3://bucket/prefix, gs://..., az://...), used instead of "
        "the folder DATA_DIR/blobs; services on several machines need one. Credentials: AWS_ACCESS_KEY_ID, "
        "AWS_SECRET_ACCESS_KEY, AWS_ENDPOINT_URL, and so on.",
        repr=False,
    )
    store_timeout_s: float = Field(
        default=20.0,
        gt=0,
        description="A call of the store that takes longer ends as 503 `store-unavailable`.",
    )
    min_free_disk_bytes: int = Field(
        default=256 * MIB,
        ge=0,
        description="Least free space of DATA_DIR and of the folder for temporary files; /health/ready reports when "
        "there is less.",
    )
    max_models: int = Field(default=200, ge=1, description="Most layout models.")
    max_samples_per_model: int = Field(default=1000, ge=1, description="Most samples of one layout model.")
    result_ttl_s: int = Field(
        default=86400, ge=1, description="A result of /layout, or a kept photo, is kept this long."
    )
    max_results: int = Field(
        default=10_000,
        ge=1,
        description="Most results, and most kept photos; over the limit, the oldest are removed.",
    )

    camera_memory: bool = Field(
        default=True,
        description="Remember the focal lengths that pages show, by camera; false: neither keep nor use them.",
    )
    keep_images: bool = Field(
        default=False,
        description="Keep the pictures of pages with results of /layout; `keep_image` of a request overrides it.",
    )
    max_kept_image_bytes: int = Field(
        default=2 * MIB,
        ge=16_384,
        description="Largest picture of a page that is kept; larger ones are reduced.",
    )
    max_kept_images_bytes: int = Field(
        default=2048 * MIB,
        ge=0,
        description="Pictures of all pages together; over the limit, the oldest are removed.",
    )

    keep_photos: bool = Field(
        default=False,
        description="Keep the photos of /rectify with what later answers need (/pages); `keep_photo` of a request "
        "overrides it. KEEP_IMAGES never means them.",
    )
    max_kept_photos_bytes: int = Field(
        default=4096 * MIB,
        ge=0,
        description="Kept photos of all pages together, with what is kept beside them; over the limit, the oldest are "
        "removed.",
    )

    upload_ttl_s: int = Field(
        default=86400, ge=1, description="An upload in pieces is kept this long, from its beginning."
    )
    max_kept_uploads: int = Field(
        default=1000, ge=1, description="Most uploads in pieces that are kept; further ones get 503 `busy`."
    )
    max_kept_uploads_per_key: int = Field(
        default=0, ge=0, description="Most of them of one API key; 0: half of MAX_KEPT_UPLOADS."
    )
    max_kept_uploads_bytes: int = Field(
        default=4096 * MIB,
        ge=1024,
        description="All of them together, by the lengths that they will have; over it: 503 `busy`.",
    )

    max_sample_images_bytes: int = Field(
        default=2048 * MIB,
        ge=0,
        description="Images of all samples together, kept to measure the samples again (`python -m app remeasure`); "
        "over the limit, the oldest are removed. 0: none is kept.",
    )

    tolerated_errors: Annotated[Mapping[str, float], NoDecode] = Field(
        default={"*": 0.01},
        description="Comma-separated shares of wrong zones that may go through without a person: for all classes "
        "(0.01), a class (letter=0.02) or a label of it (letter/date=0.005).",
    )
    claim_ttl_s: int = Field(
        default=600, ge=1, description="A page of the review queue stays claimed for this long."
    )
    review_ahead: int = Field(
        default=50,
        ge=0,
        description="So many pages of each class, the first of the review queue, are recognized again after the class "
        "has learned, to put them in order; 0: none.",
    )
    max_unknown_pages: int = Field(
        default=200,
        ge=1,
        description="Most unknown pages that are kept, to propose new classes; the oldest are removed first.",
    )
    unknown_ttl_s: int = Field(
        default=30 * 86400,
        ge=1,
        description="Unknown pages are kept this long: a new class of documents may need weeks to show.",
    )

    @property
    def has_keys(self) -> bool:
        """Whether requests need an API key."""
        return bool(self.api_keys or self.api_keys_file)

    @property
    def most_jobs_per_key(self) -> int:
        """Most unfinished jobs of one API key, or of all callers where there are no keys."""
        if not self.has_keys:
            return self.max_jobs
        return self.max_jobs_per_key or max(1, self.max_jobs // 2)

    @property
    def most_uploads_per_key(self) -> int:
        """Most uploads in pieces of one API key, or of all callers where there are no keys."""
        if not self.has_keys:
            return self.max_kept_uploads
        return self.max_kept_uploads_per_key or max(1, self.max_kept_uploads // 2)

    @property
    def largest_upload(self) -> tuple[int, str]:
        """Most bytes of an upload in pieces, and the setting behind it: the largest body that can take its id."""
        names = ("max_upload_bytes", "max_document_upload_bytes", "max_mosaic_upload_bytes")
        return max((int(getattr(self, name)), name.upper()) for name in names)

    @property
    def image_limits(self) -> ImageLimits:
        """Limits of one uploaded image."""
        return ImageLimits(
            max_megapixels=self.max_megapixels,
            max_exif_bytes=self.max_exif_bytes,
            max_bytes=self.max_upload_bytes,
        )

    @field_validator(
        "api_keys",
        "cors_origins",
        "ocr_languages",
        "callback_hosts",
        "callback_internal_hosts",
        mode="before",
    )
    @classmethod
    def _split(cls, value: object) -> object:
        if isinstance(value, str):
            return tuple(key.strip() for key in value.split(",") if key.strip())
        return value

    @field_validator("api_keys", mode="before")
    @classmethod
    def _require_a_key(cls, value: object) -> object:
        if isinstance(value, str) and not value.strip(", \t\r\n"):
            raise ValueError(
                "it is set and holds no key, and without keys everybody could use the service: add a key, or unset it "
                "to run an open service"
            )
        return value

    @model_validator(mode="after")
    def _check_callbacks(self) -> Self:
        if not self.callback_hosts:
            return self
        try:
            secret = base64.b64decode(self.callback_secret.removeprefix("whsec_"), validate=True)
        except ValueError:
            secret = b""
        if len(secret) < FEWEST_SECRET_BYTES:
            raise ValueError("CALLBACK_HOSTS needs CALLBACK_SECRET: whsec_ and at least 24 bytes in base64")
        return self

    @field_validator("tolerated_errors", mode="before")
    @classmethod
    def _read_shares(cls, value: object) -> object:
        return read_tolerated_errors(value) if isinstance(value, str) else value

    @field_validator("tolerated_errors")
    @classmethod
    def _possible_shares(cls, value: Mapping[str, float]) -> Mapping[str, float]:
        for name, share in value.items():
            if not 0.0 < share <= 1.0:
                raise ValueError(f"the share of {name} must be above 0 and at most 1")
        return value
