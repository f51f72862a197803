"""The tables of docs/api.md and docs/api/ that the code decides: `make api-tables`.

Operations come from the OpenAPI document, limits from the settings, codes of problems from where they are sent. Each
table stands between two comments of its name; what is around them is written by hand.
"""

import re
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

from app.http.problems import MEANING_OF_CODE, STATUS_OF_CODE
from app.main import create_app
from app.openapi.document import operations_of
from app.settings import Settings

DOCS = Path(__file__).parent.parent / "docs"
INDEX = DOCS / "api.md"
NEVER_SENT = "client-closed-request"
"""The client has gone."""
SECTIONS = (
    (r"/(rectify|mosaic)/", "api/one-answer.md"),
    (r"/(rectify|cameras)", "api/rectify.md"),
    (r"/pages", "api/pages.md"),
    (r"/mosaic", "api/mosaic.md"),
    (r"/uploads", "api/uploads.md"),
    (r"/layout/results/{id}/(claim|release|skip)|/audit", "api/review.md"),
    (r".*/(feedback|train|rollback|health|diff)$", "api/feedback.md"),
    (r"/layout/(unknown|proposals)", "api/proposals.md"),
    (r"/layout(/results|$)", "api/layout.md"),
    (r"/layout", "api/models.md"),
    (r"/jobs", "api/jobs.md"),
    (r"/tokens", "api/conventions.md"),
    (r"/(health|metrics)", "api/health.md"),
)
"""Where the operations of a path are described: the first one that fits."""
IS_LIMIT = re.compile(r"(max|min)_\w+|\w+_(timeout|ttl)_s|queue_length|worker_memory_bytes")
"""Names of settings that end in an answer, or in something that is no longer there."""
BEYOND = {
    "token_ttl_s": "`forbidden`",
    "max_upload_bytes": "`too-large`",
    "max_mosaic_upload_bytes": "`too-large`",
    "max_megapixels": "`too-large`",
    "max_mosaic_megapixels": "`too-large`",
    "max_document_upload_bytes": "`too-large`",
    "max_pages": "`too-large`",
    "max_stack_pages": "`too-large`",
    "max_document_megapixels": "`too-large`",
    "max_zones": "`invalid-option`",
    "max_zones_bytes": "`too-large`",
    "max_zones_file_bytes": "`too-large`",
    "max_model_bytes": "`too-large`",
    "max_archive_bytes": "`too-large`",
    "max_exif_bytes": "`too-large`",
    "body_timeout_s": "`request-timeout`",
    "min_body_bytes_per_s": "`request-timeout`",
    "max_uploads": "`busy`",
    "max_drain_bytes": "the connection ends",
    "drain_timeout_s": "the connection ends",
    "queue_length": "`busy`",
    "queue_timeout_s": "`busy`",
    "job_timeout_s": "`timed-out`",
    "mosaic_timeout_s": "`timed-out`",
    "document_timeout_s": "`timed-out`",
    "model_timeout_s": "`timed-out`",
    "worker_memory_bytes": "`out-of-memory`",
    "job_ttl_s": "`not-found`",
    "max_jobs": "`busy`",
    "max_jobs_per_key": "`busy`",
    "max_job_input_bytes": "`busy`",
    "max_job_result_bytes": "`not-found`; one that is larger: `too-large`",
    "max_job_listeners": "`busy`",
    "store_timeout_s": "`store-unavailable`",
    "min_free_disk_bytes": "`/health/ready` has `disk: full`",
    "max_models": "`store-full`",
    "max_samples_per_model": "`store-full`",
    "result_ttl_s": "`not-found`",
    "max_results": "`not-found`",
    "max_kept_image_bytes": "the picture is reduced",
    "max_kept_images_bytes": "`not-found`",
    "max_kept_photos_bytes": "`not-found`",
    "upload_ttl_s": "`not-found`",
    "max_kept_uploads": "`busy`",
    "max_kept_uploads_per_key": "`busy`",
    "max_kept_uploads_bytes": "`busy`",
    "max_sample_images_bytes": "the sample stays, without its image",
    "claim_ttl_s": "`conflict`",
    "max_unknown_pages": "`not-found`",
    "unknown_ttl_s": "`not-found`",
}
"""What is answered beyond each limit."""


