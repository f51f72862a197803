"""One process of the product for all tests that only talk to it."""

from collections.abc import Iterator

import httpx
import pytest
from PIL import Image

from simulation.pages import own_pages
from tests.end_to_end.processes import PRODUCT, Service, running


@pytest.fixture(scope="session")
def page() -> Image.Image:
    """A page of prose, 800 x 1200."""
    return Image.fromarray(own_pages(800, 1200)[0].image)


@pytest.fixture(scope="session")
def product() -> Iterator[Service]:
    """The product's process."""
    with running(PRODUCT, fresh=True, workers=1) as process:
        yield process


@pytest.fixture(scope="session")
def service(product: Service) -> Iterator[httpx.Client]:
    """A client of the product."""
    with httpx.Client(base_url=product.url, timeout=60) as client:
        yield client
