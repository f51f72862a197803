"""Responses of /layout/unknown-pages and /layout/proposals."""

from datetime import datetime

from pydantic import Field

from app.schemas.layout_samples import PageZone
from services.contract.answers.page import Answer


class UnknownPageSummary(Answer):
    """A page that fits no class, without its zones."""

    id: str
    result: str = Field(description="Id of the result of the page; the result may have expired.")
    zones: int = Field(ge=0)
    created: datetime


class UnknownPageList(Answer):
    """Pages that fit no class, newest first."""

    pages: list[UnknownPageSummary]


class UnknownPage(Answer):
    """A page that fits no class, with all measured properties.

    After its zones are labelled, it can be sent to POST /layout/models/{name}/samples unchanged.
    """

    id: str
    result: str
    created: datetime
    width: float
    height: float
    zones: list[PageZone]