def endpoints() -> str:
    """Every operation of the OpenAPI document, each with a link to its answer."""
    rows = ["| operation | |", "| --- | --- |"]
    document = create_app(Settings(api_keys=(), workers=1)).openapi()
    methods = ((path, method) for path, each in document["paths"].items() for method in each)
    for (path, method), (_, operation) in zip(methods, operations_of(document), strict=True):
        place = next(place for pattern, place in SECTIONS if re.match(pattern, path))
        name = f"{method.upper()} {path}"
        rows.append(f"| [`{name}`]({place}#{anchor_of(name)}) | {_cell(_first_sentence(operation))} |")
    return "\n".join(rows)


def anchor_of(operation: str) -> str:
    """Where the answer of an operation is in its page."""
    return re.sub(r"[^a-z]+", "-", operation.lower()).strip("-")


def limits() -> str:
    """Every setting that limits requests or what is kept.

    Raises
    ------
    KeyError
        When it is not said what is answered beyond one of them.
    """
    rows = ["| setting | default | limit | beyond it |", "| --- | --- | --- | --- |"]
    for name, field in Settings.model_fields.items():
        if IS_LIMIT.fullmatch(name):
            meaning = _cell(field.description or "")
            rows.append(f"| `{name.upper()}` | {_default(name, field)} | {meaning} | {BEYOND[name]} |")
    return "\n".join(rows)


def problems() -> str:
    """Every code that a problem may have, with its status."""
    rows = ["| code | status | meaning |", "| --- | --- | --- |"]
    for code, status in sorted(STATUS_OF_CODE.items(), key=lambda row: (row[1], row[0])):
        if code != NEVER_SENT:
            also = ", 412" if code == "conflict" else ""
            rows.append(f"| `{code}` | {status}{also} | {_cell(MEANING_OF_CODE[code])} |")
    return "\n".join(rows)


TABLES = {
    "endpoints": (INDEX, endpoints),
    "limits": (DOCS / "api" / "limits.md", limits),
    "problems": (DOCS / "api" / "problems.md", problems),
}
"""The page and the maker of each table."""


def pages() -> list[Path]:
    """The pages of the reference, in the order of the index, which is the first one."""
    text = INDEX.read_text("utf-8")
    return [
        INDEX,
        *(DOCS / name for name in re.findall(r"^\| \[[\w ]+\]\((api/[\w-]+\.md)\) \|", text, re.MULTILINE)),
    ]


def reference() -> str:
    """The text of all pages."""
    return "\n".join(page.read_text("utf-8") for page in pages())


def with_table(name: str) -> str:
    """The page of a table, with the table made anew."""
    page, table = TABLES[name]
    start, end = f"<!-- {name}: make api-tables -->", f"<!-- end of {name} -->"
    before, _, rest = page.read_text("utf-8").partition(start)
    _, _, after = rest.partition(end)
    return f"{before}{start}\n{table()}\n\n{end}{after}"


def _first_sentence(operation: dict[str, Any]) -> str:
    text = " ".join(operation["description"].split("\n\n")[0].split())
    return re.split(r"(?<=\w\w[.)])\s(?=[A-Z])", text)[0]


def _default(name: str, field: FieldInfo) -> str:
    """In the unit that its name says; bytes as KiB, MiB or GiB where they are whole."""
    if name == "worker_memory_bytes":
        return "4 GiB"  # its factory asks this machine
    value = field.default
    if name.endswith("_bytes"):
        for unit, size in (("GiB", 2**30), ("MiB", 2**20), ("KiB", 2**10)):
            if value and value % size == 0:
                return f"{value // size} {unit}"
    unit = " s" if name.endswith("_s") and not name.endswith("_per_s") else ""
    return f"{value:g}{unit}" if value < 1e6 else f"{value}{unit}"


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


if __name__ == "__main__":
    for name, (page, _) in TABLES.items():
        page.write_text(with_table(name), encoding="utf-8")
