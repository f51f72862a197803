"""Segmentation of whole pages: drawn letters and papers, and what must not break it."""

import numpy as np
import pytest

from models.layout_graph import Page
from services.layout.segmentation import segment_page
from tests.services.layout.segmentation.pages import (
    Box,
    drawing,
    sample,
    whole_share,
)

KINDS = ("letter", "memo", "plain", "two-column", "margin")


def boxes(page: Page) -> list[Box]:
    return [zone.box for zone in page.zones if zone.kind in ("text", "figure")]


def true_boxes(kind: str, seed: int, scale: float = 1.0) -> list[Box]:
    return [tuple(map(float, zone.box)) for zone in sample(kind, seed, scale).zones if zone.kind == "text"]  # type: ignore[misc]


@pytest.mark.parametrize("kind", KINDS)
def test_zones_of_drawn_pages_are_found_whole(kind: str) -> None:
    shares = [
        whole_share(true_boxes(kind, seed), boxes(segment_page(drawing(sample(kind, seed)), None)))
        for seed in (1, 2, 3)
    ]
    assert np.mean(shares) > 0.75
