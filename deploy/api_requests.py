"""The requests whose answers docs/api/ shows, in an order in which each finds what it needs.

`URL` in a command is the address of the service; files are those of `examples/`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Request:
    """A shell command, and what becomes of its answer."""

    operation: str
    """Method and path of the OpenAPI document. Empty: the answer is not shown, but later requests need it."""
    command: str
    case: str = ""
    """What is special, of an operation with several answers."""
    kept: Mapping[str, str] = field(default_factory=dict)
    """Shell variables for later commands: each has a header of the answer, or a name of its JSON (`zones.0.id`)."""
    levels: int | None = None
    """How many objects within each other of its JSON are shown, where another answer shows them all."""
    refused: bool = False
    """Whether the answer is a problem."""

    @property
    def name(self) -> str:
        """Of the answer in the pages."""
        return f"{self.operation}, {self.case}" if self.case else self.operation


_TUS = "-H 'Tus-Resumable: 1.0.0'"
_PIECE = f"{_TUS} -H 'Content-Type: application/offset+octet-stream'"
_TWO_PHOTOS = "-F images=@a.jpg -F images=@b.jpg"
THREE_STRANGERS = """
curl -F image=@page-2.jpg URL/layout -o page-2.json
for down in 0 6 12; do
    python3 - $down > zones.json <<'END'
import json, sys
down, page = int(sys.argv[1]), json.load(open("page-2.json"))
zones = [
    {"id": zone["id"], "box": [x0, y0 + down, x1, y1 + down]}
    for zone in page["zones"]
    for x0, y0, x1, y1 in (zone["box"],)
]
json.dump({"width": page["width"], "height": page["height"] + 12, "zones": zones}, sys.stdout)
END
    id=$(curl -F zones=@zones.json URL/layout | sed 's/^{"id":"\\([^"]*\\)".*/\\1/')
    curl -d '{"class": null}' URL/layout/results/$id/feedback
