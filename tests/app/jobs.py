"""What workers are made to do, and to suffer, in the tests of the engine."""

import ctypes
import errno
import os
import resource
import subprocess
import threading
import time
from pathlib import Path

import psutil

from services.contract.worker_facts import WorkerFacts
from services.deadline import time_left_s
from services.errors import NoText
from services.progress import report_progress
from services.side_by_side import SideStep


def worker_pid() -> int:
    return os.getpid()


def seconds_left() -> float:
    return time_left_s()


def steps_beside() -> int:
    """Of eight steps that wait for the last one, those that run in threads of their own."""
    all_begun = threading.Event()
    steps = [SideStep(lambda: all_begun.wait(20.0)) for _ in range(8)]
    beside = sum(step.is_beside for step in steps)
    all_begun.set()
    assert all(step.result() for step in steps)
    return beside


def size_of(payload: bytes) -> int:
    return len(payload)


def resident_bytes(payload: bytes) -> int:
    return psutil.Process().memory_info().rss


def joined(*lists: list[bytes]) -> bytes:
    return b"".join(part for parts in lists for part in parts)


def payload_of(size: int) -> bytes:
    return b"x" * size


def hang_in_native_code() -> None:
    ctypes.PyDLL(None).sleep(3600)


def crash() -> None:
    ctypes.string_at(0)


def leave() -> None:
    os._exit(3)


def take_memory(size: int) -> int:
    return len(bytearray(size))


def refuse() -> None:
    raise NoText("nothing to read")


def fail() -> None:
    raise ZeroDivisionError("a defect")


def answer_a_function() -> object:
    return lambda: None


def announce_and_wait(folder: str, payload: bytes = b"") -> int:
    (Path(folder) / f"running-{os.getpid()}").touch()
    while not (Path(folder) / "go").exists():
        time.sleep(0.005)
    return os.getpid()


def start_child_and_hang() -> None:
    subprocess.Popen(["sleep", "3600"])
    time.sleep(3600)


def threads_and_limits() -> dict[str, object]:
    return {
        "openblas": os.environ["OPENBLAS_NUM_THREADS"],
        "opencv": os.environ["OPENCV_FOR_THREADS_NUM"],
        "memory": resource.getrlimit(resource.RLIMIT_AS)[0],
        "core": resource.getrlimit(resource.RLIMIT_CORE)[0],
        "group": os.getpgid(0) == os.getpid(),
    }


def fail_to_warm_up() -> WorkerFacts:
    raise RuntimeError("a library is missing")


def exit_while_warming_up() -> WorkerFacts:
    os._exit(5)


def hang_while_warming_up() -> WorkerFacts:
    time.sleep(3600)
    return WorkerFacts()


def warm_up_for_long() -> WorkerFacts:
    """Longer than a test's limit for a worker that does nothing."""
    begin_s = time.process_time()
    while time.process_time() < begin_s + 0.4:
        pass
    return WorkerFacts()


def say_warm() -> WorkerFacts:
    return WorkerFacts("none", (str(os.getpid()),))


def report_stages(folder: str) -> str:
    report_progress("text", 0.25)
    report_progress("text", 0.26)  # too soon after the first to be sent
    report_progress("shape", 0.5)
    announce_and_wait(folder)
    return "done"


def report_without_end(folder: str) -> int:
    """More than a pipe holds, to an engine that is not reading."""
    while not (Path(folder) / "go").exists():
        time.sleep(0.005)
    for number in range(10_000):
        report_progress(f"stage {number}", number / 10_000)
    return os.getpid()


def abort() -> None:
    os.abort()


def free_memory(size: int) -> int:
    """Id of the process, which has freed so many bytes, in blocks that come from the heap."""
    blocks = [b"x" * 100_000 for _ in range(size // 100_000)]
    del blocks
    return os.getpid()


def keep_memory(size: int) -> int:
    _KEPT.append(b"x" * size)
    return os.getpid()


_KEPT: list[bytes] = []


def fail_for_lack_of_memory(kind: str) -> None:
    """Fail as libraries do that catch a failed allocation."""
    if kind == "errno":
        raise OSError(errno.ENOMEM, "Cannot allocate memory")
    try:
        bytearray(1 << 60)
    except MemoryError as error:
        raise ValueError("the array could not be made") from error
