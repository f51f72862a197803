"""Pages, photos and their analyses that several tests look at; each is made once."""

import pytest
from hypothesis import settings

from simulation.flat_page import Page
from tests.services.scenes import Album

# The time of one example says nothing on a busy machine; the same examples run every time.
settings.register_profile("laws", deadline=None, derandomize=True)
settings.load_profile("laws")


@pytest.fixture(scope="session")
def album() -> Album:
    """Simulated photos by name."""
    return Album()


@pytest.fixture(scope="session")
def pages(album: Album) -> tuple[Page, ...]:
    """The five pages of our own setting, 800 x 1250 px, 21 px to the em."""
    return album.pages()
