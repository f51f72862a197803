import pytest

from benchmarks.layout.matching import format_row, measure_pages
from benchmarks.layout.simulated_cost_tables import EASY


@pytest.mark.parametrize("two_steps", [False, True])
def test_figures_are_of_every_page(two_steps: bool) -> None:
    figures = measure_pages(8, 4, 1.0, EASY, 3, two_steps=two_steps)
    assert len(figures) == 3
    assert all(figure.cpu_ms > 0.0 and 0.0 <= figure.right <= 1.0 for figure in figures)
    if not two_steps:
        assert all(figure.optimal and figure.gap == 0.0 for figure in figures)
    assert format_row("8 x 4", figures).startswith("8 x 4 ")
