"""HTML of labelled pages: the elements that settings of a class may name, and kept pages that become a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

HtmlElement = Literal[
    "h1", "h2", "h3", "h4", "h5", "h6", "p", "ul", "ol", "address", "blockquote", "pre",
    "header", "footer", "aside", "figure", "figcaption", "img", "none",
]  # fmt: skip
"""Element of a zone. `ul`, `ol`: every line is an item. `figure`, `img`: the zone is cut out of the picture of the
page. `figcaption`: the caption of the figure before or after it. `none`: the zone is left out."""


@dataclass(frozen=True, slots=True)
class KeptPage:
    """A stored result that becomes a page of an HTML file.

    `document` is its `LayoutResult` without the id. `picture` is a JPEG file of the page; empty: none is kept.
    `elements` has the elements of labels that the settings of the class name.
    """

    document: dict[str, object]
    picture: bytes = b""
    elements: Mapping[str, HtmlElement] = field(default_factory=dict)
