"""The one form of every error."""

from pydantic import BaseModel, ConfigDict, Field


class Problem(BaseModel):
    """RFC 9457 problem details, with a stable `code` and the `request_id`."""

    model_config = ConfigDict(
        json_schema_extra={"required": ["type", "title", "status", "code", "detail", "request_id"]}
    )

    type: str = Field(
        default="about:blank", description="RFC 9457: the problem has no more semantics than its status."
    )
    title: str = Field(description="The status in words.")
    status: int = Field(ge=400, le=599, description="The HTTP status.")
    code: str = Field(description="Stable name of the problem, for programs.")
    detail: str = Field(description="What went wrong and what to do, for people.")
    field: str | None = Field(default=None, description="The form field concerned, if it is one.")
    request_id: str = Field(description="Also in the X-Request-ID header and in the server's log.")
