"""Few lines among much other ink are a page where a sheet is seen and its print is level, else a picture."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from services.errors import NoText
from services.rectify.analysis.page_analysis import PICTURE_SHARE
from services.rectify.shape_choice import text_check
from services.rectify.shape_choice.text_check import SHEET_CONFIDENCE, LinesAcross, check_text
from services.sheet.tracing.line_tracing import FEW_LINES


@pytest.mark.parametrize("lines", [FEW_LINES - 1, FEW_LINES])
@pytest.mark.parametrize("is_level", [False, True])
@pytest.mark.parametrize("confidence", [None, SHEET_CONFIDENCE - 0.01, SHEET_CONFIDENCE])
def test_much_other_ink_needs_lines_or_level_print_on_a_sheet(
    lines: int, is_level: bool, confidence: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = np.eye(2, dtype=bool)
    monkeypatch.setattr(text_check, "_ink_in_view", lambda evidence, shape: rows)
    monkeypatch.setattr(text_check, "shows_print", lambda ink: is_level)
    analysis = SimpleNamespace(
        text=SimpleNamespace(rejected_fraction=PICTURE_SHARE + 0.01),
        characters=range(400),
        paper=SimpleNamespace(share=0.6),
    )
    shape = SimpleNamespace(sides_believed=False, ends_at_sides=False, line_count=lines)
    outline = None if confidence is None else SimpleNamespace(confidence=confidence)
    is_sheet = confidence == SHEET_CONFIDENCE
    is_page = is_sheet and is_level if lines < FEW_LINES else is_sheet or is_level
    message = f"only {lines} short lines" if lines < FEW_LINES else "no straight lines"
    with nullcontext() if is_page else pytest.raises(NoText, match=message):
        check_text(*cast(Any, (analysis, None, shape, outline)))


def test_rows_that_stand_upright_in_the_view_are_lines_across(monkeypatch: pytest.MonkeyPatch) -> None:
    upright = np.zeros((40, 20), dtype=bool)
    monkeypatch.setattr(text_check, "_ink_in_view", lambda evidence, shape: upright)
    monkeypatch.setattr(text_check, "shows_print", lambda ink: ink.shape == (20, 40))
    analysis = SimpleNamespace(
        text=SimpleNamespace(rejected_fraction=0.1), characters=range(400), paper=SimpleNamespace(share=1.0)
    )
    quarter = SimpleNamespace(jacobians=lambda at: np.array([[[0.0, 1.0], [-1.0, 0.0]]]))
    shape = SimpleNamespace(sides_believed=False, ends_at_sides=False, line_count=2, page_map=quarter)
    evidence = SimpleNamespace(characters=np.zeros((9, 2)))
    with pytest.raises(LinesAcross) as refusal:
        check_text(*cast(Any, (analysis, evidence, shape, None)))
    # The rows of the view run down the photo.
    assert abs(refusal.value.taken_rad) == pytest.approx(np.pi / 2)
