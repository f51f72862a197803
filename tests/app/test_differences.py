"""What counts as corrected, beside labels: zones, texts and cells."""

from copy import deepcopy
from typing import Any

import pytest

from app.learning.differences import is_corrected


def cell(text: str, top: float) -> dict[str, Any]:
    return {"text": text, "box": [100.0, top, 200.0, top + 20]}


def result() -> Any:
    """An invoice with two zones and a table of two rows."""
    return {
        "class": {"name": "invoice"},
        "zones": [
            {"id": "z1", "box": [10.0, 10.0, 90.0, 30.0], "label": "date", "text": "3 May 2026"},
            {"id": "z2", "box": [100.0, 50.0, 200.0, 90.0], "label": None, "text": "12.00 7.50"},
        ],
        "tables": [
            {
                "columns": ["item", "price"],
                "rows": [[cell("Tea", 50), cell("12.00", 50)], [None, cell("7.50", 70)]],
            }
        ],
    }


def swap_cells(shown: Any) -> None:
    rows = shown["tables"][0]["rows"]
    rows[0][1], rows[1][1] = rows[1][1], rows[0][1]


def fill_cell(shown: Any) -> None:
    shown["tables"][0]["rows"][1][0] = cell("Milk", 70)


def drop_row(shown: Any) -> None:
    shown["tables"][0]["rows"].pop()


def drop_zone(shown: Any) -> None:
    shown["zones"].pop(0)


def move_zone(shown: Any) -> None:
    shown["zones"][0]["box"][2] += 5


def write_text(shown: Any) -> None:
    shown["zones"][0]["text"] = "8 May 2026"


def change_class(shown: Any) -> None:
    shown["class"] = None


@pytest.mark.parametrize(
    "correct", [swap_cells, fill_cell, drop_row, drop_zone, move_zone, write_text, change_class]
)
def test_what_a_person_changes_is_a_correction(correct: Any) -> None:
    shown = deepcopy(result())
    correct(shown)
    assert is_corrected(result(), shown)


def test_what_stays_is_none() -> None:
    assert not is_corrected(result(), result())


def test_a_cell_that_is_drawn_as_it_was_found_is_none() -> None:
    shown = deepcopy(result())
    # The zone of both prices gave way to the cells that were drawn on it.
    shown["zones"][1:] = [
        {"id": "n1", "box": [98.0, 49.0, 201.0, 71.0], "label": "price", "text": "12.00"},
        {"id": "n2", "box": [98.0, 69.0, 201.0, 91.0], "label": "price", "text": "7.50"},
    ]
    assert not is_corrected(result(), shown)
    shown["tables"][0]["rows"][0][1]["text"] = "13.00"
    assert is_corrected(result(), shown)
