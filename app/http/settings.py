"""Settings of the server, of API keys, and the limits of a request."""

from typing import Annotated

from pydantic import Field, FilePath
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

MIB = 1024 * 1024


class RequestSettings(BaseSettings):
    """What the server and every request need; `app.settings` has the rest."""

    # Inputs have secrets: an error says which setting is wrong, not what it is.
    model_config = SettingsConfigDict(frozen=True, extra="ignore", hide_input_in_errors=True)

    # Server
    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(default=8000, ge=0, le=65535, description="Port to listen on; 0 takes a free one.")
    tls_certificate: FilePath | None = Field(
        default=None, description="PEM file of a certificate with its key; if set, the service speaks HTTPS."
    )
    keep_alive_s: int = Field(default=30, ge=1, description="An idle connection is closed after this long.")
    shutdown_grace_s: int = Field(
        default=30, ge=0, description="After SIGTERM, requests in progress may take this long to finish."
    )
    root_path: str = Field(
        default="",
        pattern="^(/[A-Za-z0-9._~-]+)*$",
        description="Prefix of all paths behind a proxy, for example /documents. Paths in responses begin with it.",
    )
    cors_origins: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Comma-separated origins (https://app.example.org) whose browser apps may use the service; *: all.",
    )
    log_level: str = Field(
        default="INFO", pattern="^(DEBUG|INFO|WARNING|ERROR)$", description="Lowest level that is logged."
    )

    # Authentication
    api_keys: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Comma-separated keys; if set, a request must send one of them as X-API-Key or as "
        "Authorization: Bearer (except to /, /health, /metrics, /docs).",
        repr=False,
    )
    api_keys_file: FilePath | None = Field(
        default=None,
        description="File of further keys with names and roles, a line each: NAME ROLE DIGEST (reader, verifier, "
        "admin); `python -m app.roles NAME ROLE` makes a key and its line. A changed file counts within 5 s, and on "
        "SIGHUP.",
    )
    token_ttl_s: int = Field(
        default=300, ge=1, le=86400, description="A token of POST /tokens allows to read for this long."
    )

    # Limits of a request
    max_upload_bytes: int = Field(
        default=32 * MIB,
        ge=1024,
        description="Largest photo of /rectify, and largest request body of paths without a limit of their own.",
    )
    max_mosaic_upload_bytes: int = Field(
        default=160 * MIB, ge=1024, description="Largest request body of /mosaic: 16 photos of 10 MiB."
    )
    max_megapixels: float = Field(default=64.0, gt=0, description="Largest image, checked in its header.")
    max_mosaic_megapixels: float = Field(
        default=200.0,
        gt=0,
        description="All photos of a mosaic together, checked in their headers: 16 of 12 megapixels. "
        "They are in memory at the same time, 3 bytes a pixel.",
    )
    max_document_upload_bytes: int = Field(
        default=96 * MIB,
        ge=1024,
        description="Largest request body of /layout and /rectify: 20 scans of 4.8 MiB.",
    )
    max_pages: int = Field(default=20, ge=1, description="Most pages of a document.")
    max_stack_pages: int = Field(
        default=60,
        ge=1,
        description="Most pages of a stack (`split=true`). Each may have the megapixels and take the time that the "
        "limits of a document leave each of MAX_PAGES.",
    )
    max_document_megapixels: float = Field(
        default=200.0,
        gt=0,
        description="All pages of a document together, checked before the first is decoded: 20 of A4 at 300 dpi are "
        "174. One page is in memory at a time.",
    )
    max_zones: int = Field(
        default=500, ge=1, description="Most zones of a page; a dense newspaper page has about 300."
    )
    max_zones_bytes: int = Field(
        default=2 * MIB, ge=1024, description="Largest description of a page's zones as JSON: 4 KiB a zone."
    )
    max_zones_file_bytes: int = Field(
        default=8 * MIB,
        ge=1024,
        description="Largest PAGE-XML or ALTO description; it may contain every word.",
    )
    max_model_bytes: int = Field(
        default=8 * MIB, ge=1024, description="Largest layout model that is imported."
    )
    max_archive_bytes: int = Field(
        default=1024 * MIB,
        ge=1024,
        description="All files of a ZIP archive together when they are inflated: JSON becomes ten times as large, so "
        "that an archive of 96 MiB may need this.",
    )
    max_exif_bytes: int = Field(default=256 * 1024, ge=0, description="Largest EXIF block.")
    body_timeout_s: float = Field(
        default=60.0, gt=0, description="A request body must have arrived within this long."
    )
    min_body_bytes_per_s: float = Field(
        default=8192.0,
        gt=0,
        description="Least mean rate of a request body after its first 5 s; a slower one gets 408.",
    )
    max_uploads: int = Field(
        default=64,
        ge=1,
        description="Request bodies that may arrive at once; further ones get 503 `busy`. A request takes its place in "
        "the queue when its body is there.",
    )
    max_drain_bytes: int = Field(
        default=256 * MIB,
        ge=0,
        description="Largest part of a refused body that is still read and discarded, so that a client that sends "
        "first and reads later receives the refusal.",
    )
    drain_timeout_s: float = Field(
        default=30.0, gt=0, description="A refused body is read for at most this long."
    )
