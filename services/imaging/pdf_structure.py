"""Structure of a PDF page, checked before the page is drawn: a kilobyte can describe years of drawing.

A content stream may be compressed several times over, and a form may draw other forms, each twice. The check inflates
the content of one page under a limit, and counts the bytes that drawing reads when every form is drawn as often as the
content says. It takes time in proportion to the inflated bytes. What it does not see (an expensive shading, a stroke of
a million dashes) is left to the time limit of the process that draws.
"""

import re
import zlib
from collections import Counter
from dataclasses import dataclass
from typing import Any

import pikepdf

from services.errors import TooLarge, UndecodableImage
from services.imaging.containers import INFLATED_AT_ONCE

_DRAWN_NAME = re.compile(rb"/([^\s/<>\[\](){}%]+)\s+Do(?=[\s/<>\[\](){}%]|$)")
"""Operator that draws a form or an image (ISO 32000-1, 8.8)."""
_ESCAPE = re.compile(rb"#([0-9A-Fa-f]{2})")
_FLATE = ("/FlateDecode", "/Fl")
_BYTES_OF_A_FORM = 1024
"""Drawing a form costs at least as much as this number of bytes of content: a million empty ones take 1 GB and 5 s."""


@dataclass(frozen=True, slots=True)
class StructureLimits:
    """Limits of one page of a PDF."""

    max_content_bytes: int = 64 * 2**20
    """Content streams of a page, inflated. The densest maps and drawings have 30 MB."""
    max_drawn_bytes: int = 256 * 2**20
    """The same with each form counted as often as it is drawn: 5 s of drawing, or 260,000 symbols of a map."""
    max_form_depth: int = 24
    """Depth of forms within forms. Files that several programs have embedded in turn reach 8."""
    max_filters: int = 4
    """Filters of one stream. Writers use 1, or 2 with an ASCII filter."""


def check_page(page: pikepdf.Page, limits: StructureLimits) -> None:
    """Check the content of a page, of its forms, patterns and annotations.

    Raises
    ------
    TooLarge
        When a limit is exceeded.
    UndecodableImage
        When a form draws itself, which PDF does not allow (ISO 32000-1, 8.10.1).
    """
    check = _Check(limits)
    resources = _dictionary(page.obj, "/Resources", inherited=True)
    contents = page.obj.get("/Contents")
    streams = list(contents) if isinstance(contents, pikepdf.Array) else [contents]
    data = b"\n".join(check.content_of(stream) for stream in streams if isinstance(stream, pikepdf.Stream))
    drawn = check.bytes_drawn(data, resources, 0)
    annotations = page.obj.get("/Annots")
    for annotation in annotations if isinstance(annotations, pikepdf.Array) else ():
        if isinstance(annotation, pikepdf.Dictionary):
            normal = _dictionary(annotation, "/AP").get("/N")
            drawn += check.bytes_of_form(normal, resources, 0)
    check.hold(drawn)


class _Check:
    """Counts of one page. Forms are counted once each, so that exponential nesting costs no time here."""

    def __init__(self, limits: StructureLimits) -> None:
        self._limits = limits
        self._inflated_bytes = 0
        self._drawn_by_form: dict[tuple[int, int], int] = {}
        self._open: set[tuple[int, int]] = set()  # forms that are being counted

    def hold(self, drawn: int) -> int:
        """The number, if it is within the limit."""
        if drawn > self._limits.max_drawn_bytes:
            raise TooLarge(
                "The PDF's page draws its forms too often: together more than "
                f"{self._limits.max_drawn_bytes} bytes of content. Send the page as an image."
            )
        return drawn

    def content_of(self, stream: pikepdf.Stream) -> bytes:
        """The stream without its Flate filters; up to its first other filter."""
        filters = stream.stream_dict.get("/Filter")
        names = [str(name) for name in filters] if isinstance(filters, pikepdf.Array) else []
        names = [str(filters)] if isinstance(filters, pikepdf.Name) else names
        if len(names) > self._limits.max_filters:
            raise TooLarge(
                f"A stream of the PDF has {len(names)} filters; the limit is {self._limits.max_filters}. "
                "Send the page as an image."
            )
        data = stream.read_raw_bytes()
        for name in names:
            if name not in _FLATE:
                break
            data = self._inflate(data)
        return data

    def _inflate(self, packed: bytes) -> bytes:
        """Inflated data; of damaged data what comes before the damage."""
        inflate, parts = zlib.decompressobj(), []
        while packed and not inflate.eof:
            try:
                part = inflate.decompress(packed, INFLATED_AT_ONCE)
            except zlib.error:
                break
            parts.append(part)
            packed = inflate.unconsumed_tail
            self._inflated_bytes += len(part)
            if self._inflated_bytes > self._limits.max_content_bytes:
                raise TooLarge(
                    "The content of the PDF's page has more than "
                    f"{self._limits.max_content_bytes} bytes when it is inflated. Send the page as an image."
                )
        return b"".join(parts)

    def bytes_drawn(self, data: bytes, resources: Any, depth: int) -> int:
        """Bytes that drawing reads for this content and everything that it draws."""
        drawn = len(data)
        names = Counter(_DRAWN_NAME.findall(data))
        xobjects = _dictionary(resources, "/XObject")
        for name, times in names.items():
            drawn += times * self.bytes_of_form(xobjects.get(_key(name)), resources, depth + 1)
        patterns = _dictionary(resources, "/Pattern")
        if b"scn" in data.lower():
            for pattern in patterns.values():
                drawn += self.bytes_of_form(pattern, resources, depth + 1)
        return self.hold(drawn)

    def bytes_of_form(self, form: Any, resources: Any, depth: int) -> int:
        """Bytes that a form or a tiling pattern draws; 0 of anything else."""
        if not isinstance(form, pikepdf.Stream) or form.stream_dict.get("/Subtype") == pikepdf.Name.Image:
            return 0
        if depth > self._limits.max_form_depth:
            raise TooLarge(
                f"The forms of the PDF's page are nested deeper than {self._limits.max_form_depth}. "
                "Send the page as an image."
            )
        identity = form.objgen
        if identity in self._open:
            raise UndecodableImage("The PDF is damaged: one of its forms draws itself.")
        if identity not in self._drawn_by_form:
            self._open.add(identity)
            own = _dictionary(form.stream_dict, "/Resources") or resources
            drawn = self.bytes_drawn(self.content_of(form), own, depth)
            self._drawn_by_form[identity] = drawn + _BYTES_OF_A_FORM
            self._open.discard(identity)
        return self._drawn_by_form[identity]


def _key(name: bytes) -> str:
    plain = _ESCAPE.sub(lambda found: bytes([int(found[1], 16)]), name)
    return "/" + plain.decode("utf-8", "replace")


def _dictionary(parent: Any, key: str, inherited: bool = False) -> Any:
    """A dictionary of `parent`, or of the nodes above it in the tree of pages; empty if there is none."""
    for _ in range(64):
        found = parent.get(key)
        if isinstance(found, pikepdf.Dictionary):
            return found
        parent = parent.get("/Parent") if inherited else None
        if not isinstance(parent, pikepdf.Dictionary):
            break
    return pikepdf.Dictionary()
