"""One checkout's complete answers, a file each; `same_answers` runs this file with the checkout as PYTHONPATH.

It imports nothing of the benchmarks, so that an older checkout answers by its own services. A line of standard input is
a request: `flow`, `files`, `options`, and `answer`, the file that is written.
"""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

from services.contract.images import DocumentLimits, Encoding, ImageLimits
from services.contract.mosaic import MosaicLimits, MosaicParameters
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.operations.mosaic import mosaic_uploads
from services.operations.rectify_documents import rectify_uploads

CHANGING = frozenset({"timings_ms", "id", "page_id", "created_at"})
"""Keys of values that differ from one answer to the next."""


def main() -> None:
    """Answer the requests of standard input, one after another."""
    for line in sys.stdin:
        request = json.loads(line)
        uploads = [Path(file).read_bytes() for file in request["files"]]
        answer = answer_request(request["flow"], uploads, request["options"])
        target = Path(request["answer"])
        partial = target.with_suffix(".part")
        partial.write_text(json.dumps(answer), encoding="utf-8")
        partial.replace(target)


def answer_request(flow: str, uploads: list[bytes], options: dict[str, object]) -> dict[str, object]:
    """The document of an answer and a digest of its body, whose pixels are lossless; or its error."""
    encoding = Encoding("json" if options.get("preview") else "tiff", pages_format="tiff")
    try:
        if flow == "mosaic":
            limits = MosaicLimits(ImageLimits(), 400.0)
            reply = mosaic_uploads(uploads, MosaicParameters(**options), encoding, limits)  # type: ignore[arg-type]
        else:
            parameters = RectifyParameters(**options)  # type: ignore[arg-type]
            reply = rectify_uploads(uploads, parameters, encoding, DocumentLimits())
    except DocumentError as error:
        return {"error": error.code, "detail": str(error)}
    except Exception as error:  # what an answer must never be is compared too
        return {"error": f"{type(error).__name__}: {error}"}
    return {"body": hashlib.sha256(reply.body).hexdigest(), "document": masked(document_of(reply))}


def document_of(reply: Any) -> object:
    """The answer as JSON; checkouts before typed answers have it as `document`."""
    return reply.document if hasattr(reply, "document") else reply.answer.model_dump(mode="json")


def masked(value: object) -> object:
    """`value`, of JSON's types, without what changes from one answer to the next."""
    if isinstance(value, dict):
        return {key: masked(item) for key, item in value.items() if key not in CHANGING}
    return [masked(item) for item in value] if isinstance(value, list) else value


if __name__ == "__main__":
    main()
