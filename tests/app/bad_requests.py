"""Bad requests, and the problem that each of them gets."""

from dataclasses import dataclass
from typing import Any

import httpx

from tests.app.scripts import upload

PHOTO = ("photo.jpg", upload(""))


@dataclass(frozen=True, slots=True)
class Bad:
    """One bad request; `words` are in the detail, which must say what to do."""

    name: str
    method: str
    path: str
    send: dict[str, Any]
    status: int
    code: str
    field: str | None
    words: str

    def sent_by(self, client: httpx.Client) -> httpx.Response:
        """The response to this request."""
        return client.request(self.method, self.path, **self.send)


def rectify(name: str, field: str | None, words: str, status: int = 422, code: str = "", **send: Any) -> Bad:
    """A bad request to /rectify; without `files` its photo is good."""
    return _form("/rectify", {"files": {"image": PHOTO}, **send}, name, field, words, status, code)


def mosaic(name: str, field: str | None, words: str, status: int = 422, code: str = "", **send: Any) -> Bad:
    """A bad request to /mosaic; without `files` its two photos are good."""
    return _form("/mosaic", {"files": [("images", PHOTO)] * 2, **send}, name, field, words, status, code)


def layout(name: str, field: str | None, words: str, status: int = 422, code: str = "", **send: Any) -> Bad:
    """A bad request to /layout; without `files` its page is good."""
    return _form("/layout", {"files": {"image": PHOTO}, **send}, name, field, words, status, code)


def other(
    name: str,
    request: str,
    field: str | None,
    words: str,
    status: int = 422,
    code: str = "",
    **send: Any,
) -> Bad:
    """A bad request to another path; `request` is its method and path."""
    method, path = request.split(" ", 1)
    return Bad(name, method, path, send, status, code or _CODES[status], field, words)


def _form(
    path: str, send: dict[str, Any], name: str, field: str | None, words: str, status: int, code: str
) -> Bad:
    query = send.pop("query", "")
    method = send.pop("method", "POST")
    if "content" in send:
        send.pop("files")
    return Bad(name, method, path + query, send, status, code or _CODES[status], field, words)


_CODES = {
    400: "bad-request",
    404: "not-found",
    405: "method-not-allowed",
    406: "not-acceptable",
    409: "conflict",
    412: "conflict",
    413: "too-large",
    415: "unsupported-media-type",
    422: "invalid-option",
}
MULTIPART = {"Content-Type": "multipart/form-data; boundary=x"}
LATER = {"Prefer": "respond-async"}
BIG = "1" * 70_000

