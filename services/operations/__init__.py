"""The entry points that a worker runs: bytes in, bytes and JSON out; a file for each flow.

`layout` and `layout_models` are asked for by their own names: their entry points are several.
"""

from services.operations.mosaic import MosaicImageLimits, mosaic_uploads
from services.operations.reader import ocr_engine
from services.operations.rectify import rectify_upload
from services.operations.replies import EncodingOptions, PageReply
from services.operations.warming import warm_up

__all__ = [
    "EncodingOptions",
    "MosaicImageLimits",
    "PageReply",
    "mosaic_uploads",
    "ocr_engine",
    "rectify_upload",
    "warm_up",
]
