"""Responses of /jobs."""

from datetime import datetime

from pydantic import BaseModel, Field

from models.job_records import JobState
from services.contract.answers.problem import Problem


class JobLinks(BaseModel):
    """Paths of a job."""

    result: str = Field(description="The response of the work; 409 before its end.")
    events: str = Field(description="Server-sent events: the state whenever it changes.")


class JobDelivery(BaseModel):
    """One attempt to send a callback."""

    at: datetime
    status: int | None = Field(description="HTTP status of the answer; null: there was none.")
    failure: str | None = Field(description="What went wrong; null: it was delivered.")
    seconds: float = Field(ge=0, description="How long it took.")


class JobStatus(BaseModel):
    """State of a job."""

    id: str = Field(description="Random. The id, together with the API key, gives access to the result.")
    state: JobState = Field(description="The last three are final.")
    stage: str | None = Field(
        description="Current stage of the work, spelled as in `timings_ms`; `started` until the work reports one."
    )
    progress: float = Field(ge=0, le=1, description="Share of the work that is done; it never decreases.")
    attempts: int = Field(
        ge=0,
        description="How often a worker has started it; twice if the first worker ended before the work was done.",
    )
    created: datetime
    started: datetime | None = Field(description="When a worker started it, the last time.")
    ended: datetime | None
    problem: Problem | None = Field(
        description="Why it failed or was cancelled; /jobs/{id}/result responds with the same problem."
    )
    links: JobLinks = Field(description="Paths of the job, its result and its events.")
    poll_after_s: int | None = Field(
        description="Ask for the state again after this many seconds; null: the job has ended."
    )
    callback_url: str | None = Field(description="Where the state is sent at the job's end.")
    deliveries: list[JobDelivery] = Field(
        description="Attempts to send it; a failed one is repeated up to 5 times."
    )
