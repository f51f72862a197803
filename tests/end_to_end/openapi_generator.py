"""openapi-generator, which makes clients for phones; it needs Java (`make java`)."""

import importlib.util
import shutil
from pathlib import Path

import pytest

from tests.counts import IS_LONG

_PACKAGE = importlib.util.find_spec("openapi_generator_cli")
ARCHIVE = Path(_PACKAGE.origin).with_name("openapi-generator.jar") if _PACKAGE and _PACKAGE.origin else None
"""The program, for `java -jar`."""
HAS_GENERATOR = ARCHIVE is not None and shutil.which("java") is not None
NEEDS_GENERATOR = pytest.mark.skipif(
    not (IS_LONG and HAS_GENERATOR), reason="part of make test-long, with openapi-generator and Java"
)
"""Two runs of the generator take 7 CPU s; `make test` holds the document itself to what breaks these clients."""
