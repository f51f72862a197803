"""The requests for work that jobs are made of: of several kinds, on small photos, so that a thousand are affordable."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import httpx

from benchmarks.common.places import REPOSITORY

KEYS = ("first", "second", "third")
API_KEYS = ",".join(f"{key}:{key}" for key in KEYS)
WIDTH_PX = 500
"""Width of the photos: flattening one takes 1.5 s of processor time, its preview 0.4, recognizing a page 0.15."""
_ZONES = {
    "width": 600,
    "height": 800,
    "zones": [
        {"id": "a", "box": [10, 10, 200, 40], "text": "Dear Sir"},
        {"id": "b", "box": [10, 100, 500, 400], "text": "we thank you for your letter of 3 May 2024"},
    ],
}


@dataclass(frozen=True, slots=True)
class Request:
    """A request for work; `varying` are the names in its JSON that differ from one answer to the next."""

    path: str
    options: dict[str, str]
    image: bytes = b""
    varying: tuple[str, ...] = ()

    def send(self, client: httpx.Client, url: str, headers: dict[str, str]) -> httpx.Response:
        """The answer of the service at `url`."""
        files = {"image": ("photo", self.image)} if self.image else None
        return client.post(url + self.path, files=files, data=self.options, headers=headers)

    def essence(self, response: httpx.Response) -> object:
        """What must be equal in every answer: the bytes of an image; of JSON all but what varies."""
        if "json" not in response.headers["content-type"]:
            return response.status_code, response.content
        return response.status_code, {k: v for k, v in response.json().items() if k not in self.varying}


def mixed_requests() -> Sequence[Request]:
    """One request of every kind."""
    layout = ("id", "timings_ms")
    return (
        Request("/rectify", {"format": "json", "embed": "true"}, _reduced("d.jpg"), ("timings_ms",)),
        Request("/layout", {"ocr": "off"}, _reduced("letter-1.png"), layout),
        Request("/rectify", {"format": "json", "preview": "true"}, _reduced("c.jpg"), ("timings_ms",)),
        Request("/layout", {"zones": json.dumps(_ZONES)}, varying=layout),
        Request("/layout", {"ocr": "off", "format": "png"}, _reduced("letter-2.png")),
    )


def thousand_requests() -> Sequence[Request]:
    """Requests of all kinds, half of which take little time, so that a thousand jobs take 250 s of processor time."""
    flattening, page, preview, zones, overlay = mixed_requests()
    return (zones, page, zones, preview, zones, overlay, zones, page, zones, flattening)


def _reduced(name: str) -> bytes:
    """An example photo, `WIDTH_PX` wide, as JPEG."""
    photo = cv2.imread(str(REPOSITORY / "examples" / name))
    assert photo is not None
    height_px = round(photo.shape[0] * WIDTH_PX / photo.shape[1])
    small = cv2.resize(photo, (WIDTH_PX, height_px), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small)[1].tobytes()
