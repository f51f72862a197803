"""Requests and responses of the review queue and of the list of changes; the decision of a result."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from services.contract.answers.page import Answer

LONGEST_CLAIM = 64


class ReviewFacts(Answer):
    """What the review queue knows of a page."""

    zones: int
    confidence: float = Field(
        description="Least probability of a zone that its class and its label are right."
    )
    gain: float = Field(
        description="Expected number of zones with a wrong label: what a correction can teach."
    )
    decision: Literal["accept", "review"]
    has_image: bool = Field(description="GET /layout/results/{id}/image has its picture.")
    claimed_by: str | None = Field(description="Name of the API key that works on it; null without keys.")
    claimed_until: datetime | None = Field(description="null: nobody works on it.")


class ClaimBody(BaseModel):
    """The claim that the caller has on the page."""

    model_config = ConfigDict(extra="forbid", strict=True)

    claim: str | None = Field(
        default=None, max_length=LONGEST_CLAIM, description="`claim` of the response to POST .../claim."
    )


class ClaimRequest(ClaimBody):
    """A new claim, or a claim to be renewed."""

    reopen: bool = Field(
        default=False, description="Claim the page also if it is skipped or verified, to look at it again."
    )
    recognize: bool = Field(
        default=False,
        description="Recognize the page again if its models have learned since; then read the result. Its zones stay.",
    )


class Claim(Answer):
    """A page that the caller may work on until the claim expires."""

    result: str
    claim: str = Field(description="Send it to renew or release the claim, or to skip the page.")
    until: datetime
    recognized_again: bool = Field(
        description="The result has changed: newer models have recognized the page."
    )


class AuditEntry(Answer):
    """Who changed what, and when."""

    id: str
    time: datetime
    who: str | None = Field(description="Name of the API key; null: the service has no keys.")
    action: str
    model: str | None
    detail: str


class ChangeList(Answer):
    """Changes, newest first; the header `Link` has the address of the next ones."""

    entries: list[AuditEntry]
