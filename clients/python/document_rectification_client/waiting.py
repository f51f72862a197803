"""How long to wait before a request is sent again."""

from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

import httpx

FIRST_WAIT_S = 0.5
"""Before the second try where the service names no time; it doubles with each try."""


def retry_after(response: httpx.Response) -> float | None:
    """Seconds that the answer asks to wait: its header `Retry-After`, a number or a date. None: it does not ask."""
    text = response.headers.get("Retry-After", "")
    if text.isdecimal():
        return float(text)
    try:
        date = parsedate_to_datetime(text)
    except ValueError:
        return None
    return max(0.0, (date.replace(tzinfo=date.tzinfo or UTC) - datetime.now(UTC)).total_seconds())


def wait_before(attempt: int, failure: httpx.Response | httpx.TransportError) -> float:
    """Seconds before the try after number `attempt`, from 1, which failed so."""
    asked = retry_after(failure) if isinstance(failure, httpx.Response) else None
    return FIRST_WAIT_S * 2 ** (attempt - 1) if asked is None else asked
