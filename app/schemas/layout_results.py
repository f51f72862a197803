"""Response of GET /layout/results."""

from datetime import datetime
from typing import Literal

from pydantic import ConfigDict, Field

from app.schemas.review import ReviewFacts
from services.contract.answers.layout import FileName, LabelField
from services.contract.answers.page import Answer
from services.contract.answers.tables import ItemTable

ListFormat = Literal["json", "csv", "jsonl", "xlsx"]
ListRows = Literal["values", "documents", "items"]
LIST_MEDIA_TYPES: dict[ListFormat, str] = {
    "json": "application/json",
    "csv": "text/csv",
    "jsonl": "application/jsonl",
    "xlsx": "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
}


class ResultEntry(Answer):
    """A kept result of one page, with the values of its fields and its tables."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)

    id: str = Field(description="As in /layout/results/{id}.")
    file_name: FileName
    created: datetime
    expires: datetime
    state: Literal["open", "confirmed", "corrected", "skipped"] = Field(
        description="open: no feedback. confirmed: feedback found nothing wrong. corrected: it found something wrong. "
        "skipped: a person has left it out."
    )
    class_: str | None = Field(alias="class", description="null: no class fits, or there is no model.")
    probability: float | None = Field(ge=0, le=1)
    fields: list[LabelField]
    tables: list[ItemTable] = Field(default=[], description="As in the result.")
    review: ReviewFacts | None = Field(description="null: the result is older than the review queue.")


class ResultList(Answer):
    """Results of pages in the requested order."""

    results: list[ResultEntry]
    next: str | None = Field(description="`cursor` of the next results; null: these were the last.")
