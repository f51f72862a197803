"""A server of PostgreSQL of its own for a test or a benchmark, where its programs are installed."""

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil
import psycopg

_START_S = 120
"""Until it answers after a start; a machine that others keep busy replays its log slowly."""


def _server_binaries() -> Path | None:
    """Folder of the newest server of PostgreSQL: Debian's, which stand apart, or that on the PATH."""
    folders = sorted(
        Path("/usr/lib/postgresql").glob("*/bin"), key=lambda folder: float(folder.parent.name), reverse=True
    )
    found = shutil.which("initdb")
    folders += [Path(found).resolve().parent] if found else []
    return next(
        (folder for folder in folders if all((folder / name).exists() for name in ("initdb", "postgres"))),
        None,
    )


def _server_user() -> pwd.struct_passwd | None:
    """Whom the server may run as: never root, and somebody with a name."""
    for name in ("postgres", "nobody") if os.geteuid() == 0 else (None,):
        try:
            return pwd.getpwuid(os.geteuid()) if name is None else pwd.getpwnam(name)
        except KeyError:
            continue
    return None


BINARIES, USER = _server_binaries(), _server_user()
"""Where its programs are, and whom they may run as; None: there are none, or nobody."""
IS_INSTALLED = BINARIES is not None and USER is not None


class Cluster:
    """A running server of PostgreSQL that listens on a socket in its own folder only."""

    def __init__(self, folder: Path, start: Callable[[], "subprocess.Popen[bytes]"]) -> None:
        self.folder = folder
        self._start = start
        self._server = start()
        self._made = 0

    def make_database(self) -> str:
        """The URL of a fresh, empty database."""
        self._made += 1
        name = f"store_{self._made}"
        with self.connect("postgres") as connection:
            connection.execute(f"CREATE DATABASE {name}")
        return f"postgresql://store@/{name}?host={self.folder}"

    def processes(self) -> list[psutil.Process]:
        """The server's own process, first, and all that it has started."""
        server = psutil.Process(self._server.pid)
        return [server, *server.children(recursive=True)]

    @contextmanager
    def hung(self) -> Iterator[None]:
        """All processes of the server are stopped inside of the block; they keep their connections."""
        processes = self.processes()
        for process in processes:
            process.suspend()
        try:
            yield
        finally:
            for process in processes:
                process.resume()

    @contextmanager
    def away(self) -> Iterator[None]:
        """No server inside of the block."""
        self.stop()
        try:
            yield
        finally:
            self._server = self._start()
            self.wait()

    def restart(self) -> None:
        """As a machine that crashes and comes back: connections break, and the log is replayed."""
        with self.away():
            pass

    def crash(self) -> None:
        """Kill all processes of the server with -9, and start it again."""
        for process in self.processes():
            with suppress(psutil.NoSuchProcess):
                process.kill()
        self._server.wait(_START_S)
        self._server = self._start()
        self.wait()

    def stop(self) -> None:
        """At once."""
        self._server.send_signal(signal.SIGQUIT)
        self._server.wait(_START_S)

    def wait(self) -> None:
        """Return when it can be connected to."""
        deadline = time.monotonic() + _START_S
        while True:
            try:
                self.connect("postgres").close()
                return
            except psycopg.OperationalError:
                said = (self.folder / "log").read_text()
                assert self._server.poll() is None, said
                assert time.monotonic() < deadline, said
            time.sleep(0.02)

    def connect(self, database: str) -> psycopg.Connection[Any]:
        """A connection beside the store's, which commits every statement."""
        return psycopg.connect(host=str(self.folder), user="store", dbname=database, autocommit=True)


@contextmanager
def running_cluster(*, durable: bool = False) -> Iterator[Cluster]:
    """A server with a fresh cluster, gone with the block; `durable` has it wait for the disk, as it should in use."""
    assert BINARIES is not None
    assert USER is not None
    folder = Path(tempfile.mkdtemp(prefix="pg"))  # short: the path of a socket has 107 characters at most
    identity: dict[str, Any] = {"cwd": folder}
    if os.geteuid() == 0:
        identity |= {"user": USER.pw_uid, "group": USER.pw_gid, "extra_groups": []}
        os.chown(folder, USER.pw_uid, USER.pw_gid)
    initdb = [BINARIES / "initdb", "--no-sync", "--username=store", "--auth=trust", "--encoding=UTF8"]
    settings = {
        "listen_addresses": "",
        "unix_socket_directories": str(folder),
        "shared_buffers": "16MB",
        "fsync": "on" if durable else "off",
    }
    start = [
        BINARIES / "postgres",
        "-D",
        folder / "data",
        *(f"--{name}={settings[name]}" for name in settings),
    ]
    try:
        made = subprocess.run(
            [*initdb, "--locale=C", "--pgdata", folder / "data"],
            check=False,
            capture_output=True,
            text=True,
            **identity,
        )
        assert made.returncode == 0, made.stderr

        def start_server() -> "subprocess.Popen[bytes]":
            with (folder / "log").open("ab") as log:
                return subprocess.Popen(start, stdout=log, stderr=log, **identity)

        cluster = Cluster(folder, start_server)
        try:
            cluster.wait()
            yield cluster
        finally:
            cluster.stop()  # nothing of it is needed any more
    finally:
        shutil.rmtree(folder)
