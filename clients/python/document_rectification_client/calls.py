"""Operations of the service: what is sent, and how the answer is read. Both clients send these."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, Unpack

import httpx

from document_rectification_client.models import (
    DocumentResult,
    LayoutOptions,
    LayoutResult,
    MosaicOptions,
    PlainMosaicResult,
    PlainPagesResult,
    RectifyOptions,
    StackResult,
)
from document_rectification_client.reading import read

Answer = TypeVar("Answer")


@dataclass(frozen=True, slots=True)
class Upload:
    """A file that the service has already (`Client.upload`); it stands for a photo, in any number of calls."""

    id: str


Content = str | os.PathLike[str] | bytes
"""A path, or the bytes of a file."""
Photo = Content | Upload
Part = tuple[str, tuple[str | None, bytes]]
"""Name of a part of a form, name of its file (None: it is a field), and its content."""


@dataclass(frozen=True, slots=True)
class File:
    """A file that the service made."""

    content: bytes
    media_type: str
    warnings: tuple[str, ...]
    """Codes of the warnings of all pages."""
    failed: tuple[str, ...]
    """Pages that it leaves out, and why: `3 no-text`."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file. What was there stays until the new one is whole."""
        part = Path(f"{os.fspath(path)}.part")
        part.write_bytes(self.content)
        part.replace(path)


@dataclass(frozen=True, slots=True)
class Call(Generic[Answer]):
    """One operation with its photos and options."""

    path: str
    files: tuple[Part, ...]
    fields: Mapping[str, str]
    read: Callable[[httpx.Response], Answer]


def flatten(photos: Sequence[Photo], format: str = "pdf", **options: Unpack[RectifyOptions]) -> Call[File]:
    """Photos of pages as one file of flat pages.

    Raises
    ------
    OSError
        When a photo cannot be read.
    """
    return Call("/rectify", _files("image", photos), _fields({**options, "format": format}), read_file)


def flatten_pages(photos: Sequence[Photo], **options: Unpack[RectifyOptions]) -> Call[PlainPagesResult]:
    """What is known of the flat pages of the photos."""
    return Call("/rectify/pages", _files("image", photos), _fields(options), _reader(PlainPagesResult))


def mosaic(photos: Sequence[Photo], format: str = "pdf", **options: Unpack[MosaicOptions]) -> Call[File]:
    """Overlapping photos of one page as one file of the whole page."""
    return Call("/mosaic", _files("images", photos), _fields({**options, "format": format}), read_file)


def mosaic_page(photos: Sequence[Photo], **options: Unpack[MosaicOptions]) -> Call[PlainMosaicResult]:
    """What is known of the whole page that overlapping photos show."""
    return Call("/mosaic/json", _files("images", photos), _fields(options), _reader(PlainMosaicResult))


def layout(
    images: Sequence[Photo] = (), **options: Unpack[LayoutOptions]
) -> Call[LayoutResult | DocumentResult | StackResult]:
    """Class and labels of a page; of several images, of the document and of its pages; with `split`, of a stack."""
    return Call("/layout", _files("image", images), _fields({**options, "format": "json"}), _read_layout)


def read_file(response: httpx.Response) -> File:
    """The file in the answer."""
    headers = response.headers
    media_type = headers.get("content-type", "").partition(";")[0]
    return File(
        response.content,
        media_type,
        _listed(headers.get("Document-Warnings", "")),
        _listed(headers.get("Document-Failed", "")),
    )


def _read_layout(response: httpx.Response) -> LayoutResult | DocumentResult | StackResult:
    document = response.json()
    if "documents" in document:
        return read(StackResult, document)
    return read(DocumentResult, document) if "pages" in document else read(LayoutResult, document)


def _reader(model: type[Answer]) -> Callable[[httpx.Response], Answer]:
    return lambda response: read(model, response.json())


def _listed(header: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in header.split(",") if part.strip())


def part_of(upload: Upload) -> Part:
    """How a form names an upload."""
    return "upload", (None, upload.id.encode())


def _files(part: str, photos: Sequence[Photo]) -> tuple[Part, ...]:
    if isinstance(photos, (str, bytes, os.PathLike, Upload)):
        photos = [photos]
    return tuple(
        part_of(photo) if isinstance(photo, Upload) else (part, named(photo, number))
        for number, photo in enumerate(photos, 1)
    )


def named(photo: Content, number: int = 1) -> tuple[str, bytes]:
    """Name and content of a file."""
    if isinstance(photo, bytes):
        return f"photo-{number}", photo
    path = Path(photo)
    return path.name, path.read_bytes()


def _fields(options: Mapping[str, Any]) -> dict[str, str]:
    return {name: _text(value) for name, value in options.items() if value is not None}


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
