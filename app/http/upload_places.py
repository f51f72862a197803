"""Places of requests whose bodies still arrive. They are bounded apart from the seats in the engine.

A seat is taken when the body is there. So a client that sends slowly keeps no worker and no place in the queue from
others. When all places are taken, the slowest upload gives its place to a new one if it is slower than the least rate.
"""

import asyncio
import time

from starlette.types import Message, Receive

from app.engine.base import Busy
from services.errors import DocumentError

_JUDGED_AFTER_S = 1.0
"""Age from which the rate of an upload is known well enough to take its place away."""


class BodyTooSlow(DocumentError):
    """The body did not arrive in time."""

    code = "request-timeout"


class UploadPlaces:
    """At most `most` uploads at once; one below `least_bytes_per_s` may lose its place to a new one."""

    def __init__(self, most: int, least_bytes_per_s: float) -> None:
        self._most = most
        self._least_bytes_per_s = least_bytes_per_s
        self._places: set[UploadPlace] = set()

    def enter(self) -> "UploadPlace":
        """A place; the caller must `leave` it.

        Raises
        ------
        Busy
            When all places are taken by uploads that are fast enough.
        """
        if len(self._places) >= self._most:
            slowest = min(self._places, key=UploadPlace.bytes_per_s)
            if slowest.bytes_per_s() >= self._least_bytes_per_s:
                raise Busy(
                    f"{self._most} uploads arrive at present (MAX_UPLOADS). Send the request again later."
                )
            slowest.lose()
        place = UploadPlace(self)
        self._places.add(place)
        return place

    def discard(self, place: "UploadPlace") -> None:
        """Free the place."""
        self._places.discard(place)


class UploadPlace:
    """The place of one upload, and what it has received."""

    def __init__(self, places: UploadPlaces) -> None:
        self._places = places
        self._since_s = time.monotonic()
        self._received_bytes = 0
        self._is_lost = False
        self._waiting: asyncio.Timeout | None = None

    def bytes_per_s(self) -> float:
        """Mean rate; infinite while it is not known."""
        age_s = time.monotonic() - self._since_s
        return self._received_bytes / age_s if age_s >= _JUDGED_AFTER_S else float("inf")

    async def receive(self, receive: Receive) -> Message:
        """The next message of `receive`. Raises `BodyTooSlow` when the place is lost meanwhile."""
        try:
            if self._is_lost:
                raise TimeoutError
            async with asyncio.timeout(None) as self._waiting:
                message = await receive()
        except TimeoutError:
            raise BodyTooSlow(
                "The body arrives too slowly (MIN_BODY_BYTES_PER_S), and others wait for its place. Send it again."
            ) from None
        finally:
            self._waiting = None
        self._received_bytes += len(message.get("body", b""))
        return message

    def lose(self) -> None:
        """Take the place away; a `receive` that waits raises."""
        self._is_lost = True
        self.leave()
        if self._waiting is not None:
            self._waiting.reschedule(asyncio.get_running_loop().time())

    def leave(self) -> None:
        """Free the place; repeated calls have no effect."""
        self._places.discard(self)
