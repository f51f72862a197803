"""The attacks, one row each, and what the service must answer."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import httpx

from benchmarks.attack import archives, images, keys, lists, mosaics, pdfs, pieces, races, texts
from benchmarks.attack.clients import (
    Answer,
    answer_of,
    hold_slowly,
    leave_early,
    part_head,
    request_head,
    send_raw,
)
from benchmarks.attack.row import Attack

_TIMEOUT_S = 90.0
_MB = b" " * 1_000_000
_SETTINGS = "/layout/models/letter/settings"


def _form(path: str, field: str, make: Callable[[], bytes], url: str) -> Answer:
    files = {field: ("a", make())}
    return answer_of(httpx.post(url + path, files=files, timeout=_TIMEOUT_S))


def _fields(path: str, fields: Mapping[str, str], url: str) -> Answer:
    return answer_of(httpx.post(url + path, data=dict(fields), timeout=_TIMEOUT_S))


def _body(method: str, path: str, make: Callable[[], bytes | str], url: str) -> Answer:
    headers = {"content-type": "application/json"}
    return answer_of(httpx.request(method, url + path, content=make(), headers=headers, timeout=_TIMEOUT_S))


def _raw(make: Callable[[], tuple[bytes, ...]], url: str) -> Answer:
    return send_raw(url, *make())


def _image(make: Callable[[], bytes]) -> Callable[[str], Answer]:
    return partial(_form, "/rectify", "image", make)


def _page(make: Callable[[], bytes]) -> Callable[[str], Answer]:
    return partial(_form, "/layout", "image", make)


def _xml(make: Callable[[], bytes]) -> Callable[[str], Answer]:
    return partial(_form, "/layout", "zones_file", make)


def _zones(make: Callable[[], str]) -> Callable[[str], Answer]:
    return lambda url: _fields("/layout", {"zones": make()}, url)


def _wire(*pieces: bytes) -> Callable[[str], Answer]:
    return partial(_raw, lambda: pieces)


def _options(**fields: Any) -> Callable[[str], Answer]:
    def send(url: str) -> Answer:
        files = {"image": images.picture()}
        return answer_of(httpx.post(url + "/rectify", files=files, data=fields, timeout=_TIMEOUT_S))

    return send


def _chunk(data: bytes) -> bytes:
    """A chunk of a body without a length."""
    return f"{len(data):x}\r\n".encode() + data + b"\r\n"


DAMAGED, LARGE, INVALID = ("undecodable-image",), ("too-large",), ("invalid-option",)
FOREIGN, BAD = ("unsupported-media-type",), ("bad-request",)

BODIES = (
    Attack("an empty form", _wire(request_head("/rectify", 0)), BAD),
    Attack(
        "a form without its boundary",
        _wire(request_head("/rectify", 5, content_type="multipart/form-data") + b"hello"),
        BAD,
    ),
    Attack("a form that is no form", _wire(request_head("/rectify", 5) + b"hello"), BAD),
    Attack("a form of JSON", partial(_body, "POST", "/rectify", texts.zones), BAD),
    Attack("an empty file", _image(lambda: b""), FOREIGN + BAD),
    Attack(
        "a file in a field of another name",
        partial(_form, "/rectify", "photo", images.picture),
        BAD + INVALID,
    ),
    Attack("1000 fields", _options(**{f"x{number}": "1" for number in range(1000)}), BAD + INVALID + LARGE),
    Attack("a field of 1 MB", _options(kind="x" * 1_000_000), BAD + INVALID + LARGE),
    Attack("a polygon of NaN", _options(region="[[NaN, 1], [2, 3], [4, 5]]"), INVALID),
    Attack("a focal length without end", _options(focal_length_px="1e999"), INVALID),
    Attack("an option with a line break", _options(format="png\r\nX-Evil: 1"), INVALID),
    Attack("200 MB declared", _wire(request_head("/rectify", 200_000_000)), LARGE),
    Attack("110 MB sent", _wire(request_head("/rectify", 110_000_000), *[_MB] * 110), LARGE, is_quick=False),
    Attack(
        "110 MB in chunks",
        _wire(request_head("/rectify", None), _chunk(part_head()), *[_chunk(_MB)] * 110),
        LARGE,
        is_quick=False,
    ),
    Attack(
        "32 MB of settings", _wire(request_head(_SETTINGS, 32_000_000, "PATCH", "application/json")), LARGE
    ),
    Attack("32 MB of settings as a form", _wire(request_head(_SETTINGS, 32_000_000, "PATCH")), LARGE),
    Attack("32 MB of a model", partial(_body, "PUT", "/layout/models/letter", lambda: _MB * 9), LARGE),
    Attack("18 clients at a byte a second", hold_slowly, ("no-text",)),
    Attack("clients that leave in the middle", leave_early, ("no-text",)),
    Attack(
        "a slow body",
        lambda url: send_raw(url, request_head("/rectify", 9999)),
        ("request-timeout",),
        is_quick=False,
    ),
)
JSON_BODIES = (
    Attack("lists 30,000 deep", partial(_body, "PATCH", _SETTINGS, lambda: texts.nested(30_000)), INVALID),
    Attack("zones 100,000 deep", _zones(texts.nested), INVALID),
    Attack("a number of 60,000 digits", _zones(texts.long_number), INVALID),
    Attack("5000 zones", _zones(texts.many_zones), INVALID + LARGE),
    Attack("a zone of NaN", _zones(lambda: texts.zones(width=float("nan"))), INVALID),
    Attack("a page of 1e300 pixels", _zones(lambda: texts.zones(width=1e300)), INVALID),
    Attack("a negative page", _zones(lambda: texts.zones(width=-5)), INVALID),
    Attack("true for a number", _zones(lambda: texts.zones(width=True)), INVALID),
    Attack(
        "half a surrogate",
        partial(_body, "PATCH", _SETTINGS, lambda: '{"genre": "\\ud800"}'),
        (*INVALID, "not-storable", "not-found"),
    ),
    Attack(
        "bytes that are no UTF-8", partial(_body, "PATCH", _SETTINGS, lambda: b'{"genre": "\xff"}'), INVALID
    ),
    Attack(
        "a model that is none",
        partial(_body, "PUT", "/layout/models/letter", lambda: "[]"),
        ("invalid-model",),
    ),
    Attack(
        "a model 100,000 deep",
        partial(_body, "PUT", "/layout/models/letter", texts.nested),
        ("invalid-model",),
    ),
    Attack(
        "a name with a path",
        lambda url: answer_of(httpx.get(url + "/layout/models/..%2f..%2fetc%2fpasswd")),
        ("not-found", *INVALID),
    ),
    Attack(
        "a name of 30,000 characters",
        lambda url: answer_of(httpx.get(url + "/layout/models/" + "a" * 30_000)),
        ("not-found", *INVALID),
    ),
)
XML_BODIES = (
    Attack("a billion laughs", _xml(texts.laughs), INVALID),
    Attack("a long entity 50,000 times", _xml(texts.quadratic), INVALID),
    Attack("an entity that is a file", _xml(lambda: texts.external("file:///etc/passwd")), INVALID),
    Attack("an entity that is an address", _xml(lambda: texts.external("http://127.0.0.1:1/")), INVALID),
    Attack("elements 200,000 deep", _xml(texts.deep_xml), INVALID),
    Attack("100,000 attributes", _xml(texts.many_attributes), INVALID),
    Attack("no XML", _xml(lambda: b"\0" * 1000), INVALID),
)
IMAGES = (
    Attack("900 megapixels in 1 kB", _image(images.png_of_900_megapixels), LARGE),
    Attack("a PNG of 100,000 chunks", _image(images.png_of_tiny_chunks), DAMAGED),
    Attack("a PNG with a text of 64 MB", _image(images.png_with_a_text_bomb), DAMAGED + LARGE + ("no-text",)),
    Attack("a PNG of one row", _image(images.png_without_rows), DAMAGED, is_quick=False),
    Attack("half a PNG", _image(lambda: images.picture("PNG")[:60]), DAMAGED),
    Attack("half a JPEG", _image(lambda: images.picture("JPEG", (640, 480))[:1200]), DAMAGED),
    Attack("a WebP of 268 megapixels in 25 bytes", _image(images.webp_of_a_large_canvas), LARGE + DAMAGED),
    Attack("a JPEG of a million segments", _image(images.jpeg_of_many_segments), DAMAGED),
    Attack("a JPEG of 2000 scans", _image(images.jpeg_of_many_scans), DAMAGED),
    Attack("a JPEG with 512 kB of EXIF", _image(images.jpeg_with_large_exif), LARGE),
    Attack(
        "a TIFF whose directory follows itself", _page(images.tiff_of_endless_directories), DAMAGED + FOREIGN
    ),
    Attack("a TIFF tag of four billion values", _image(images.tiff_of_many_values), DAMAGED + FOREIGN),
    Attack("a GIF", _image(lambda: images.picture("GIF")), FOREIGN),
    Attack("an SVG", _image(lambda: b"<svg xmlns='http://www.w3.org/2000/svg'/>"), FOREIGN),
    Attack("random bytes", _image(lambda: bytes(range(256)) * 400), FOREIGN),
)
PDFS = (
    Attack("a form that draws itself", _page(pdfs.draws_itself), DAMAGED),
    Attack("forms 60 deep", _page(pdfs.deep), LARGE),
    Attack("forms that draw a million others", _page(pdfs.exponential), LARGE),
    Attack("84 MB behind three filters", _page(pdfs.flate_bomb), LARGE),
    Attack("ten million saved states", _page(pdfs.saved_states), LARGE, is_quick=False),
    Attack("two million dashed strokes", _page(pdfs.strokes), LARGE, is_quick=False),
    Attack("transparency groups 30 deep", _page(pdfs.groups), LARGE, is_quick=False),
    Attack("half a PDF", _page(lambda: pdfs.page_of(b"n")[:200]), DAMAGED),
    Attack("a header alone", _page(lambda: b"%PDF-1.7\n"), DAMAGED),
)
ATTACKS = (
    *BODIES,
    *JSON_BODIES,
    *XML_BODIES,
    *IMAGES,
    *PDFS,
    *archives.ATTACKS,
    *mosaics.ATTACKS,
    *keys.ATTACKS,
    *races.ATTACKS,
    *lists.ATTACKS,
    *pieces.ATTACKS,
)