RECTIFY = [
    rectify("no body", "image", "send the photo as a file part", 400, files=None),
    rectify("JSON in place of a form", "image", "multipart/form-data", 400, content=b"{}",
        headers={"Content-Type": "application/json"}),
    rectify("another kind of form", "image", "multipart/form-data", 400, files=None, data={"kind": "planar"}),
    rectify("no boundary", None, "boundary", 400, content=b"x", headers={"Content-Type": "multipart/form-data"}),
    rectify("no form in the body", None, "cannot be read", 400, content=b"nonsense", headers=MULTIPART),
    rectify("a part without a name", None, "name", 400,
        content=b"--x\r\nContent-Disposition: form-data\r\n\r\n1\r\n--x--\r\n", headers=MULTIPART),
    rectify("the photo as text", "image", "must be a file", 400, files=None,
        content=b'--x\r\nContent-Disposition: form-data; name="image"\r\n\r\n1\r\n--x--\r\n', headers=MULTIPART),
    rectify("the photo as `photo`", "photo", "send the file as `image`", files={"photo": PHOTO}),
    rectify("the photo as `images`", "images", "send the file as `image`", files={"images": PHOTO}),
    rectify("a second file of another name", "back", "send the file as `image`",
        files={"image": PHOTO, "back": PHOTO}),
    rectify("more photos than a document may have", "image", "20 pages (MAX_PAGES)", 413,
        files=[("image", PHOTO)] * 21),
    rectify("several photos and a format of one page", "format", "the format holds one", 406,
        files=[("image", PHOTO)] * 2, data={"format": "jpeg"}),
    rectify("an option twice", "kind", "sent 2 times; send it once", data={"kind": ["planar", "curved"]}),
    rectify("an option twice, equal", "quality", "sent 2 times", data={"quality": ["90", "90"]}),
    rectify("an option as a file", "kind", "without a filename",
        files={"image": PHOTO, "kind": ("kind.txt", b"planar")}),
    rectify("a misspelled option", "regoin", "did you mean `region`?", data={"regoin": "[[1,2],[3,4],[5,6]]"}),
    rectify("an unknown option", "watermark", "The options are kind, upright", data={"watermark": "no"}),
    rectify("an unknown kind", "kind", "'planar'", data={"kind": "round"}),
    rectify("upright is no boolean", "upright", "true or false", data={"upright": "yes"}),
    rectify("no focal length", "focal_length_px", "greater than 0", data={"focal_length_px": "0"}),
    rectify("a focal length in words", "focal_length_px", "number", data={"focal_length_px": "long"}),
    rectify("a focal length of NaN", "focal_length_px", "finite", data={"focal_length_px": "nan"}),
    rectify("a region that is no JSON", "region", "it is not JSON", data={"region": "[[1,2],[3,4]"}),
    rectify("a region of two points", "region", "3 to 200 points", data={"region": "[[1,2],[3,4]]"}),
    rectify("a region too far away", "region", "at most 1e+06", data={"region": "[[1,2],[3,4],[5,1e7]]"}),
    rectify("a region too long", "region", "65536 bytes", 413, data={"region": BIG}),
    rectify("an unknown illumination", "illumination", "'normalize'", data={"illumination": "bright"}),
    rectify("an unknown crop", "crop", "'sheet'", data={"crop": "page"}),
    rectify("an unknown number of pages", "pages", "'both'", data={"pages": "2"}),
    rectify("an unknown format", "format", "'jpeg'", data={"format": "gif"}),
    rectify("a language that is a path", "language", "joined by + as eng+fra; got", data={"language": "../etc"}),
    rectify("a camera that is a path", "camera", "as tablet-3; got", data={"camera": "../etc"}),
    rectify("quality 0", "quality", "greater than or equal to 1", data={"quality": "0"}),
    rectify("quality 101", "quality", "less than or equal to 100", data={"quality": "101"}),
    rectify("quality in words", "quality", "integer", data={"quality": "high"}),
    rectify("an embedded format that browsers do not show", "embed_format", "", data={"embed_format": "tiff"}),
    rectify("max_width of nothing", "max_width", "", data={"max_width": "0"}),
    rectify("max_height in words", "max_height", "", data={"max_height": "small"}),
    rectify("a preview as a picture", "preview", "send format=json", data={"preview": "true", "format": "png"}),
    rectify("a preview with text", "text", "without preview",
        data={"preview": "true", "format": "json", "text": "true"}),
    rectify("embed is no boolean", "embed", "true or false", data={"embed": "maybe"}),
    rectify("an option in the query", "kind", "Send options as parts of the form", query="?kind=planar"),
    rectify("the format of the query twice", "format", "sent 2 times", query="?format=pdf&format=png"),
    rectify("two different formats", "format", "send one of them", query="?format=pdf", data={"format": "png"}),
    rectify("an unknown format in the query", "format", "'jpeg'", query="?format=gif"),
    rectify("only HTML is accepted", None, "option `format`", 406, headers={"Accept": "text/html"}),
    rectify("no image", "image", "scripted", 415, files={"image": ("a.txt", upload("unsupported-media-type"))}),
    rectify("a truncated image", "image", "scripted", 422, "undecodable-image",
        files={"image": ("a.jpg", upload("undecodable-image"))}),
    rectify("too many megapixels", "image", "scripted", 413, files={"image": ("a.jpg", upload("too-large"))}),
    rectify("no text in the photo", "image", "scripted", 422, "no-text",
        files={"image": ("a.jpg", upload("no-text"))}),
    rectify("an empty key", "Idempotency-Key", "1 to 200 characters", headers={**LATER, "Idempotency-Key": ""}),
    rectify("a key too long", "Idempotency-Key", "1 to 200 characters",
        headers={**LATER, "Idempotency-Key": "k" * 201}),
    rectify("GET", None, "`Allow`", 405, method="GET", files=None),
]  # fmt: skip
MOSAIC = [
    mosaic("no body", "images", "send each photo as a file part", 400, files=None),
    mosaic("one photo", "images", "send a single photo to /rectify", files=[("images", PHOTO)]),
    mosaic("17 photos", "images", "2 to 16 photos", files=[("images", PHOTO)] * 17),
    mosaic("the photos as `image`", "image", "send the file as `images`", files=[("image", PHOTO)] * 2),
    mosaic("one photo under another name", "third", "send the file as `images`",
        files=[("images", PHOTO), ("images", PHOTO), ("third", PHOTO)]),
    mosaic("a photo as text", "images", "must be a file", 400, files=None,
        content=b'--x\r\nContent-Disposition: form-data; name="images"\r\n\r\n1\r\n--x--\r\n', headers=MULTIPART),
    mosaic("a second composition", "composition", "send it once", data={"composition": ["average", "selective"]}),
    mosaic("rectify is no boolean", "rectify", "true or false", data={"rectify": "perhaps"}),
    mosaic("a base of no photo", "base", "there is no photo 5; 2 photos were sent", data={"base": "5"}),
    mosaic("a base out of range", "base", "0-15", data={"base": "16"}),
    mosaic("a base below zero", "base", "0-15", data={"base": "-1"}),
    mosaic("an unknown composition", "composition", "'average'", data={"composition": "best"}),
    mosaic("an archive", "format", "'jpeg'", data={"format": "zip"}),
    mosaic("quality of a half", "quality", "integer", data={"quality": "80.5"}),
    mosaic("an option of /rectify", "crop", "there is no such option", data={"crop": "sheet"}),
    mosaic("an unknown query option", "base", "query", query="?base=1"),
    mosaic("photos of different pages", "images[1]", "scripted", 422, "not-overlapping",
        files=[("images", PHOTO), ("images", ("b.jpg", upload("not-overlapping")))]),
    mosaic("a bad second photo", "images[1]", "scripted", 422, "undecodable-image",
        files=[("images", PHOTO), ("images", ("b.jpg", upload("undecodable-image")))]),
]  # fmt: skip
ZONES = '{"width": 20, "height": 30, "zones": [{"id": "z1", "box": [1, 2, 9, 8]}]}'
LAYOUT = [
    layout("no body", "image", "or its zones", 400, files=None),
    layout("the page as `page`", "page", "without a filename", files={"page": PHOTO}),
    layout("the page as `file`", "file", "send the file as `image`", files={"file": PHOTO}),
    layout("zones twice", "zones", "send it once", data={"zones": [ZONES, ZONES]}),
    layout("zones in two ways", "zones_file", "not both", files={"zones_file": ("a.json", ZONES.encode())},
        data={"zones": ZONES}),
    layout("zones of another frame", "rectify", "without zones", data={"zones": ZONES, "rectify": "true"}),
    layout("zones of two pages", "image", "one page", files=[("image", PHOTO)] * 2, data={"zones": ZONES}),
    layout("zones of one page of many", "page", "one page", data={"zones": ZONES, "page": "2"}),
    layout("zones that are no JSON", "zones", "not JSON", files=None, data={"zones": "{"}),
    layout("a file of zones as text", "zones_file", "must be a file", 400, files=None,
        content=b'--x\r\nContent-Disposition: form-data; name="zones_file"\r\n\r\n1\r\n--x--\r\n',
        headers=MULTIPART),
    layout("21 images", "image", "MAX_PAGES", 413, files=[("image", PHOTO)] * 21),
    layout("page 0", "page", "greater than or equal to 1", data={"page": "0"}),
    layout("page in words", "page", "integer", data={"page": "first"}),
    layout("an unknown OCR", "ocr", "'off'", data={"ocr": "on"}),
    layout("no name of a model", "models", "letters, digits", data={"models": "../etc"}),
    layout("a model that does not exist", None, "nobody", 404, data={"models": "nobody"}),
    layout("explain is no boolean", "explain", "true or false", data={"explain": "1"}),
    layout("an unknown format", "format", "'pagexml'", data={"format": "docx"}),
    layout("an option twice", "ocr", "send it once", data={"ocr": ["off", "auto"]}),
    layout("a misspelled option", "model", "did you mean `models`?", data={"model": "letter"}),
    layout("an unknown query option", "explain", "query", query="?explain=true"),
    layout("only GIF is accepted", None, "option `format`", 406, headers={"Accept": "image/gif"}),
]  # fmt: skip
