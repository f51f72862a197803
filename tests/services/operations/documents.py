"""Answers of workers as the JSON that a client gets."""

from typing import Any

from services.contract.answers.rectify import PagesResult
from services.contract.images import PageReply


def document_of(reply: PageReply) -> dict[str, Any]:
    """The answer of `reply` as JSON; a page that failed has its problem without what only the app knows."""
    document = reply.answer.model_dump(mode="json")
    if isinstance(reply.answer, PagesResult):
        for each in reply.failed:
            problem = {"code": each.code, "detail": each.detail, "field": each.field}
            document["pages"].insert(each.place, {"problem": problem})
    return document
