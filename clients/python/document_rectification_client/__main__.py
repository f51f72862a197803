"""Photos of pages become a file of flat pages: flatten PHOTO... -o page.pdf

The ending of the file says what it is: pdf (which can be searched), jpg, png, webp, tif, txt, md, zip or json.
"""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from document_rectification_client import calls
from document_rectification_client.calls import Call, File
from document_rectification_client.clients import URL, Client
from document_rectification_client.models import JobStatus
from document_rectification_client.problems import ProblemError

FORMATS = {
    ".pdf": "pdf",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".png": "png",
    ".webp": "webp",
    ".tif": "tiff",
    ".tiff": "tiff",
    ".txt": "txt",
    ".md": "markdown",
    ".zip": "zip",
    ".json": "json",
}
REFUSED, USAGE, TRY_LATER, INTERRUPTED = 1, 2, 3, 130
"""Exit statuses. `argparse` ends with that of usage, too."""
LATER = {"unreachable", "busy", "not-ready", "shutting-down", "store-unavailable"}
"""Problems that pass."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status: 0, `REFUSED`, `USAGE` (also a file that cannot be read or written) or `TRY_LATER`."""
    parser = _parser()
    asked = parser.parse_args(arguments)
    try:
        client = Client(asked.url, asked.key)
    except ValueError as error:
        parser.error(str(error))
    try:
        with client:
            file = _file_of(client, _call(asked))
        file.save(asked.output)
    except ProblemError as problem:
        print(f"flatten: {problem.code}: {problem}", file=sys.stderr)
        return TRY_LATER if problem.code in LATER else REFUSED
    except OSError as error:
        print(f"flatten: {error.filename}: {error.strerror}", file=sys.stderr)
        return USAGE
    except KeyboardInterrupt:
        return INTERRUPTED
    for warning in file.warnings:
        print(f"flatten: warning: {warning}", file=sys.stderr)
    for page in file.failed:
        print(f"flatten: left out: page {page}", file=sys.stderr)
    return 0


def _file_of(client: Client, call: Call[File]) -> File:
    """The answer to the call; whoever interrupts the program wants the work no more."""
    job = client.start(call)
    try:
        return client.result(job, _shown())
    except KeyboardInterrupt:
        client.cancel(job)
        raise


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("flatten", description=__doc__)
    parser.add_argument("photos", nargs="+", type=Path, metavar="PHOTO")
    parser.add_argument("-o", "--output", type=_output, required=True, metavar="FILE")
    parser.add_argument(
        "--url", default=os.environ.get("RECTIFY_URL", URL), help="the service (RECTIFY_URL; %(default)s)"
    )
    parser.add_argument("--key", default=os.environ.get("RECTIFY_KEY"), help="an API key (RECTIFY_KEY)")
    parser.add_argument("--mosaic", action="store_true", help="the photos show parts of one page")
    parser.add_argument("--language", help="what is read, by Tesseract's names: eng+fra")
    parser.add_argument(
        "--option",
        action="append",
        default=[],
        type=_option,
        metavar="NAME=VALUE",
        help="any other option of the service: illumination=bw",
    )
    return parser


def _output(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower() not in FORMATS:
        raise argparse.ArgumentTypeError(f"{text}: the ending is none of {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: there is no such folder")
    return path


def _option(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"{text}: this is not NAME=VALUE")
    return name, value


def _call(asked: argparse.Namespace) -> Call[File]:
    """What is asked for. Of JSON there is one form, that of pages, and it is written as it comes."""
    format = FORMATS[asked.output.suffix.lower()]
    options = dict(asked.option)
    if asked.language is not None:
        options["language"] = asked.language
    if format == "pdf":
        options.setdefault("text", "true")
    if format == "json":
        call: Call[Any] = (calls.mosaic_page if asked.mosaic else calls.flatten_pages)(
            asked.photos, **options
        )
        return replace(call, read=calls.read_file)
    return (calls.mosaic if asked.mosaic else calls.flatten)(asked.photos, format, **options)


def _shown() -> Callable[[JobStatus], None]:
    """Shows progress: on a terminal in one line, else as a line for each new stage."""
    is_terminal, last = sys.stderr.isatty(), ""

    def show(status: JobStatus) -> None:
        nonlocal last
        stage = status.stage or status.state
        if is_terminal:
            end = "\n" if status.ended else ""
            print(f"\r{status.progress:4.0%} {stage:<24}", end=end, file=sys.stderr, flush=True)
        elif stage != last:
            print(f"{status.progress:4.0%} {stage}", file=sys.stderr, flush=True)
        last = stage

    return show


if __name__ == "__main__":
    sys.exit(main())