done
"""
"""A page and two like it, which are printed a little lower, belong to no class."""

OF_THE_SERVICE = (
    Request("GET /health/live", "curl URL/health/live"),
    Request("GET /health/ready", "curl URL/health/ready"),
    Request("POST /tokens", 'curl -X POST -H "X-API-Key: $KEY" URL/tokens'),
)
OF_PHOTOS = (
    Request("POST /rectify", "curl -F image=@photo.jpg -H 'Accept: application/json' URL/rectify"),
    Request(
        "POST /rectify",
        "curl -F image=@a.jpg -F image=@left.png -F format=json URL/rectify",
        "two pages",
        levels=2,
    ),
    Request(
        "POST /rectify", "curl -F image=@photo.jpg -F ilumination=bw URL/rectify", "refused", refused=True
    ),
    Request(
        "",
        "curl -F image=@photo.jpg -F camera=tablet-3 -F keep_photo=true -F format=json URL/rectify",
        kept={"page": "page_id"},
    ),
    Request("GET /cameras", "curl URL/cameras"),
    Request("DELETE /cameras/{name}", "curl -X DELETE URL/cameras/tablet-3"),
    Request("GET /pages/{id}", "curl URL/pages/$page"),
    Request("GET /pages/{id}/photo", 'curl "URL/pages/$page/photo?width=800" -o photo-small.jpg'),
    Request(
        "POST /pages/{id}/render",
        """curl -d '{"rotate": 180, "illumination": "bw", "format": "png"}' URL/pages/$page/render -o flat.png""",
    ),
    Request(
        "POST /pages/bind",
        r"""curl -d "{\"pages\": [\"$page\"], \"format\": \"pdf\"}" URL/pages/bind -o pages.pdf""",
    ),
    Request("DELETE /pages/{id}", "curl -X DELETE URL/pages/$page"),
    Request("POST /rectify/image", "curl -F image=@photo.jpg URL/rectify/image -o flat.jpg"),
    Request("POST /rectify/pdf", "curl -F image=@a.jpg -F image=@b.jpg URL/rectify/pdf -o pages.pdf"),
    Request("POST /rectify/text", "curl -F image=@photo.jpg -F format=markdown URL/rectify/text"),
    Request("POST /rectify/pages", "curl -F image=@photo.jpg URL/rectify/pages"),
    Request("POST /mosaic", f"curl {_TWO_PHOTOS} -H 'Accept: application/json' URL/mosaic"),
    Request("POST /mosaic/image", f"curl {_TWO_PHOTOS} URL/mosaic/image -o page.jpg"),
    Request("POST /mosaic/pdf", f"curl {_TWO_PHOTOS} URL/mosaic/pdf -o page.pdf"),
    Request("POST /mosaic/json", f"curl {_TWO_PHOTOS} URL/mosaic/json"),
    Request(
        "POST /uploads",
        f'curl -X POST {_TUS} -H "Upload-Length: $(($(wc -c < photo.jpg)))" \\\n'
        "     -H 'Upload-Metadata: filename cGhvdG8uanBn' URL/uploads",
        kept={"upload": "Location"},
    ),
    Request(
        "PATCH /uploads/{id}",
        f"head -c 100000 photo.jpg | curl -X PATCH {_PIECE} \\\n"
        "     -H 'Upload-Offset: 0' --data-binary @- URL$upload",
    ),
    Request("GET /uploads/{id}", "curl URL$upload"),
    Request("DELETE /uploads/{id}", f"curl -X DELETE {_TUS} URL$upload"),
    Request(
        "POST /mosaic",
        f"curl -H 'Prefer: respond-async' {_TWO_PHOTOS} -F format=pdf URL/mosaic",
        "as a job",
        kept={"job": "Location"},
    ),
    Request("GET /jobs/{id}/events", "curl -N URL$job/events"),
    Request("GET /jobs/{id}", "curl URL$job"),
    Request("GET /jobs/{id}/result", "curl URL$job/result -o page.pdf"),
    Request(
        "",
        f"curl -H 'Prefer: respond-async' {_TWO_PHOTOS} -F format=png URL/mosaic",
        kept={"job": "Location"},
    ),
    Request("DELETE /jobs/{id}", "curl -X DELETE URL$job"),
)
OF_MODELS = (
    Request(
        "POST /layout/models/{name}/samples",
        "curl -F image=@letter-2.png -F zones=@letter-2.json URL/layout/models/letter/samples",
        kept={"sample": "Location"},
    ),
    Request(
        "POST /layout/models/{name}/samples/archive",
        "python3 -m zipfile -c samples.zip letter-1.json letter-1.png letter-2.json\n"
        "curl -F archive=@samples.zip URL/layout/models/letter/samples/archive",
    ),
    Request("GET /layout/models/{name}/samples", "curl URL/layout/models/letter/samples"),
    Request("GET /layout/models/{name}/samples/{id}", "curl URL$sample"),
    Request("POST /layout/models/{name}/initialize", "curl -X POST URL/layout/models/letter/initialize"),
    Request("GET /layout/models", "curl URL/layout/models"),
    Request("GET /layout/models/{name}", "curl URL/layout/models/letter -o letter-model.json"),
    Request("GET /layout/models/{name}/settings", "curl URL/layout/models/letter/settings"),
    Request(
        "PATCH /layout/models/{name}/settings",
        """curl -X PATCH -d '{"fields": {"date": {"type": "date", "order": "MDY"}}}' \\\n"""
        "     URL/layout/models/letter/settings",
    ),
    Request("GET /layout/export", "curl 'URL/layout/export?models=letter' -o letter.zip"),
    Request("POST /layout/import", "curl -F archive=@letter.zip URL/layout/import"),
)
OF_LAYOUT = (
    Request("POST /layout", "curl -F image=@page.png URL/layout"),
    Request("POST /layout", "curl -F image=@page.png -F format=pagexml URL/layout", "as PAGE-XML"),
    Request(
        "POST /layout",
        "curl -F image=@page-1.jpg -F image=@page-2.jpg URL/layout",
        "a document of two pages",
        levels=2,
    ),
    Request(
        "POST /layout", "curl -F image=@letter.pdf -F split=true URL/layout", "a stack of documents", levels=3
    ),
    Request(
        "",
        "curl -F image=@page.png -F keep_image=true URL/layout",
        kept={"id": "id", "result": "Document-Result"},
    ),
    Request(
        "GET /layout/results/{id}/image", 'curl "URL/layout/results/$id/image?width=600" -o flat-page.jpg'
    ),
    Request(
        "POST /layout/results/{id}/claim",
        "curl -d '{}' URL$result/claim",
        kept={"claim": "claim"},
    ),
    Request("POST /layout/results/{id}/release", r"""curl -d "{\"claim\": \"$claim\"}" URL$result/release"""),
    Request("", "curl -d '{}' URL$result/claim", kept={"claim": "claim"}),
    Request("POST /layout/results/{id}/skip", r"""curl -d "{\"claim\": \"$claim\"}" URL$result/skip"""),
    Request(
        "POST /layout/results/{id}/feedback",
        """curl -d '{"class": "letter", "labels": {"z3": "subject"}}' URL$result/feedback""",
    ),
    Request("GET /layout/results/{id}", "curl URL$result", levels=2),
    Request("GET /layout/results/{id}", 'curl "URL$result?format=html"', "as HTML"),
    Request("GET /layout/results", "curl 'URL/layout/results?state=corrected'"),
    Request("GET /layout/results", "curl 'URL/layout/results?state=corrected&format=csv'", "as CSV"),
    Request("GET /layout/results", "curl 'URL/layout/results?state=corrected&format=jsonl'", "as JSON lines"),
    Request("GET /layout/models/{name}/feedback", "curl URL/layout/models/letter/feedback"),
    Request("GET /layout/models/{name}/health", "curl URL/layout/models/letter/health"),
    Request(
        "GET /layout/models/{name}/versions/{version}/diff",
        "curl 'URL/layout/models/letter/versions/2/diff?limit=20'",
    ),
    Request("DELETE /layout/results/{id}/feedback", "curl -X DELETE URL$result/feedback"),
    Request(
        "POST /layout/models/{name}/train", """curl -d '{"rounds": 10}' URL/layout/models/letter/train"""
    ),
    Request(
        "POST /layout/models/{name}/rollback",
        """curl -d '{"version": 1}' URL/layout/models/letter/rollback""",
    ),
    Request("GET /layout/models/{name}/versions", "curl URL/layout/models/letter/versions"),
    Request("DELETE /layout/models/{name}/samples/{id}", "curl -X DELETE URL$sample"),
    Request("DELETE /layout/results/{id}", "curl -X DELETE URL$result"),
    Request("", THREE_STRANGERS),
    Request("GET /layout/unknown-pages", "curl URL/layout/unknown-pages", kept={"unknown": "pages.0.id"}),
    Request("GET /layout/unknown-pages/{id}", "curl URL/layout/unknown-pages/$unknown"),
    Request("POST /layout/proposals", "curl -X POST URL/layout/proposals"),
    Request("DELETE /layout/unknown-pages/{id}", "curl -X DELETE URL/layout/unknown-pages/$unknown"),
    Request("DELETE /layout/models/{name}", "curl -X DELETE URL/layout/models/letter"),
    Request(
        "PUT /layout/models/{name}",
        "curl -X PUT -H 'If-None-Match: *' --data-binary @letter-model.json URL/layout/models/letter",
    ),
    Request("GET /audit", "curl 'URL/audit?model=letter'"),
    Request(
        "GET /metrics", """curl URL/metrics | grep -E '^(http_requests_total.*"/rectify"|engine_[clw]|ocr)'"""
    ),
)
REQUESTS = (*OF_THE_SERVICE, *OF_PHOTOS, *OF_MODELS, *OF_LAYOUT)
