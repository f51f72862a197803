"""Few lines among much other ink are a page where a sheet is seen and its print is level, else a picture."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from services.rectify.analysis.page_analysis import PICTURE_SHARE
from services.rectify.shape_choice import text_check
from services.rectify.shape_choice.text_check import SHEET_CONFIDENCE, refusal_of_text
from services.sheet.tracing.line_tracing import FEW_LINES


@pytest.mark.parametrize("lines", [FEW_LINES - 1, FEW_LINES])
@pytest.mark.parametrize("is_level", [False, True])
@pytest.mark.parametrize("confidence", [None, SHEET_CONFIDENCE - 0.01, SHEET_CONFIDENCE])
def test_much_other_ink_needs_lines_or_level_print_on_a_sheet(
    lines: int, is_level: bool, confidence: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_check, "is_level_in_view", lambda evidence, shape: is_level)
    analysis = SimpleNamespace(
        text=SimpleNamespace(rejected_fraction=PICTURE_SHARE + 0.01),
    )
    shape = SimpleNamespace(sides_believed=False, ends_at_sides=False, line_count=lines)
    outline = None if confidence is None else SimpleNamespace(confidence=confidence)
    refusal = refusal_of_text(*cast(Any, (analysis, None, shape, outline)))
    is_sheet = confidence == SHEET_CONFIDENCE
    if lines < FEW_LINES:
        assert (refusal is None) == (is_sheet and is_level)
        assert refusal is None or f"only {lines} short lines" in refusal
    else:
        assert (refusal is None) == (is_sheet or is_level)
