"""The process that draws the pages of one PDF; `main` lists its arguments.

It reads requests from its standard input and writes replies to its standard output. Each message is two lengths (8
bytes each, big-endian), a header in JSON, and bytes. Replies are plain data: a file that takes over this process must
not reach the worker. `pdf_drawing` is the other side.

It does without NumPy, whose import was half of the start of this process, and each PDF has one.
"""

import io
import json
import math
import os
import resource
import struct
import sys
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from itertools import islice
from typing import IO, Any

import pikepdf
import pypdfium2
import pypdfium2.raw as pdfium

from services.errors import DocumentError, UndecodableImage
from services.imaging.pdf_structure import StructureLimits, check_page
from services.imaging.pdf_words import FORMS, MOST_LOOKED_AT, NOT_SHOWN, WordJson, has_other_print, words_of

LENGTHS = struct.Struct(">QQ")
MOST_HEADER_BYTES = 1 << 20
"""Largest header: 10,000 sizes of pages are 0.3 MB."""
_OPENING_S = 4
"""Processor time for opening a file: 64 MB take 0.5 s."""
_BEFORE_KILL_S = 2
"""From the signal that names the processor limit to the one that does not."""
MOST_USER_UNIT = 75_000.0
"""Points; with 14,400 units a side, more than any page."""
_PASSWORD_ERROR = 4  # FPDF_ERR_PASSWORD
_SHOWN = (pdfium.FPDF_PAGEOBJ_IMAGE, pdfium.FPDF_PAGEOBJ_TEXT)
_COVERED = 0.5
"""Share of a page from which on its images are a page."""
_PICTURE = 0.05
"""Text before an image of this share of the page may be under it."""
_FEW_CHARACTERS = 10
"""That show which way a page lies."""
_CHARACTERS = 200
"""More than scanning programs and publishers stamp on a page: 20 to 120."""


def write_message(
    stream: IO[bytes], header: Mapping[str, object], body: bytes | bytearray | memoryview = b""
) -> None:
    """Write one message."""
    packed = json.dumps(header).encode()
    stream.write(LENGTHS.pack(len(packed), len(body)))
    stream.write(packed)
    stream.write(body)
    stream.flush()


def read_message(stream: IO[bytes], most_bytes: int) -> tuple[dict[str, Any], bytes]:
    """The next message; raises `EOFError` when there is none, or when it is larger than `most_bytes`."""
    lengths = stream.read(LENGTHS.size)
    if len(lengths) < LENGTHS.size:
        raise EOFError
    header_bytes, body_bytes = LENGTHS.unpack(lengths)
    if header_bytes > MOST_HEADER_BYTES or body_bytes > most_bytes:
        raise EOFError
    header, body = stream.read(header_bytes), stream.read(body_bytes)
    if len(header) < header_bytes or len(body) < body_bytes:
        raise EOFError
    return json.loads(header), body


