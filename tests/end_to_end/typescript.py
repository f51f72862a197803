"""The programs that make and check TypeScript types, where they are installed (`make typescript`)."""

import shutil
from pathlib import Path

import pytest

NODE_MODULES = Path(__file__).parent / "node_modules"
HAS_TYPESCRIPT = shutil.which("node") is not None and (NODE_MODULES / ".bin" / "openapi-typescript").exists()
NEEDS_NODE = pytest.mark.skipif(
    not HAS_TYPESCRIPT, reason="openapi-typescript is not installed (make typescript)"
)
