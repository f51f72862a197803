"""Samples say which segmentation saw their image, and can be measured again when it has changed."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from services.contract.layout import LayoutSettings
from services.contract.layout_models import SEGMENTATION
from services.layout.segmentation import segment_page
from services.operations import layout_models
from services.operations.layout_models import import_sample, measure_sample, remeasure_sample

EXAMPLES = Path(__file__).parents[3] / "examples"
SETTINGS = LayoutSettings()
KNOWN = ("2026-11-27.2", "6832573bba6c9209")
"""Name of the segmentation, and the digest of the zones that it finds on the example pages."""


def digest_of_zones() -> str:
    """Of kinds and boxes, in whole pixels, on two pages of the project, without OCR."""
    zones = [
        (zone.kind, [round(edge) for edge in zone.box])
        for name in ("letter-1.png", "page.png")
        for zone in segment_page(np.asarray(Image.open(EXAMPLES / name).convert("L")), None).zones
    ]
    return hashlib.sha256(json.dumps(zones).encode()).hexdigest()[:16]


def test_another_segmentation_has_another_name() -> None:
    assert (SEGMENTATION, digest_of_zones()) == KNOWN, (
        "Segmentation finds other zones. Give SEGMENTATION (services/contract/layout_models.py) a new name, and write "
        "that name and this digest into KNOWN, so that operators know which samples to measure again."
    )


def test_a_sample_is_measured_again_as_if_it_came_today(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layout_models, "ocr_engine", lambda language: None)
    image = (EXAMPLES / "letter-2.png").read_bytes()
    today: Any = measure_sample(image, (EXAMPLES / "letter-2.json").read_bytes(), SETTINGS)
    assert today["segmentation"] == SEGMENTATION
    assert len(today["found"]["zones"]) > 5
    assert import_sample(json.dumps(today).encode(), SETTINGS) == today
    earlier = {
        **today,
        "segmentation": "2025",
        "found": {**today["found"], "zones": today["found"]["zones"][:1]},
    }
    assert remeasure_sample(image, earlier, SETTINGS) == today


def test_zones_alone_name_no_segmentation() -> None:
    sample = measure_sample(None, (EXAMPLES / "letter-1.json").read_bytes(), SETTINGS)
    assert not {"segmentation", "found"} & sample.keys()
