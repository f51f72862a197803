"""Clients that are generated from the OpenAPI document work without a hand-written line."""

import importlib
import io
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image

from simulation.labelled_pages import letter_page
from tests.end_to_end.pictures import encoded
from tests.end_to_end.typescript import NEEDS_NODE, NODE_MODULES

PACKAGE = "generated_client"


@pytest.fixture(scope="module")
def document(service: httpx.Client) -> dict[str, Any]:
    """The document that the running service publishes."""
    document: dict[str, Any] = service.get("/openapi.json").json()
    return document


GENERATOR_SETTINGS = "post_hooks: []"
"""Nothing but that the generator's own formatter is not started."""


def test_the_document_is_valid(document: dict[str, Any]) -> None:
    # Three CPU seconds of grammars, which every process of a run would pay while it collects.
    from openapi_spec_validator import OpenAPIV31SpecValidator

    assert [error.message for error in OpenAPIV31SpecValidator(document).iter_errors()] == []


@pytest.fixture(scope="module")
def generated(
    document: dict[str, Any], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[str], ModuleType]]:
    """Imports a module of the generated Python client by its name."""
    folder = tmp_path_factory.mktemp("client")
    (folder / "openapi.json").write_text(json.dumps(document), encoding="utf-8")
    (folder / "settings.yml").write_text(GENERATOR_SETTINGS, encoding="utf-8")
    made = subprocess.run(
        [
            *(
                sys.executable,
                "-m",
                "openapi_python_client",
                "generate",
                "--meta",
                "none",
                "--fail-on-warning",
            ),
            *("--path", folder / "openapi.json", "--output-path", folder / PACKAGE),
            *("--config", folder / "settings.yml"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stdout + made.stderr
    assert "arning" not in made.stdout + made.stderr
    sys.path.insert(0, str(folder))
    try:
        yield lambda name: importlib.import_module(f"{PACKAGE}.{name}")
    finally:
        sys.path.remove(str(folder))
        for name in [name for name in sys.modules if name.partition(".")[0] == PACKAGE]:
            del sys.modules[name]


def test_the_python_client_goes_the_main_way(
    generated: Callable[[str], ModuleType], service: httpx.Client, page: Image.Image
) -> None:
    models, types = generated("models"), generated("types")
    client = generated("client").Client(
        base_url=str(service.base_url), timeout=httpx.Timeout(60), raise_on_unexpected_status=True
    )

    def file(image: Image.Image, name: str) -> Any:
        return types.File(payload=io.BytesIO(encoded(image, "PNG")), file_name=name, mime_type="image/png")

    def call(operation: str, *arguments: Any, **options: Any) -> Any:
        return generated(f"api.{operation}").sync(*arguments, client=client, **options)

    # /rectify
    form = models.RectifyForm(
        image=[file(page, "photo.png")], format_=models.RectifyFormFormat.JSON, quality=80
    )
    flat = call("rectify.rectify", body=form)
    assert isinstance(flat, models.RectifyResult)
    assert (flat.kind, flat.mesh.rows) == ("planar", len(flat.mesh.source))

    # The operations of one answer: bytes, and pages whose points are objects
    image = call("rectify.rectify_to_image", body=models.RectifyImageForm(image=[file(page, "photo.png")]))
    assert Image.open(image.payload).format == "JPEG"
    pdf = call("rectify.rectify_to_pdf", body=models.RectifyPdfForm(image=[file(page, "photo.png")]))
    assert pdf.payload.read(5) == b"%PDF-"
    pages = call("rectify.rectify_to_pages", body=models.RectifyPagesForm(image=[file(page, "photo.png")]))
    assert isinstance(pages.pages[0], models.PlainRectifyResult)
    corner = pages.pages[0].mesh.source[0][0]
    assert (corner.x, corner.y) == tuple(flat.mesh.source[0][0])

    # /mosaic
    width, height = page.size
    halves = [page.crop((0, 0, width, height * 2 // 3)), page.crop((0, height // 3, width, height))]
    mosaic = call(
        "mosaic.mosaic",
        body=models.MosaicForm(
            images=[file(half, f"{number}.png") for number, half in enumerate(halves)],
            rectify=False,
            format_=models.MosaicFormFormat.JSON,
        ),
    )
    assert isinstance(mosaic, models.MosaicResult)
    assert mosaic.unplaced == []

    # /layout: a class from two samples, a page of it, and a correction
    for seed in range(2):
        sample = letter_page(np.random.default_rng(seed), draw=False).document()
        receipt = call("layout_models.add_layout_sample", "client", body=models.PageBody.from_dict(sample))
        assert isinstance(receipt, models.SampleReceipt)
    assert call("layout_models.initialize_layout_model", "client").version == 1
    other = letter_page(np.random.default_rng(9), draw=False).document()
    found = call(
        "layout.layout",
        body=models.LayoutForm(zones=json.dumps(other), models="client", ocr=models.LayoutFormOcr.OFF),
    )
    assert isinstance(found, models.LayoutResult)
    again = call("layout.layout_result", found.id)
    assert again.to_dict() == found.to_dict()
    truth = {str(zone["id"]): zone["label"] for zone in other["zones"]}
    body = models.FeedbackBody.from_dict({"class": "client", "labels": truth})
    feedback = call("layout_feedback.give_layout_feedback", found.id, body=body)
    assert isinstance(feedback, models.Feedback)
    assert [(model.name, model.new_version) for model in feedback.models] == [("client", 2)]
    # Other tests of this service expect classes of their own.
    call("layout_models.delete_layout_model", "client")

    # A job
    form.image = [file(page, "photo.png")]
    job = call("rectify.rectify", body=form, prefer="respond-async", idempotency_key="one")
    assert isinstance(job, models.JobStatus)
    deadline = time.monotonic() + 60
    while not job.ended:
        assert time.monotonic() < deadline
        time.sleep(0.1)
        job = call("jobs.job", job.id)
    result = call("jobs.job_result", job.id)
    assert isinstance(result, models.RectifyResult)
    assert result.mesh.to_dict() == flat.mesh.to_dict()

    # A problem
    problem = call("layout_models.layout_model", "nobody")
    assert isinstance(problem, models.Problem)
    assert problem.code == "not-found"


CLIENT = """
import type { components, operations } from "./schema";
type Form = components["schemas"]["RectifyForm"];
type Result = components["schemas"]["RectifyResult"];
const form: Partial<Form> = { kind: "planar", format: "json", quality: 80 };
const width = (result: Result): number => result.width + result.mesh.rows;
const stages = (job: components["schemas"]["JobStatus"]): string | null => job.links.events ?? job.stage;
type Problem = operations["rectify"]["responses"]["422"]["content"]["application/problem+json"];
const told = (problem: Problem): string => problem.code + problem.detail;
export { form, width, stages, told };
"""


@NEEDS_NODE
def test_the_typescript_types_compile(document: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "openapi.json").write_text(json.dumps(document), encoding="utf-8")
    (tmp_path / "client.ts").write_text(CLIENT, encoding="utf-8")
    programs = NODE_MODULES / ".bin"
    made = subprocess.run(
        [programs / "openapi-typescript", tmp_path / "openapi.json", "-o", tmp_path / "schema.ts"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stderr
    assert "arn" not in made.stderr
    checked = subprocess.run(
        [programs / "tsc", "--noEmit", "--strict", "--skipLibCheck", tmp_path / "client.ts"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout
