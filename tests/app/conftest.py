"""Services for the tests that only talk to them: one for all, and one a module that is emptied before each test."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from app.storage.layout_store import DATABASE
from tests.app.serving import forget_everything, serving
from tests.models.databases import make_file


@pytest.fixture(scope="session")
def client() -> Iterator[httpx.Client]:
    """A client of a service whose operations follow the script in the upload."""
    with serving(workers=2) as client:
        yield client


@pytest.fixture(scope="module")
def data_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the service of this module keeps what it remembers."""
    folder = tmp_path_factory.mktemp("data")
    make_file(folder / DATABASE)
    return folder


@pytest.fixture(scope="module")
def service_of_module(data_dir: Path) -> Iterator[httpx.Client]:
    """A service of this module's own; it has room for all that a test sends at once."""
    with serving(workers=2, queue_length=40, data_dir=data_dir) as client:
        yield client


@pytest.fixture
def empty_service(service_of_module: httpx.Client, data_dir: Path) -> httpx.Client:
    """The service of this module, which remembers nothing yet."""
    forget_everything(service_of_module, data_dir)
    return service_of_module
