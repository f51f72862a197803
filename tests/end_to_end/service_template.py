"""A process that imports the service once and forks one service for each order.

Imports are most of the start of `python -m app`. `tests.end_to_end.forked` runs this module and orders services from
it. An order is one JSON message with two descriptors: the output of the service, and a socket that gets the process id
and, in the end, the exit status.
"""

import gc
import json
import multiprocessing.util
import os
import runpy
import select
import signal
import socket
import sys
import tempfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from importlib import import_module

MOST_BYTES = 1 << 20
"""Longest order."""
PRELOADED = ("app.main", "tests.app.scripted", "tests.app.jobs", "tesserocr")
"""What services and their workers import, besides the modules of the operations."""


def serve_orders(control: socket.socket) -> list[str]:
    """Fork a service for each order until the other end closes; returns in the service, with its command line."""
    children: dict[int, socket.socket] = {}
    ended, wake_up = socket.socketpair()
    ended.setblocking(False)
    wake_up.setblocking(False)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    signal.set_wakeup_fd(wake_up.fileno())
    while True:
        ready = select.select([control, ended], [], [])[0]
        if ended in ready:
            ended.recv(MOST_BYTES)
            _report_ended(children)
        if control not in ready:
            continue
        message, descriptors, _, _ = socket.recv_fds(control, MOST_BYTES, 2)
        if not message:
            sys.exit()
        output, life = descriptors[0], socket.socket(fileno=descriptors[1])
        if pid := os.fork():
            os.close(output)
            children[pid] = life
            life.send(str(pid).encode())
            continue
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for end in (control, ended, wake_up, life, *children.values()):
            end.close()
        order = json.loads(message)
        _change_process(output, order["environment"])
        return order["command"]


def _report_ended(children: dict[int, socket.socket]) -> None:
    for pid in tuple(children):
        if (status := os.waitpid(pid, os.WNOHANG))[0]:
            with children.pop(pid) as life, suppress(OSError):
                life.send(str(os.waitstatus_to_exitcode(status[1])).encode())


def _change_process(output: int, environment: dict[str, str]) -> None:
    """Give this process the output and the environment of its order."""
    for standard in (1, 2):
        os.dup2(output, standard)
    os.close(output)
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None  # TMPDIR may have changed


def fork_server_from_here() -> None:
    """Let the fork server of the service's workers be a fork of this process, not a fresh Python.

    It is forked now, because the service has threads later. It waits until the service starts its fork server, and is
    used once: when tests kill it, the service starts the next one as it does without a template.
    """
    start, started = socket.socketpair()
    pid = os.fork()
    if pid == 0:
        start.close()
        _run_when_started(started)
    started.close()
    spawn: Callable[[str, list[str], Iterable[int]], int] = multiprocessing.util.spawnv_passfds

    def spawn_or_start(path: str, arguments: list[str], descriptors: Iterable[int]) -> int:
        if "multiprocessing.forkserver" not in arguments[-1] or start.fileno() < 0:
            return spawn(path, arguments, descriptors)
        passed = list(descriptors)
        with start:
            socket.send_fds(start, [json.dumps([arguments[-1], passed]).encode()], passed)
        return pid

    multiprocessing.util.spawnv_passfds = spawn_or_start  # type: ignore[attr-defined]


def _run_when_started(started: socket.socket) -> None:
    """Wait for a Python command with the numbers of its descriptors, and run it."""
    with started:
        message, descriptors, _, _ = socket.recv_fds(started, MOST_BYTES, 8)
    if not message:
        os._exit(0)
    command, numbers = json.loads(message)
    # First out of the way: a number may be that of another descriptor that came.
    spare = [os.dup2(descriptor, 100 + place) for place, descriptor in enumerate(descriptors)]
    for descriptor in descriptors:
        os.close(descriptor)
    for descriptor, number in zip(spare, numbers, strict=True):
        os.dup2(descriptor, number)
        os.close(descriptor)
    exec(command, {"__name__": "__main__"})
    os._exit(0)


if __name__ == "__main__":
    from services.contract.operations import Operations

    for name in (*PRELOADED, *Operations().modules):
        with suppress(ImportError):  # tesserocr may be absent
            import_module(name)
    gc.freeze()
    module, *rest = serve_orders(socket.socket(fileno=int(sys.argv[1])))
    fork_server_from_here()
    sys.argv = [module, *rest]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
