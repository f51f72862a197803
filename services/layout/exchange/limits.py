"""Limits of zones from a client."""

from dataclasses import dataclass

from services.contract.layout import LONGEST_LABEL


@dataclass(frozen=True, slots=True)
class ExchangeLimits:
    """Limits of a page from a client. A page beyond a limit raises `InvalidLayout`."""

    max_zones: int = 500
    """The densest newspaper pages have some 300 blocks."""
    max_side: float = 100_000.0
    """Of the page, pixels: beyond any scan (A0 at 600 dpi has 28 000)."""
    max_id_length: int = 100
    max_label_length: int = LONGEST_LABEL
    max_text_length: int = 100_000
    """Characters of one zone; a page of fine print has 10 000."""
    max_content_features: int = 100
    """Table 5.1 has 12."""
    max_bytes: int = 8_388_608
    """Of a file; PAGE-XML with every word of a newspaper page has 4 MB."""
    max_elements: int = 400_000
    """Of an XML file: some 40 bytes an element in the densest files, so that `max_bytes` hold no more by much."""
    max_depth: int = 64
    """Of an XML file; PAGE-XML and ALTO nest to about 12."""
