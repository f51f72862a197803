"""What goes wrong."""

from http import HTTPStatus

import httpx

from document_rectification_client.waiting import retry_after

PROBLEM = "application/problem+json"


class ProblemError(Exception):
    """The service refused a request, or could not be asked; the text is what happened and what to do.

    `code` is the service's stable name of the problem, and `field` the option or part that it is about. Names of this
    client's own are `unreachable` (`status` is 0: there is no answer), and `unexpected-answer`: what came is not of
    the service. `retry_after_s` are the seconds after which the service asks to come again.
    """

    def __init__(
        self,
        detail: str,
        code: str,
        status: int = 0,
        field: str | None = None,
        request_id: str | None = None,
        retry_after_s: float | None = None,
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.code = code
        self.status = status
        self.field = field
        self.request_id = request_id
        self.retry_after_s = retry_after_s


def problem_of(failure: httpx.Response | httpx.TransportError) -> ProblemError:
    """The problem that an answer tells, or that there is none."""
    if isinstance(failure, httpx.TransportError):
        return ProblemError(f"The service cannot be reached: {str(failure).rstrip('.')}.", "unreachable")
    status, wait = failure.status_code, retry_after(failure)
    try:
        document = failure.json() if failure.headers.get("content-type", "").startswith(PROBLEM) else {}
        return ProblemError(
            str(document["detail"]),
            str(document["code"]),
            status,
            document.get("field"),
            document.get("request_id"),
            wait,
        )
    except (ValueError, KeyError):
        words = f"{status} {HTTPStatus(status).phrase}" if status in set(HTTPStatus) else str(status)
        return ProblemError(
            f"The answer is {words}, without a reason.", "unexpected-answer", status, None, None, wait
        )
