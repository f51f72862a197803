"""Checks of WCAG 2.2 AA by axe-core, where it is installed (`make typescript` brings it with npm)."""

from pathlib import Path

import pytest
from playwright.sync_api import Page

AXE = Path(__file__).parent / "node_modules" / "axe-core" / "axe.min.js"
HAS_AXE = AXE.exists()
NEEDS_AXE = pytest.mark.skipif(not HAS_AXE, reason="axe-core is not installed (make typescript)")
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
CHECK = """async (rules) => {
  const found = await axe.run(document, { runOnly: rules, resultTypes: ["violations"] });
  return found.violations.flatMap((one) => one.nodes.map((node) => `${one.id}: ${node.html.slice(0, 160)}`));
}"""
"""What passes is neither described nor sent, which took four fifths of the time."""


def violations(page: Page) -> list[str]:
    """What axe finds wrong with the page as it is now; empty where axe is not installed.

    The script enters through the debugger's protocol, which the page's policy does not concern.
    """
    if not HAS_AXE:
        return []
    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE.read_text(encoding="utf-8"))
    found: list[str] = page.evaluate(CHECK, RULES)
    return found
