"""Headless Chromium, where it is installed (`make chromium`)."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
NEEDS_CHROMIUM = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (Debian: chromium)")
SECONDS = 120
"""A browser that has not finished after this long never will; on a busy machine it needs 20."""


@contextmanager
def browsing(url: str, *options: str) -> Iterator["subprocess.Popen[str]"]:
    """A browser that opens `url` and finds no host but this machine; it ends with the block."""
    assert CHROMIUM is not None
    with TemporaryDirectory() as profile:
        process = subprocess.Popen(
            [
                *(CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"),
                *("--no-first-run", "--disable-background-networking", f"--user-data-dir={profile}"),
                *("--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", *options, url),
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        try:
            yield process
        finally:
            process.kill()
            process.communicate()
