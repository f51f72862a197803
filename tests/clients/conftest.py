"""The scripted service for both clients."""

from collections.abc import Iterator

import pytest

from tests.app.serving import serving


@pytest.fixture(scope="session")
def url() -> Iterator[str]:
    """Where it is."""
    with serving() as client:
        yield str(client.base_url)
