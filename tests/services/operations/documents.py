"""Answers of workers as the JSON that a client gets."""

from typing import Any

from services.contract.answers.rectify import PagesResult
from services.contract.images import PageReply
from services.contract.layout import DocumentPage, DocumentReply, LayoutReply


def document_of(reply: PageReply | LayoutReply | DocumentReply | DocumentPage) -> dict[str, Any]:
    """The answer of `reply` as JSON, its id empty; a page that failed has what is known of its problem."""
    document = reply.answer.model_dump(mode="json")
    if isinstance(reply, PageReply) and isinstance(reply.answer, PagesResult):
        for each in reply.failed:
            problem = {"code": each.code, "detail": each.detail, "field": each.field}
            document["pages"].insert(each.place, {"problem": problem})
    return document
