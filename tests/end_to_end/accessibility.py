"""Checks of WCAG 2.2 AA by axe-core, where it is installed (`make typescript` brings it with npm)."""

from pathlib import Path

import pytest
from playwright.sync_api import Page

AXE = Path(__file__).parent / "node_modules" / "axe-core" / "axe.min.js"
HAS_AXE = AXE.exists()
NEEDS_AXE = pytest.mark.skipif(not HAS_AXE, reason="axe-core is not installed (make typescript)")
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


def violations(page: Page) -> list[str]:
    """What axe finds wrong with the page as it is now; empty where axe is not installed.

    The script enters through the debugger's protocol, which the page's policy does not concern.
    """
    if not HAS_AXE:
        return []
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate("rules => axe.run(document, {runOnly: rules})", RULES)["violations"]
    return [f"{one['id']}: {node['html'][:160]}" for one in found for node in one["nodes"]]
