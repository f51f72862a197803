"""Scripts in uploads: what befalls the worker that reads one."""

import ctypes
import os
import signal
import time
from pathlib import Path

from services import errors
from services.progress import report_progress

JPEG = b"\xff\xd8\xff\xe0" + b"\0" * 28
"""What only looks like a JPEG; a scripted operation reads what follows it."""
REFUSALS: dict[bytes, type[errors.DocumentError]] = {
    error.code.encode(): error
    for error in (
        errors.NoText,
        errors.NotOverlapping,
        errors.TooLarge,
        errors.UndecodableImage,
        errors.UnsupportedMediaType,
    )
}


def upload(script: str) -> bytes:
    """An upload that makes the operation follow the script."""
    return JPEG + b"do:" + script.encode()


def follow(upload: bytes, field: str) -> bytes:
    """Do what the `upload` says, and return its verb; `field` names it in refusals."""
    _, _, script = upload.partition(b"do:")
    verb, _, object_ = script.partition(b" ")
    if verb in REFUSALS:
        raise REFUSALS[verb](f"{field}: scripted {verb.decode()}.", field)
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
    """Tell that the job runs, and in which process, then wait until the folder says `go`.

    The file takes its name when it is whole: who sees it can read the process's id.
    """
    report_progress("waiting", 0.25)
    unnamed = folder / f"running-{os.getpid()}"
    unnamed.write_text(str(os.getpid()), encoding="ascii")
    unnamed.rename(folder / "running")
    while not (folder / "go").exists():
        time.sleep(0.01)
