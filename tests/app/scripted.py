"""Operations that do what the upload says, so that a test can have any fate befall a worker."""

import base64
import ctypes
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

from app.operations import Encoding, MosaicLimits, Operations, Reply, UploadLimits
from services.errors import (
    DocumentError,
    NoText,
    NotOverlapping,
    TooLarge,
    UndecodableImage,
    UnsupportedMediaType,
)
from services.mosaic.parameters import MosaicParameters
from services.rectify.parameters import RectifyParameters

JPEG = b"\xff\xd8\xff\xe0" + b"\0" * 28
"""What only looks like a JPEG; the scripted operation reads what follows it."""
MEDIA_TYPES = {
    "jpeg": "image/jpeg",
    "png": "image/png",
    "webp": "image/webp",
    "tiff": "image/tiff",
    "pdf": "application/pdf",
    "json": "application/json",
}
REFUSALS: dict[bytes, type[DocumentError]] = {
    error.code.encode(): error
    for error in (NoText, NotOverlapping, TooLarge, UndecodableImage, UnsupportedMediaType)
}


def upload(script: str) -> bytes:
    """An upload that makes the operation follow the script."""
    return JPEG + b"do:" + script.encode()


def rectify(upload: bytes, parameters: RectifyParameters, encoding: Encoding, limits: UploadLimits) -> Reply:
    """Follow the script in the upload, then answer with a document that tells what was asked."""
    if _follow(upload, "image") == b"unpicklable":
        return Reply(lambda: None, "image/jpeg", {})  # type: ignore[arg-type]
    return _reply(encoding, lambda image: document(parameters, encoding, image))


def mosaic(
    uploads: list[bytes], parameters: MosaicParameters, encoding: Encoding, limits: MosaicLimits
) -> Reply:
    """Follow the script in every upload, then answer with a document that tells what was asked."""
    for index, upload in enumerate(uploads):
        _follow(upload, f"images[{index}]")
    asked = {"options": parameters, "encoding": encoding, "limits": limits, "bytes": list(map(len, uploads))}
    return _reply(encoding, lambda image: mosaic_document(len(uploads), asked, image))


def _reply(encoding: Encoding, describe: Callable[[str | None], dict[str, object]]) -> Reply:
    embedded = base64.b64encode(b"flat").decode() if encoding.embed and encoding.format == "json" else None
    body = b"" if encoding.format == "json" else f"flat as {encoding.format}".encode()
    return Reply(body, MEDIA_TYPES[encoding.format or "jpeg"], describe(embedded))


def _follow(upload: bytes, field: str) -> bytes:
    """Do what the upload says; the verb."""
    _, _, script = upload.partition(b"do:")
    verb, _, object_ = script.partition(b" ")
    if verb in REFUSALS:
        raise REFUSALS[verb](f"{field}: scripted {verb.decode()}", field)
    if verb == b"fail":
        raise ZeroDivisionError("secret of the house")
    if verb == b"sleep":
        time.sleep(float(object_))
    elif verb == b"hang":
        ctypes.PyDLL(None).sleep(3600)  # holds the interpreter lock, as a hang of native code does
    elif verb == b"segfault":
        ctypes.string_at(0)
    elif verb == b"kill":
        os.kill(os.getpid(), signal.SIGKILL)
    elif verb == b"exit":
        raise SystemExit(3)
    elif verb == b"memory":
        bytearray(int(object_))
    elif verb == b"wait":
        _announce_and_wait(Path(object_.decode()))
    return verb


def _announce_and_wait(folder: Path) -> None:
    """Tell that the job runs, then wait until the folder says `go`."""
    (folder / "running").write_text(str(os.getpid()), encoding="ascii")
    while not (folder / "go").exists():
        time.sleep(0.01)


def document(parameters: RectifyParameters, encoding: Encoding, image: str | None) -> dict[str, object]:
    """A `RectifyResult` whose notices carry the options back."""
    return {
        "kind": "planar",
        "evidence": {"major_convergence": 0.01, "minor_convergence": None, "text_area_fraction": 0.4},
        "camera": {
            "focal_length_px": parameters.focal_length_px,
            "field_of_view_deg": None,
            "source": "given",
        },
        "surface": {"type": "plane", "normal": (0.0, 0.0, 1.0)},
        "orientation": {"rotation_deg": 180, "mirrored": False, "confidence": 0.9},
        "width": 20,
        "height": 10,
        "mesh": {"rows": 2, "columns": 2, "source": [[(0.0, 0.0), (19.0, 0.0)], [(0.0, 9.0), (19.0, 9.0)]]},
        "warnings": [
            {"code": "options", "detail": repr(parameters)},
            {"code": "encoding", "detail": repr(encoding)},
        ],
        "timings_ms": {"decode": 1.25, "texture_flow": 20.0},
        "image": image,
    }


def mosaic_document(photos: int, asked: dict[str, object], image: str | None) -> dict[str, object]:
    """A `MosaicResult` whose notices carry back what was asked; the last photo is not placed."""
    mesh = {"rows": 2, "columns": 2, "target": [[(0.0, 0.0), (19.0, 0.0)], [(0.0, 9.0), (19.0, 9.0)]]}
    placed = {"placed": True, "mesh": mesh, "scale": 1.25, "sharpness": 1.0}
    return {
        "width": 20,
        "height": 10,
        "base": 0,
        "orientation": {"rotation_deg": 90, "mirrored": False, "confidence": None},
        "patches": [placed] * (photos - 1)
        + [{"placed": False, "mesh": None, "scale": None, "sharpness": None}],
        "pairs": [
            {
                "a": 0,
                "b": 1,
                "matches": 900,
                "votes": 400,
                "runner_up_votes": 12,
                "overlap_fraction": 0.2,
                "residual_px": 0.07,
            }
        ],
        "unplaced": [photos - 1],
        "warnings": [{"code": name, "detail": repr(what)} for name, what in asked.items()],
        "timings_ms": {"decode": 1.25, "block_matches": 20.0},
        "image": image,
    }


def warm_up() -> dict[str, object]:
    """What workers of the scripted service say of themselves."""
    return {"ocr": "scripted"}


OPERATIONS = Operations(rectify=rectify, mosaic=mosaic, warm_up=warm_up, preloaded=("tests.app.scripted",))
