"""Requests and responses with archives: many samples at once, classes with their samples."""

from typing import Literal

from fastapi import UploadFile
from pydantic import BaseModel, ConfigDict, Field

from app.schemas.page import Answer


class ArchiveForm(BaseModel):
    """A form with one ZIP archive."""

    model_config = ConfigDict(extra="forbid")

    archive: UploadFile = Field(description="A ZIP archive.")


class FileProblem(Answer):
    """Why a file was not used, and what to do."""

    code: str
    detail: str


class FileReport(Answer):
    """What became of one page of the archive."""

    files: list[str] = Field(description="Its files in the archive.")
    status: Literal["added", "known", "failed", "ignored"] = Field(
        description="known: the class had this sample before. ignored: no page (an image without labelled zones)."
    )
    id: str | None = Field(description="The sample; null: there is none.")
    problem: FileProblem | None


class SamplesReport(Answer):
    """What became of the pages of an archive."""

    model: str
    added: int = Field(ge=0)
    known: int = Field(ge=0)
    failed: int = Field(ge=0)
    ignored: int = Field(ge=0)
    pages: list[FileReport] = Field(description="In the order of the archive.")
