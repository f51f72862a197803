"""What the health probes answer."""

from typing import Literal

from pydantic import BaseModel, Field


class Live(BaseModel):
    """The server answers."""

    status: Literal["alive"] = "alive"


class Ready(BaseModel):
    """The server can do work."""

    status: Literal["ready"] = "ready"
    live_workers: int = Field(ge=1, description="Worker processes that are up.")
    workers: int = Field(ge=1, description="Worker processes that there should be.")
    admitted: int = Field(ge=0, description="Requests that have a seat.")
    capacity: int = Field(ge=1, description="Seats: workers and places in the queue.")
    ocr: str | None = Field(description="The OCR engine that workers found, if any.")
    store: Literal["ready", "unavailable"] = Field(
        description="Whether what is remembered can be read; without it only /layout fails."
    )
