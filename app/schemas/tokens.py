"""Response of POST /tokens."""

from datetime import datetime

from pydantic import BaseModel, Field


class Token(BaseModel):
    """Right to read for a short time, without the API key."""

    token: str = Field(description="For the query option `token` of GET requests.")
    expires: datetime
    ttl_s: int = Field(ge=1, description="Seconds until it expires (TOKEN_TTL_S).")
