"""Answers of jobs in the form in which they are stored."""

import json

from starlette.responses import Response

from models.job_records import HeadJson, JobEnd, JobState


def failed(problem: Response, state: JobState = "failed") -> JobEnd:
    """The end of a job with a problem document."""
    body = bytes(problem.body).decode()
    head = head_of(problem)
    head["body"] = body
    return JobEnd(state, head, problem=json.loads(body))


def head_of(response: Response) -> HeadJson:
    """Status and headers of a response, as JSON."""
    headers = [(name.decode("latin-1"), value.decode("latin-1")) for name, value in response.raw_headers]
    return {"status": response.status_code, "headers": headers}
