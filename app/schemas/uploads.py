"""Responses of /uploads."""

from datetime import datetime

from pydantic import Field

from models.records import StoredUpload
from services.contract.answers.page import Answer


class UploadState(Answer):
    """How far an upload in pieces has come."""

    id: str = Field(description="What a form takes as `upload`, in place of the file.")
    name: str | None = Field(description="Name of the file.")
    length: int = Field(ge=0, description="Number of bytes of the whole file.")
    offset: int = Field(ge=0, description="Bytes that have come; the next piece begins here.")
    created: datetime
    expires: datetime = Field(description="When it is deleted.")

    @classmethod
    def of(cls, upload: StoredUpload) -> "UploadState":
        """From what the store has."""
        return cls(
            id=upload.id,
            name=upload.name,
            length=upload.length,
            offset=upload.received,
            created=upload.created_at,
            expires=upload.expires_at,
        )
