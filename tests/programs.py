"""Programs of the machine that single tests need; without one, the test's reason says so."""

import shutil

import pytest

NEEDS_CURL = pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
