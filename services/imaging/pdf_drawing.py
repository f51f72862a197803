"""Drawing of the pages of a PDF, in a process that can be killed.

The renderer is native code that no thread can interrupt, and files of a kilobyte make it work for hours or allocate
gigabytes. So each PDF gets a process with limits of its own on time and memory, and a file that exceeds them costs only
this process. It starts in about 0.2 s.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np

import services
from services.arrays import RgbImage
from services.contract.rectify import PrintedWord, Rotation, TypesetPage
from services.errors import DocumentError, TooLarge, UndecodableImage
from services.imaging.pdf_process import read_message, write_message

_ROOT = Path(services.__path__[0]).parent
_ERRORS: dict[str, type[DocumentError]] = {error.code: error for error in (TooLarge, UndecodableImage)}
_BYTES_PER_PIXEL = 4


@dataclass(frozen=True, slots=True)
class PdfLimits:
    """Limits of the process that draws one PDF."""

    page_processor_s: int = 10
    """Longest processor time for one page. A page of print takes 0.1 s, a dense map 3 s."""
    document_processor_s: int = 60
    """Longest processor time for all pages together: 20 dense maps."""
    longest_wait_s: float = 30.0
    """Longest wait for one reply, on a machine where the process gets little processor time."""
    memory_bytes: int = 2**30
    """Address space. The interpreter and the libraries take 150 MB, the bitmap of 64 megapixels 256 MB."""


PDF_LIMITS = PdfLimits()


class PdfPages:
    """The pages of a PDF; made by `open_pdf`."""

    def __init__(self, process: "subprocess.Popen[bytes]", limits: PdfLimits, max_pixels: int) -> None:
        self._process = process
        self._limits = limits
        self._most_bytes = (max_pixels + (1 << 20)) * _BYTES_PER_PIXEL  # rows are padded

    def open(self, data: bytes, most: int) -> list[tuple[float, float]]:
        """Width and height of each page in points, of at most `most` pages."""
        header, _ = self._exchange({"most": most}, data, "The PDF")
        return [(float(width), float(height)) for width, height in header["sizes"]]

    def draw(self, page: int, scale: float) -> RgbImage:
        """A page, counted from 0, as (H, W, 3) uint8 at `scale` pixels a point.

        Raises
        ------
        TooLarge
            When it needs more time or memory than the limits allow.
        UndecodableImage
            When it is damaged.
        """
        header, body = self._exchange({"page": page, "scale": scale}, b"", f"Page {page + 1} of the PDF")
        rows, stride, channels = header["rows"], header["stride"], header["channels"]
        pixels = np.frombuffer(body, np.uint8).reshape(rows, stride)[:, : stride // channels * channels]
        pixels = pixels.reshape(rows, -1, channels)
        return np.array(pixels[:, :, :3] if channels > 1 else np.repeat(pixels, 3, axis=2))  # a copy

    def look_for_type(self, page: int) -> TypesetPage | None:
        """What a page, counted from 0, says of its type; None if it is not set in type."""
        header, body = self._exchange({"type": page}, b"", f"Page {page + 1} of the PDF")
        turn: Rotation | None = header["turn"]
        if turn is None:
            return None
        words = tuple(
            PrintedWord(text, (x0, y0, x1, y1), line) for text, (x0, y0, x1, y1), line in json.loads(body)
        )
        return TypesetPage(turn, words, header["pictures"])

    def _exchange(self, header: dict[str, object], body: bytes, what: str) -> tuple[dict[str, Any], bytes]:
        """The reply to a request; the process is killed when the reply takes too long."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        timer = Timer(self._limits.longest_wait_s, self._process.kill)
        timer.daemon = True
        timer.start()
        try:
            write_message(self._process.stdin, header, body)
            reply, content = read_message(self._process.stdout, self._most_bytes)
        except (EOFError, OSError) as error:
            raise self._error_of_loss(what) from error
        finally:
            timer.cancel()
        if reply.get("memory"):
            raise self._out_of_memory(what)
        if "refused" in reply:
            raise _ERRORS[reply["refused"]](reply["detail"])
        return reply, content

    def _error_of_loss(self, what: str) -> DocumentError:
        code = self._process.wait(10)
        if code in (-signal.SIGXCPU, -signal.SIGKILL):
            return TooLarge(
                f"{what} takes more than {self._limits.page_processor_s} s to draw, or all its pages more than "
                f"{self._limits.document_processor_s} s. Send the page as an image."
            )
        # The renderer ends its process where an allocation fails; damaged files are errors that it reports.
        return self._out_of_memory(what)

    def _out_of_memory(self, what: str) -> TooLarge:
        return TooLarge(
            f"{what} needs more than {self._limits.memory_bytes} bytes of memory to draw, or it stops the renderer. "
            "Send it as an image."
        )


@contextmanager
def open_pdf(max_upload_bytes: int, max_pixels: int, limits: PdfLimits) -> Iterator[PdfPages]:
    """A process for one PDF; it ends with the block."""
    folders = (str(_ROOT), *(folder for folder in sys.path if folder))
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "services.imaging.pdf_process",
            str(limits.memory_bytes),
            str(limits.document_processor_s),
            str(limits.page_processor_s),
            str(max_upload_bytes),
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(folders)},
    )
    try:
        yield PdfPages(process, limits, max_pixels)
    finally:
        process.kill()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with suppress(OSError):
                    stream.close()
        process.wait(10)
