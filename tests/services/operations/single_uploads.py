"""One uploaded photo, by the operation for documents of any number of pages."""

from services.contract.images import DocumentLimits, Encoding, ImageLimits, PageReply
from services.contract.rectify import RectifyParameters
from services.operations.rectify_documents import rectify_uploads


def rectify_upload(
    upload: bytes, parameters: RectifyParameters, encoding: Encoding, limits: ImageLimits
) -> PageReply:
    """The reply to one photo."""
    return rectify_uploads([upload], parameters, encoding, DocumentLimits(limits))