def allow_processor_time(seconds: int) -> None:
    """Let this process compute for so long from now; then the kernel ends it (SIGXCPU)."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    until = math.ceil(used.ru_utime + used.ru_stime) + seconds
    resource.setrlimit(resource.RLIMIT_CPU, (min(until, hard - _BEFORE_KILL_S), hard))


def serve(requests: IO[bytes], replies: IO[bytes], max_upload_bytes: int, page_s: int) -> None:
    """Answer requests until the other side closes. The first one opens the PDF, each later one draws a page.

    `page_s` is the processor time of one page, seconds.
    """
    with suppress(EOFError):
        header, data = read_message(requests, max_upload_bytes)
        allow_processor_time(_OPENING_S)
        try:
            document = _Document(data)
            sizes = document.sizes(header["most"])
        except DocumentError as error:
            write_message(replies, {"refused": error.code, "detail": error.detail})
            return
        write_message(replies, {"sizes": sizes})
        while True:
            header, _ = read_message(requests, 0)
            allow_processor_time(page_s)
            try:
                if "type" in header:
                    facts, words = document.look_for_type(header["type"])
                    write_message(replies, facts, json.dumps(words).encode())
                    continue
                bitmap = document.draw(header["page"], header["scale"])
            except DocumentError as error:
                write_message(replies, {"refused": error.code, "detail": error.detail})
                continue
            facts = {"rows": bitmap.height, "stride": bitmap.stride, "channels": bitmap.n_channels}
            write_message(replies, facts, memoryview(bitmap.buffer).cast("B"))
            bitmap.close()


class _Document:
    """A PDF, read by two libraries: one checks the structure, one draws."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._structure: pikepdf.Pdf | None = None
        try:
            self._document = pypdfium2.PdfDocument(data)
        except pypdfium2.PdfiumError as error:
            if error.err_code == _PASSWORD_ERROR:
                raise UndecodableImage("The PDF is encrypted: send it without its password.") from error
            raise UndecodableImage("The PDF is damaged, or has no page.") from error
        if self._document.get_formtype():
            self._document.init_forms()  # form fields that were filled in are drawn only after this call

    def sizes(self, most: int) -> list[tuple[float, float]]:
        """Width and height of each page in points, of at most `most` pages."""
        found = []
        for index in range(min(len(self._document), most)):
            try:
                width, height = self._document.get_page_size(index)
            except pypdfium2.PdfiumError as error:
                raise UndecodableImage(f"The PDF is damaged: its page {index + 1} cannot be read.") from error
            unit = self._user_unit(index)
            width, height = width * unit, height * unit
            if not (math.isfinite(width) and math.isfinite(height) and width > 0 and height > 0):
                raise UndecodableImage(f"The PDF is damaged: its page {index + 1} has no size.")
            found.append((width, height))
        return found

    def draw(self, index: int, scale: float) -> pypdfium2.PdfBitmap:
        """A page at `scale` pixels a point, if its structure is within the limits."""
        self._check(index)
        scale *= self._user_unit(index)
        try:
            return self._document[index].render(scale=scale, rev_byteorder=True)
        except pypdfium2.PdfiumError as error:
            raise UndecodableImage(f"The PDF is damaged: its page {index + 1} cannot be drawn.") from error

    def look_for_type(self, index: int) -> tuple[dict[str, object], list[WordJson]]:
        """What a page says of its type, and its words, none where they are not known.

        `turn` is the clockwise turn, degrees, after which it is upright by its text; None if it is not set in type: if
        it has little text, or images cover it and its text is not printed over them. Text that is not shown belongs to
        a scan. `pictures`: there may be print that is not among the words.
        """
        try:
            page = self._document[index]
            width, height = page.get_size()
            text, covered, characters = page.get_textpage(), 0.0, 0
            for drawn in islice(page.get_objects(filter=_SHOWN, max_depth=FORMS), MOST_LOOKED_AT):
                left, bottom, right, top = drawn.get_bounds()
                if drawn.type == pdfium.FPDF_PAGEOBJ_IMAGE:
                    share = (right - left) * (top - bottom) / (width * height)
                    covered += share
                    characters = 0 if share > _PICTURE else characters
                elif pdfium.FPDFTextObj_GetTextRenderMode(drawn.raw) not in NOT_SHOWN:
                    characters += pdfium.FPDFTextObj_GetText(drawn.raw, text.raw, None, 0) // 2 - 1
            if characters < (_FEW_CHARACTERS if covered < _COVERED else _CHARACTERS):
                return {"turn": None}, []
            looked_at = range(min(text.count_chars(), MOST_LOOKED_AT))
            angles = (pdfium.FPDFText_GetCharAngle(text.raw, k) for k in looked_at)
            count = Counter(round(angle / (math.pi / 2)) % 4 for angle in angles)
            # Angles of characters are clockwise, as the rotation of the page is.
            turn = (-90 * max(range(4), key=count.__getitem__) - page.get_rotation()) % 360
            return {"turn": turn, "pictures": covered > 0 or has_other_print(page)}, words_of(page, text)
        except pypdfium2.PdfiumError:
            return {"turn": None}, []

    def _check(self, index: int) -> None:
        """Check the structure, unless this library cannot read the file; the renderer repairs more."""
        with suppress(pikepdf.PdfError, pikepdf.PasswordError, IndexError):
            check_page(self._page(index), StructureLimits())

    def _page(self, index: int) -> pikepdf.Page:
        self._structure = self._structure or pikepdf.open(io.BytesIO(self._data))
        return self._structure.pages[index]

    def _user_unit(self, index: int) -> float:
        """Points per unit of a page (PDF 1.7, 14.11.2), which the renderer does not know; 1 where it is not valid."""
        with suppress(
            pikepdf.PdfError, pikepdf.PasswordError, IndexError, TypeError, ValueError, OverflowError
        ):
            unit = float(self._page(index).obj.get("/UserUnit", 1))
            return unit if 0 < unit <= MOST_USER_UNIT else 1.0
        return 1.0


def main() -> None:
    """Set the limits of this process, then serve. An allocation that fails ends the process.

    Arguments: address space in bytes, processor time of all pages and of one page in seconds, size of the PDF in bytes.
    """
    memory_bytes, document_s, page_s, max_upload_bytes = map(int, sys.argv[1:])
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (document_s, document_s + _BEFORE_KILL_S))
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not get between the replies
    try:
        serve(sys.stdin.buffer, replies, max_upload_bytes, page_s)
    except MemoryError:
        write_message(replies, {"memory": True})


if __name__ == "__main__":
    main()
