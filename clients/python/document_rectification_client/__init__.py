"""Client of the document rectification service: photos become flat pages, whole pages, and pages with labels."""

from document_rectification_client import calls
from document_rectification_client.calls import Call, File, Upload
from document_rectification_client.clients import AsyncClient, Client
from document_rectification_client.flows import Job
from document_rectification_client.models import (
    DocumentResult,
    JobStatus,
    LayoutResult,
    PlainMosaicResult,
    PlainPagesResult,
    StackResult,
)
from document_rectification_client.problems import ProblemError

__all__ = [
    "AsyncClient",
    "Call",
    "Client",
    "DocumentResult",
    "File",
    "Job",
    "JobStatus",
    "LayoutResult",
    "PlainMosaicResult",
    "PlainPagesResult",
    "ProblemError",
    "StackResult",
    "Upload",
    "calls",
]
