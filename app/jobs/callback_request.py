"""One POST to a client's server that cannot be led elsewhere: no redirect, no second look-up of the name.

The name is resolved once, every address of it is judged, and the connection goes to an address that was judged.
"""

import http.client
import ipaddress
import socket
import ssl
import threading
from collections.abc import Sequence
from contextlib import suppress
from urllib.parse import SplitResult, urlsplit

from services.errors import InvalidOption

LONGEST_URL = 2000
_FIELD = "callback_url"
_PORTS = {"http": http.client.HTTP_PORT, "https": http.client.HTTPS_PORT}
_NAT64 = ipaddress.ip_network("64:ff9b::/96")


class CallbackFailed(Exception):
    """The request could not be sent, or was not answered. The message is for the job's log of deliveries."""


def parse_callback_url(url: str, hosts: Sequence[str]) -> SplitResult:
    """The parts of a URL whose host is one of `hosts` (`*`: any host; `*.example.org`: any below it).

    Raises
    ------
    InvalidOption
        When the URL has another scheme than http and https, user or password, or a host that is not allowed.
    """
    try:
        parts = urlsplit(url)
        host, port = (parts.hostname or "").rstrip("."), parts.port
    except ValueError:
        raise InvalidOption(f"{_FIELD}: this is not a URL.", _FIELD) from None
    if len(url) > LONGEST_URL or not url.isascii() or any(character <= " " for character in url):
        raise InvalidOption(
            f"{_FIELD}: send a URL of at most {LONGEST_URL} ASCII characters, without spaces.", _FIELD
        )
    if parts.scheme not in _PORTS or not host or port == 0:
        raise InvalidOption(f"{_FIELD}: send a URL that begins with https:// or http:// and a host.", _FIELD)
    if parts.username is not None or parts.password is not None or parts.fragment:
        raise InvalidOption(f"{_FIELD}: send a URL without user, password and fragment.", _FIELD)
    if not is_named(host, hosts):
        raise InvalidOption(
            f"{_FIELD}: the host is not one that the service may call (CALLBACK_HOSTS).", _FIELD
        )
    return parts


def is_named(host: str, hosts: Sequence[str]) -> bool:
    """Whether one of the entries means this host."""
    host = host.lower().rstrip(".")
    return any(
        entry in ("*", host) or (entry.startswith("*.") and host.endswith(entry[1:]))
        for entry in map(str.lower, hosts)
    )


def is_public(address: str) -> bool:
    """Whether an IP address is one of the internet: not of this machine, a private network, or a link."""
    ip = ipaddress.ip_address(address.partition("%")[0])
    if isinstance(ip, ipaddress.IPv6Address):
        inside = ip.ipv4_mapped or ip.sixtofour or (ip.teredo and ip.teredo[1])
        if ip in _NAT64:
            inside = ipaddress.IPv4Address(int(ip) & 0xFFFFFFFF)
        if inside:
            return is_public(str(inside))
        if ip.is_site_local:
            return False
    return ip.is_global and not ip.is_multicast and not ip.is_reserved and not ip.is_unspecified


class CallbackRequest:
    """A POST. `send` blocks; another thread may `abort` it."""

    def __init__(self, url: str, hosts: Sequence[str], internal_hosts: Sequence[str]) -> None:
        """Hosts of `internal_hosts` may have addresses of the own network. Raises `InvalidOption`."""
        self._parts = parse_callback_url(url, hosts)
        self._host = (self._parts.hostname or "").rstrip(".")
        self._port = self._parts.port or _PORTS[self._parts.scheme]
        self._may_be_internal = is_named(self._host, [name for name in internal_hosts if name != "*"])
        self._lock = threading.Lock()
        self._socket: socket.socket | None = None
        self._is_aborted = False

    def send(self, body: bytes, headers: dict[str, str], timeout_s: float) -> int:
        """Status of the answer, whose body is not read. `timeout_s` limits every step.

        Raises
        ------
        CallbackFailed
        """
        try:
            with self._secured(self._connect(timeout_s)) as connected:
                connection = http.client.HTTPConnection(self._host, self._port)
                connection.sock = connected
                target = self._parts.path or "/"
                if self._parts.query:
                    target += f"?{self._parts.query}"
                connection.request("POST", target, body, {**headers, "Connection": "close"})
                return connection.getresponse().status
        except (OSError, http.client.HTTPException, UnicodeError) as error:
            raise CallbackFailed(f"{type(error).__name__}: {error}"[:200]) from error

    def abort(self) -> None:
        """End `send` now, in whatever it waits for; only a look-up of a name goes on."""
        with self._lock:
            self._is_aborted = True
            if self._socket is not None:
                with suppress(OSError):
                    self._socket.shutdown(socket.SHUT_RDWR)

    def _connect(self, timeout_s: float) -> socket.socket:
        found = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_STREAM)
        addresses = [str(entry[4][0]) for entry in found]
        if not addresses:
            raise CallbackFailed("the host has no address")
        if not self._may_be_internal and not all(map(is_public, addresses)):
            raise CallbackFailed(
                "the host has an address of a private network; CALLBACK_INTERNAL_HOSTS may allow it"
            )
        plain = socket.socket(found[0][0], socket.SOCK_STREAM)
        plain.settimeout(timeout_s)
        with self._lock:
            self._socket = plain
            if self._is_aborted:
                plain.close()
                raise CallbackFailed("it took too long")
        try:
            plain.connect(found[0][4])
        except BaseException:
            plain.close()
            raise
        return plain

    def _secured(self, plain: socket.socket) -> socket.socket:
        if self._parts.scheme == "http":
            return plain
        try:
            secured = ssl.create_default_context().wrap_socket(plain, server_hostname=self._host)
        except BaseException:
            plain.close()
            raise
        with self._lock:
            self._socket = secured
        return secured
