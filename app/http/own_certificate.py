"""`python -m app.http.own_certificate FILE` makes a certificate for this machine, where FILE has no valid one.

Browsers open a camera, share and install a page over TLS only. A browser that does not know the certificate asks its
user once. It is made by the program `openssl`. The address is printed, also as a QR code for a phone's camera.
"""

import os
import socket
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import segno

VALID_DAYS = 398
"""Browsers refuse certificates that are valid for longer."""
LEFT_S = 30 * 24 * 3600
"""A certificate that ends within this time is made anew."""
FOR_OWNER = 0o700
"""Mode of the folder, where there is none yet."""
SOMEWHERE = ("192.0.2.1", 9)
"""An address of no machine (RFC 5737). Nothing is sent to it: only the way there is asked for."""


def own_addresses() -> list[str]:
    """Addresses of this machine: the one by which others reach it, where it has a network, and the loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(SOMEWHERE)
            return [probe.getsockname()[0], "127.0.0.1"]
        except OSError:
            return ["127.0.0.1"]


def make_certificate(file: Path, addresses: list[str]) -> None:
    """Write a certificate for `addresses` and this machine's name, and its key, to `file`, which only its owner reads.

    Raises
    ------
    OSError, subprocess.CalledProcessError
        When `openssl` is not there, or fails.
    """
    names = [f"IP:{address}" for address in addresses] + [f"DNS:{socket.gethostname()}", "DNS:localhost"]
    with TemporaryDirectory() as folder:
        key, certificate = Path(folder) / "key.pem", Path(folder) / "certificate.pem"
        command = [
            "openssl",
            "req",
            "-x509",
            "-newkey",
            "ec",
            "-pkeyopt",
            "ec_paramgen_curve:prime256v1",
            "-nodes",
        ]
        command += ["-keyout", str(key), "-out", str(certificate), "-days", str(VALID_DAYS)]
        command += ["-subj", "/CN=Document rectification", "-addext", f"subjectAltName={','.join(names)}"]
        subprocess.run(command, check=True, capture_output=True)
        file.parent.mkdir(mode=FOR_OWNER, exist_ok=True)
        with open(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as both:
            both.write(certificate.read_bytes() + key.read_bytes())


def is_valid(file: Path, addresses: list[str]) -> bool:
    """Whether the certificate of `file` is for these addresses, and for some time to come."""
    asked = [
        "openssl",
        "x509",
        "-in",
        str(file),
        "-noout",
        "-checkend",
        str(LEFT_S),
        "-ext",
        "subjectAltName",
    ]
    found = subprocess.run(asked, check=False, capture_output=True, text=True)
    return found.returncode == 0 and all(f"IP Address:{address}" in found.stdout for address in addresses)


if __name__ == "__main__":
    target, here = Path(sys.argv[1]), own_addresses()
    try:
        if not is_valid(target, here):
            make_certificate(target, here)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"The certificate could not be made (Debian: openssl): {error}")
    page = f"https://{here[0]}:{os.environ.get('PORT', '8000')}/"
    print(f"The page is at {page}. The browser asks once whether to trust its certificate.")
    segno.make(page, micro=False).terminal(compact=True)
