"""One process of the product for all tests that only talk to it."""

from collections.abc import Iterator

import httpx
import pytest
from PIL import Image

from simulation.pages import own_pages
from tests.end_to_end.processes import PRODUCT, running


@pytest.fixture(scope="session")
def page() -> Image.Image:
    """A page of prose, 800 x 1200."""
    return Image.fromarray(own_pages(800, 1200)[0].image)


@pytest.fixture(scope="session")
def service() -> Iterator[httpx.Client]:
    """A client of the product."""
    with running(PRODUCT, workers=1) as process, httpx.Client(base_url=process.url, timeout=60) as client:
        yield client
