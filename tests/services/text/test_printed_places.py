"""Printed words of a page in views of it."""

import numpy as np
import pytest

from services.contract.rectify import PrintedWord, TypesetPage
from services.geometry.homographies import transform_points
from services.geometry.page_frame import turning
from services.ocr.printed_words import NOT_KNOWN
from services.text.printed_places import printed_in_view, printed_on_page

SIZE = 400, 200
PAGE = TypesetPage(
    0, (PrintedWord("near", (0.1, 0.1, 0.2, 0.2), 0), PrintedWord("far", (0.8, 0.8, 0.9, 0.9), 1)), False
)


def mesh_of(H_photo_view: np.ndarray, width: int, height: int) -> np.ndarray:
    places = np.stack(np.meshgrid(np.linspace(0, width - 1, 5), np.linspace(0, height - 1, 4)), axis=-1)
    return transform_points(H_photo_view, places.reshape(-1, 2)).reshape(4, 5, 2)


def boxes(words: tuple) -> list[tuple[str, list[float]]]:  # type: ignore[type-arg]
    return [(word.text, np.round(word.box, 6).tolist()) for word in words]


def test_on_the_page_itself() -> None:
    found = printed_on_page(PAGE, SIZE)
    assert boxes(found.words) == [("near", [40, 20, 80, 40]), ("far", [320, 160, 360, 180])]
    assert found.is_all
    assert {word.confidence for word in found.words} == {1.0}
    assert [word.line for word in found.words] == [0, 1]


def test_in_a_view_that_is_turned() -> None:
    """A word 40 px from the left and 20 from the top is as far from the top and the right after a quarter turn."""
    H, width, height = turning(*SIZE, 90, False)
    found = printed_in_view(PAGE, SIZE, mesh_of(H, width, height), (width, height))
    assert (width, height) == (200, 400)
    assert boxes(found.words) == [("near", [160, 40, 180, 80]), ("far", [20, 320, 40, 360])]


def test_in_a_part_that_is_enlarged() -> None:
    """Of the left upper quarter, twice as large; nodes that the photo does not show say nothing."""
    mesh = mesh_of(np.array([[0.5, 0, -0.25], [0, 0.5, -0.25], [0, 0, 1]]), 400, 200)
    mesh[0, 0] = np.nan
    found = printed_in_view(PAGE, SIZE, mesh, (400, 200))
    assert boxes(found.words) == [("near", [80, 40, 160, 80])]


@pytest.mark.parametrize("origin", ["photo", "page", TypesetPage(0)])
def test_pages_whose_words_are_not_known(origin: object) -> None:
    assert printed_on_page(origin, SIZE) is NOT_KNOWN  # type: ignore[arg-type]


def test_a_bent_view() -> None:
    mesh = mesh_of(np.eye(3), *SIZE)
    mesh[2, 2] += 9
    assert printed_in_view(PAGE, SIZE, mesh, SIZE) is NOT_KNOWN
