"""What changes by itself between two runs of the same requests, made the same again: ids, times, durations, secrets.

So a diff of docs/api/ shows what a change of the service has changed.
"""

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime, parsedate_to_datetime
from typing import Any

NOW = datetime(2026, 11, 27, 9, 0, tzinfo=UTC)
"""When every answer is given, as the pages say."""
ULID = re.compile(r"\b01[0-9A-HJKMNP-TV-Z]{24}\b")
LONG_HEX = re.compile(r"\b[0-9a-f]{32}\b")
SECRET = re.compile(r'(?<="claim":")[\w-]{20,}|(?<="token":")[\w-]{20,}')
ISO_TIME = re.compile(r"\b20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:Z|\+00:00)")
HTTP_DATE = re.compile(r"\b(?:Mon|Tue|Wed|Thu|Fri|Sat|Sun), \d\d \w{3} 20\d\d \d\d:\d\d:\d\d GMT")
DURATIONS = "timings_ms"


class Stable:
    """Replaces in texts what a run has by chance; the same id has the same replacement in all texts."""

    def __init__(self) -> None:
        self._ids: dict[str, str] = {}

    def text(self, text: str) -> str:
        """The text with ids by their order, and times that do not depend on when it was made."""
        text = ULID.sub(self._by_order("01M8D4JH2J0H6W8XXK81M6C{:03}"), text)
        text = LONG_HEX.sub(self._by_order("48d675bde9ac48dea8a9c156a4105{:03}"), text)
        text = SECRET.sub(self._by_order("3v1Z8d0LqkU0n0Qb1y{:03}"), text)
        text = ISO_TIME.sub(
            lambda found: _as_of_now(datetime.fromisoformat(found[0])).strftime("%FT%TZ"), text
        )
        return HTTP_DATE.sub(
            lambda found: format_datetime(_as_of_now(parsedate_to_datetime(found[0])), usegmt=True), text
        )

    def _by_order(self, form: str) -> Callable[[re.Match[str]], str]:
        return lambda found: self._ids.setdefault(found[0], form.format(len(self._ids) + 1))


def with_durations_of(new: Any, old: Any) -> Any:
    """The new answer; durations are those of the old one, where it has the same ones."""
    if isinstance(new, list) and isinstance(old, list):
        kept = [with_durations_of(*both) for both in zip(new, old, strict=False)]
        return [*kept, *new[len(kept) :]]
    if not (isinstance(new, dict) and isinstance(old, dict)):
        return new
    if (
        DURATIONS in new
        and isinstance(old.get(DURATIONS), dict)
        and old[DURATIONS].keys() == new[DURATIONS].keys()
    ):
        new = {**new, DURATIONS: old[DURATIONS]}
    return {key: with_durations_of(value, old.get(key)) for key, value in new.items()}


def _as_of_now(time: datetime) -> datetime:
    """The time as if the answer had been given at `NOW`: what has been is now, what will be is so far away."""
    ahead = time - datetime.now(UTC)
    unit = timedelta(hours=1) if ahead > timedelta(hours=1) else timedelta(minutes=1)
    return NOW + max(round(ahead / unit), 0) * unit
