"""Which HTML element a zone becomes: by the settings of its class, else by its kind and the name of its label."""

import re
from collections.abc import Mapping

from services.contract.html import HtmlElement
from services.layout.page import Kind

_BY_NAME: Mapping[str, HtmlElement] = {
    **dict.fromkeys(("title", "headline"), "h1"),
    **dict.fromkeys(("section-title", "heading", "subtitle", "subject"), "h2"),
    **dict.fromkeys(("address", "letterhead", "sender", "receiver", "recipient"), "address"),
    **dict.fromkeys(("affiliation", "correspondence"), "address"),
    "header": "header",
    **dict.fromkeys(("footer", "page-number"), "footer"),
    **dict.fromkeys(("footnote", "margin-note", "note"), "aside"),
    "caption": "figcaption",
    **dict.fromkeys(("figure", "picture", "image", "photo", "logo", "stamp", "table"), "figure"),
    **dict.fromkeys(("signature", "handwriting"), "figure"),
    "list": "ul",
    "code": "pre",
    "noise": "none",
}
"""Elements of labels that are usual names; the labels of the dissertation and of the development pages among them."""
_BY_KIND: Mapping[Kind, HtmlElement] = {"text": "p", "figure": "figure", "rule": "none", "noise": "none"}


def choose_element(kind: Kind, label: str | None, elements: Mapping[str, HtmlElement]) -> HtmlElement:
    """The element of a zone; `elements` has those that the settings of the class name, by label.

    Without a setting, pictures, rules and specks are judged by their kind, and text by its label: by the whole name, or
    by its last word (`invoice-title` is a title).
    """
    if label is not None and label in elements:
        return elements[label]
    if kind != "text" or label is None:
        return _BY_KIND[kind]
    name = re.sub(r"[\s_]+", "-", label.strip().lower())
    return _BY_NAME.get(name) or _BY_NAME.get(name.rpartition("-")[2]) or _BY_KIND[kind]
