"""Page segmentation: zones of a page image, from the engine's words where there are any, else from ink alone."""

from services.layout.segmentation.appearance import with_appearance
from services.layout.segmentation.fine_page import FinePage, compose_page, compose_with_lines, text_zone
from services.layout.segmentation.measuring import measure_zones
from services.layout.segmentation.page import segment_finely, segment_page
from services.layout.segmentation.text_lines import Line

__all__ = [
    "FinePage",
    "Line",
    "compose_page",
    "compose_with_lines",
    "measure_zones",
    "segment_finely",
    "segment_page",
    "text_zone",
    "with_appearance",
]
