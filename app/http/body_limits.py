"""The limit of every path's request body: forms are spooled to the disk, every other body is kept in memory, but
for pieces of uploads."""

from collections.abc import Mapping
from dataclasses import replace

from app.http.json_bodies import MOST_BYTES
from app.http.paths import MOSAIC_PATHS, RECTIFY_PATHS
from app.http.uploads import BodyLimits
from app.settings import Settings

SPARE_BYTES = 65_536
"""Bytes over the limit of a field that are still read, so that the route's error can name the field."""
_ESCAPED = 3
"""A form that is not multipart has three characters for one."""


def body_limits_of(settings: Settings) -> tuple[BodyLimits, Mapping[str, BodyLimits]]:
    """The limits of a path without a form, and those of the paths that accept more than that.

    Paths without a form accept a small JSON body. Only a path that reads `multipart/form-data` accepts an upload.
    """
    plain = BodyLimits(
        max_upload_bytes=MOST_BYTES,
        max_plain_bytes=MOST_BYTES,
        body_timeout_s=settings.body_timeout_s,
        min_body_bytes_per_s=settings.min_body_bytes_per_s,
        max_drain_bytes=settings.max_drain_bytes,
        drain_timeout_s=settings.drain_timeout_s,
        size_setting="",
        plain_setting="",
    )
    zones_bytes = settings.max_zones_bytes + SPARE_BYTES
    zones = replace(
        plain,
        max_upload_bytes=zones_bytes,
        max_plain_bytes=zones_bytes,
        size_setting="MAX_ZONES_BYTES",
        plain_setting="MAX_ZONES_BYTES",
    )
    model = replace(
        plain,
        max_upload_bytes=settings.max_model_bytes,
        max_plain_bytes=settings.max_model_bytes,
        size_setting="MAX_MODEL_BYTES",
        plain_setting="MAX_MODEL_BYTES",
    )
    photo = replace(plain, max_upload_bytes=settings.max_upload_bytes, size_setting="MAX_UPLOAD_BYTES")
    archive = replace(
        photo, max_upload_bytes=settings.max_document_upload_bytes, size_setting="MAX_DOCUMENT_UPLOAD_BYTES"
    )
    rectify = replace(
        plain,
        max_upload_bytes=max(settings.max_document_upload_bytes, settings.max_upload_bytes),
        size_setting="MAX_DOCUMENT_UPLOAD_BYTES",
    )
    mosaic = replace(
        photo, max_upload_bytes=settings.max_mosaic_upload_bytes, size_setting="MAX_MOSAIC_UPLOAD_BYTES"
    )
    largest_bytes, setting = settings.largest_upload
    piece = replace(plain, max_plain_bytes=largest_bytes, plain_setting=setting)
    return plain, {
        "/uploads/{id}": piece,
        **dict.fromkeys(RECTIFY_PATHS, rectify),
        **dict.fromkeys(MOSAIC_PATHS, mosaic),
        "/layout": replace(
            zones,
            max_upload_bytes=settings.max_document_upload_bytes,
            max_plain_bytes=_ESCAPED * zones_bytes,
            size_setting="MAX_DOCUMENT_UPLOAD_BYTES",
        ),
        "/layout/models/{name}": model,
        "/layout/models/{name}/samples": replace(
            zones, max_upload_bytes=settings.max_upload_bytes, size_setting="MAX_UPLOAD_BYTES"
        ),
        "/layout/models/{name}/samples/archive": archive,
        "/layout/import": archive,
        "/layout/results/{id}/feedback": zones,
    }
