"""One service for all tests that only talk to it."""

from collections.abc import Iterator

import httpx
import pytest

from tests.app.serving import serving


@pytest.fixture(scope="session")
def client() -> Iterator[httpx.Client]:
    """A client of a service whose operations follow the script in the upload."""
    with serving(workers=2) as client:
        yield client
