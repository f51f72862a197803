"""Requests and responses with archives: many samples at once, classes with their samples."""

from typing import Literal

from fastapi import UploadFile
from pydantic import BaseModel, ConfigDict, Field

from app.schemas.layout import MOST_NAMES
from app.schemas.layout_models import NameInBody
from app.schemas.layout_settings import SettingsBody
from services.contract.answers.page import Answer


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

    files: list[str] = Field(
        description="Its files in the archive; of a long name the first 199 characters and `…`."
    )
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


class ImportProblem(FileProblem):
    """Why a file of the archive was not used."""

    file: str = Field(description="Of a long name the first 199 characters and `…`.")


class ImportedClass(Answer):
    """What became of one class of the archive."""

    name: str
    version: int | None = Field(description="Its newest version now; null: it has no model yet.")
    changed: bool = Field(description="Whether the archive's model became a new version.")
    samples_added: int = Field(ge=0)
    samples_known: int = Field(ge=0)
    problems: list[ImportProblem] = Field(
        description="Files that were not used; the first 1000 of all classes together."
    )
    more_problems: int = Field(ge=0, description="How many more there are.")


class ImportReport(Answer):
    """What became of the classes of an archive."""

    models: list[ImportedClass]


class ArchivedClass(BaseModel):
    """A class in the manifest of an archive."""

    name: NameInBody
    settings: SettingsBody


class Manifest(BaseModel):
    """The file `manifest.json` of an archive of classes."""

    format: Literal["layout-models"]
    format_version: Literal[1]
    models: list[ArchivedClass] = Field(max_length=MOST_NAMES)
