"""Fates of true zones, each by the definition."""

import numpy as np

from benchmarks.layout.segmentation_matching import match_zones
from services.layout.page import Kind, Page, Zone

Box = tuple[float, float, float, float]


def page(*boxes: Box, kind: Kind = "text") -> Page:
    return Page(1000.0, 1000.0, tuple(Zone(str(index), box, kind) for index, box in enumerate(boxes)))


LINE: Box = (0.0, 0.0, 200.0, 10.0)
BLOCK: Box = (0.0, 100.0, 200.0, 200.0)


def test_fates() -> None:
    assert match_zones(page(LINE, BLOCK), page(LINE, BLOCK)).fates == ("whole", "whole")
    # A line two pixels too high is another box, but nobody else's.
    assert match_zones(page(LINE), page((0.0, -3.0, 200.0, 13.0))).fates == ("whole",)
    assert match_zones(page(LINE, BLOCK), page((0.0, 0.0, 200.0, 200.0))).fates == ("merged", "merged")
    halves = page((0.0, 100.0, 200.0, 148.0), (0.0, 152.0, 200.0, 200.0))
    assert match_zones(page(BLOCK), halves).fates == ("split",)
    assert match_zones(page(BLOCK), page((0.0, 100.0, 200.0, 140.0))).fates == ("missed",)
    assert match_zones(page(BLOCK), page((0.0, 100.0, 200.0, 400.0))).fates == ("off",)


def test_spurious_zones_are_those_of_nothing() -> None:
    matching = match_zones(page(BLOCK), page(BLOCK, (500.0, 500.0, 600.0, 600.0)))
    assert matching.spurious.tolist() == [False, True]


def test_rules_and_noise_are_nobodys() -> None:
    matching = match_zones(page(BLOCK), page(BLOCK, kind="rule"))
    assert matching.fates == ("missed",)
    assert matching.spurious.shape == (0,)
    assert np.all(match_zones(page(), page(BLOCK)).spurious)
