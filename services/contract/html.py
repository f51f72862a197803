"""HTML of labelled pages: the elements that settings of a class may name."""

from typing import Literal

HtmlElement = Literal[
    "h1", "h2", "h3", "h4", "h5", "h6", "p", "ul", "ol", "address", "blockquote", "pre",
    "header", "footer", "aside", "figure", "figcaption", "img", "none",
]  # fmt: skip
"""Element of a zone. `ul`, `ol`: every line is an item. `figure`, `img`: the zone is cut out of the picture of the
page. `figcaption`: the caption of the figure before or after it. `none`: the zone is left out."""
