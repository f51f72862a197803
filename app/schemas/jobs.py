"""What /jobs answers."""

from datetime import datetime

from pydantic import BaseModel, Field

from app.jobs import JobState
from app.schemas.problem import Problem


class JobStatus(BaseModel):
    """Long work, as it stands."""

    id: str = Field(description="Not to be guessed; whoever has it, and the API key, has the result.")
    state: JobState = Field(description="The last three are final.")
    stage: str | None = Field(description="What is being done; `started` until the work says more.")
    progress: float = Field(ge=0, le=1, description="Share of the work that is done; never goes back.")
    created: datetime
    started: datetime | None = Field(description="When a worker took it.")
    ended: datetime | None
    problem: Problem | None = Field(
        description="Why it failed or was cancelled; as /jobs/{id}/result answers."
    )
