"""The face that every shape of a page has."""

from typing import Literal

ShapeSource = Literal["text", "outline", "rules"]
"""What can show the page's shape: its text, the sheet's outline, straight print that is no text."""
