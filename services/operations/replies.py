"""What replies of all kinds have: facts of the upload, descriptions of turns and warnings, timings."""

import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, cast, get_args

import numpy as np

from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.page import Orientation, Warning
from services.contract.answers.rectify import RectifyResult
from services.contract.images import MEDIA_TYPES, Encoding, PagesFormat
from services.contract.rectify import Rotation
from services.documents.searchable_pdf import PdfFacts, finish_pdf
from services.imaging.codec import OutputFormat, UploadFormat
from services.notices import Notice
from services.ocr.languages import language_tag
from services.operations.page_reading import describe_text
from services.progress import report_progress
from services.rectify.results import Orientation as TurnedView
from services.text.page_text import PageText

ENCODING_BEGINS = 0.95
"""Typical progress before encoding."""


@dataclass(frozen=True, slots=True)
class SourceFacts:
    """Properties of the upload that the page keeps: format, resolution, and colour profile."""

    format: UploadFormat
    dpi: float | None
    icc_profile: bytes | None


def finished_pdf(
    pdf: bytes, texts: Sequence[PageText | None], encoding: Encoding, dpis: Sequence[float]
) -> bytes:
    """The PDF with the text of its pages, if they were read, its title and language, in its version.

    `texts` and `dpis` have one entry for every page.
    """
    read = [text for text in texts if text is not None]
    tag = language_tag(read[0].language) if read else ""
    return finish_pdf(pdf, texts, PdfFacts(encoding.title, tag, encoding.pdf_version), dpis)


def image_format_of(source: SourceFacts, asked: PagesFormat | None) -> OutputFormat:
    """Format of a page's image: `asked`, or the format of the upload (JPEG for HEIC)."""
    if asked in get_args(OutputFormat):
        return cast(OutputFormat, asked)
    return "jpeg" if source.format == "heic" else source.format


def show_page(
    answer: RectifyResult | MosaicResult,
    embedded: str | None,
    image_format: OutputFormat,
    text: PageText | None,
) -> None:
    """Put the picture of a page, in base64, and its text into its answer."""
    answer.text = None if text is None else describe_text(text)
    answer.image = embedded
    answer.image_media_type = None if embedded is None else MEDIA_TYPES[image_format]


def describe_orientation(orientation: TurnedView, photo_rotation_deg: float | None) -> Orientation:
    """The `orientation` of an answer; the second turn is that against the only photo, None of a mosaic."""
    return Orientation(
        rotation_deg=cast(Rotation, orientation.rotation_deg),
        mirrored=orientation.mirrored,
        confidence=rounded(orientation.confidence),
        photo_rotation_deg=None if photo_rotation_deg is None else round(photo_rotation_deg, 1) % 360,
    )


def describe_warnings(notices: Iterable[Notice]) -> list[Warning]:
    """The `warnings` of an answer."""
    return [Warning(code=notice.code, detail=notice.detail) for notice in notices]


def describe_timings(timings_ms: Mapping[str, float]) -> dict[str, float]:
    """The `timings_ms` of an answer."""
    return {stage: round(value, 1) for stage, value in timings_ms.items()}


def rounded(value: float | None, decimals: int = 4) -> float | None:
    """A number without the decimals that mean nothing; None where there is no finite one."""
    return None if value is None or not math.isfinite(value) else round(float(value), decimals)


def to_json_ready(value: Any) -> Any:
    """`value` in JSON types; NaN and infinite numbers become None."""
    if isinstance(value, dict):
        return {str(key): to_json_ready(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_json_ready(item) for item in value]
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        # A page's mesh holds thousands of numbers: no Python call for each of them.
        finite = np.isfinite(value)
        return (
            value.tolist()
            if finite.all()
            else np.where(finite, value.astype(object), np.array(None)).tolist()
        )
    if isinstance(value, np.ndarray | np.generic):
        return to_json_ready(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


@contextmanager
def timed(stage: str, timings_ms: dict[str, float], begins: float | None = None) -> Iterator[None]:
    """Put the time of the block into `timings_ms`, and report the progress `begins` (0-1) at its start."""
    if begins is not None:
        report_progress(stage, begins)
    started = time.perf_counter()
    yield
    timings_ms[stage] = (time.perf_counter() - started) * 1000
