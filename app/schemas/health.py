"""Responses of the health routes."""

from typing import Literal

from pydantic import BaseModel, Field


class Live(BaseModel):
    """The server responds."""

    status: Literal["alive"] = "alive"


class Ready(BaseModel):
    """The server can process work."""

    status: Literal["ready"] = "ready"
    live_workers: int = Field(ge=0, description="Worker processes that are ready.")
    workers: int = Field(ge=0, description="Configured number of worker processes.")
    admitted: int = Field(ge=0, description="Requests that have a seat in the engine.")
    capacity: int = Field(ge=0, description="Seats: workers and places in the queue.")
    ocr: str | None = Field(description="The OCR engine that workers use; null: none is installed.")
    languages: list[str] = Field(description="Languages that it reads, by Tesseract's names.")
    disk: Literal["ready", "full"] = Field(
        description="Whether the folders for data and temporary files have MIN_FREE_DISK_BYTES of free space."
    )
    store: Literal["ready", "unavailable"] = Field(
        description="Whether the store can be read; if not, only /layout fails."
    )
    blobs: Literal["ready", "unavailable", "not-shared"] = Field(
        description="Whether the folder or the bucket for uploads and results of jobs can be written; `not-shared`: "
        "other processes of the same database have others, so that jobs fail (BLOB_URL)."
    )
    queue: Literal["ready", "unavailable"] = Field(description="Whether the queue of jobs can be read.")
    job_runners: int | None = Field(
        description="Processes that run jobs of this queue; null: the queue is unavailable."
    )
