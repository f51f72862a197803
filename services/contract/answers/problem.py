"""Body of every error response."""

from pydantic import BaseModel, ConfigDict, Field


class Problem(BaseModel):
    """RFC 9457 problem details, with a stable `code` and the `request_id`."""

    model_config = ConfigDict(
        json_schema_extra={"required": ["type", "title", "status", "code", "detail", "request_id"]}
    )

    type: str = Field(
        default="about:blank", description="RFC 9457: the status says all about the kind of problem."
    )
    title: str = Field(description="The status in words.")
    status: int = Field(ge=400, le=599, description="The HTTP status.")
    code: str = Field(description="Stable name of the problem, for programs.")
    detail: str = Field(description="What happened and what to do, for people.")
    field: str | None = Field(default=None, description="The request field concerned, if any.")
    request_id: str = Field(description="Also in the X-Request-ID header and in the server's log.")
