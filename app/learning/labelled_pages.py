"""Labelled pages in requests: their upload, their limits, and counts of their labels."""

from collections import Counter
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass

from fastapi import Request
from starlette.datastructures import FormData, UploadFile

from app.http.body_limits import SPARE_BYTES
from app.http.ocr_languages import chosen_language
from app.settings import Settings
from services.contract.images import DocumentLimits
from services.contract.layout import LayoutSettings
from services.contract.page_json import PageJson
from services.errors import DocumentError, InvalidOption, TooLarge

LABELLED_PAGE_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"$ref": "#/components/schemas/PageBody"}},
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "title": "SampleForm",
                    "anyOf": [{"required": ["zones"]}, {"required": ["zones_file"]}],
                    "additionalProperties": False,
                    "properties": {
                        "image": {
                            "type": "string",
                            "format": "binary",
                            "description": "The page; missing properties of zones are measured and read in it.",
                        },
                        "zones": {
                            "type": "string",
                            "contentMediaType": "application/json",
                            "description": "The JSON above, as a field or as a file; or",
                        },
                        "zones_file": {
                            "type": "string",
                            "format": "binary",
                            "description": "The labelled zones as a file of PAGE-XML, ALTO or JSON.",
                        },
                    },
                }
            },
        },
    }
}


class MissingPart(DocumentError):
    """The request lacks a required part."""

    code = "bad-request"


@dataclass(frozen=True, slots=True)
class LabelledPageUpload:
    """An uploaded labelled page, for a worker to read; its zones are JSON, or in any format as `zones_file`."""

    image: UploadFile | None
    zones: UploadFile | bytes | None
    zones_file: UploadFile | None = None


def layout_settings(settings: Settings) -> LayoutSettings:
    """Limits of a page, and settings of its recognition."""
    return LayoutSettings(
        document=DocumentLimits(settings.image_limits, settings.max_pages, settings.max_document_megapixels),
        max_zones=settings.max_zones,
        max_zones_file_bytes=settings.max_zones_file_bytes,
        content_features=settings.content_features,
        language=chosen_language(None, settings),
    )


def zones_upload(part: UploadFile | str | None, field: str, max_bytes: int) -> UploadFile | bytes | None:
    """An uploaded description of zones, for a worker to read.

    Raises
    ------
    TooLarge
        When the description has more than `max_bytes`.
    """
    data = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
    if data is not None:
        _check_size((data.size or 0) if isinstance(data, UploadFile) else len(data), field, max_bytes)
    return data


@asynccontextmanager
async def labelled_page(request: Request, settings: Settings) -> AsyncIterator[LabelledPageUpload]:
    """The labelled page in the request's body, JSON or a form. Its files are open inside the block.

    Raises
    ------
    MissingPart, InvalidOption, TooLarge
        When the body is neither, or its content is not valid.
    """
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type == "application/json":
        body = await request.body()
        _check_size(len(body), "zones", settings.max_zones_bytes)
        yield LabelledPageUpload(None, body)
    elif media_type == "multipart/form-data":
        most = settings.max_zones_bytes + SPARE_BYTES
        async with request.form(max_files=8, max_fields=50, max_part_size=most) as form:
            yield _parts(form, settings)
    else:
        raise MissingPart(
            "Send the labelled page as application/json, or as multipart/form-data with `zones` or `zones_file`."
        )


def _parts(form: FormData, settings: Settings) -> LabelledPageUpload:
    parts: dict[str, UploadFile | str] = {}
    for name, part in form.multi_items():
        if name not in {"image", "zones", "zones_file"}:
            raise InvalidOption(
                f"{name[:80]}: there is no such part; send the page as `image`, its labelled zones as `zones`.",
                name[:80],
            )
        if name in parts:
            raise InvalidOption(f"{name}: this part was sent more than once; send it once.", name)
        if part != "":  # an empty field of a form counts as absent
            parts[name] = part
    image, file = parts.get("image"), parts.get("zones_file")
    for name, given in (("image", image), ("zones_file", file)):
        if isinstance(given, str):
            raise MissingPart(f"{name}: this part must be a file (with a filename).", name)
    zones = zones_upload(parts.get("zones"), "zones", settings.max_zones_bytes)
    zones_upload(file, "zones_file", settings.max_zones_file_bytes)
    if zones is None and file is None:
        raise MissingPart("zones: send the labelled zones as JSON, or as `zones_file`.", "zones")
    if zones is not None and file is not None:
        raise InvalidOption("zones_file: send either zones or zones_file, not both.", "zones_file")
    assert not isinstance(image, str), "checked above"
    assert not isinstance(file, str), "checked above"
    return LabelledPageUpload(image, zones, file)


async def read_upload(image: UploadFile) -> bytes:
    """All bytes of an upload, also after a worker has read it."""
    await image.seek(0)
    return await image.read()


def count_labels(documents: Iterable[PageJson]) -> dict[str, int]:
    """Number of zones of these pages with each label, most frequent first."""
    labels = Counter(
        label for page in documents for zone in page["zones"] if (label := zone.get("label")) is not None
    )
    return dict(labels.most_common())


def _check_size(size: int, field: str, max_bytes: int) -> None:
    if size > max_bytes:
        setting = "MAX_ZONES_FILE_BYTES" if field == "zones_file" else "MAX_ZONES_BYTES"
        raise TooLarge(
            f"{field}: a description of zones is limited to {max_bytes} bytes ({setting}); this one has {size}.",
            field,
        )
