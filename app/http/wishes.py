"""What a client prefers, in the header `Prefer` (RFC 7240)."""

from starlette.datastructures import Headers

RESPOND_ASYNC = "respond-async"


def prefers_async(headers: Headers) -> bool:
    """Whether the client prefers a job (`respond-async`)."""
    preferences = ",".join(headers.getlist("prefer")).split(",")
    return any(
        preference.partition(";")[0].partition("=")[0].strip().lower() == RESPOND_ASYNC
        for preference in preferences
    )
