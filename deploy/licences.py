"""What the image holds under which licence: writes licences.md and sbom.cdx.json beside this file (`make licences`).

Names and versions of Python packages are those of requirements.lock, their licences those of their metadata. Wheels
bring native libraries along whose licences no metadata name: those are in the table below. A package or a library
without a known licence stops the tool, and so do those of the tests.
"""

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from uuid import NAMESPACE_URL, uuid5

from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.model.license import LicenseExpression
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

FOLDER = Path(__file__).parent
LOCK = FOLDER.parent / "requirements.lock"
PAGE, BILL = FOLDER / "licences.md", FOLDER / "sbom.cdx.json"

_OF_LIBRARY = {
    "libXau": "MIT",
    "libaom": "BSD-2-Clause",
    "libavcodec": "LGPL-2.1-or-later",
    "libavformat": "LGPL-2.1-or-later",
    "libavif": "BSD-2-Clause",
    "libavutil": "LGPL-2.1-or-later",
    "libbrotlicommon": "MIT",
    "libbrotlidec": "MIT",
    "libcom_err": "MIT",
    "libcrypt": "LGPL-2.1-or-later",
    "libcrypto": "Apache-2.0",
    "libde265": "LGPL-3.0-or-later",
    "libdrm": "MIT",
    "libfreetype": "FTL",
    "libgfortran": "GPL-3.0-or-later WITH GCC-exception-3.1",
    "libgssapi_krb5": "MIT",
    "libharfbuzz": "MIT",
    "libheif": "LGPL-3.0-or-later",
    "libjbig": "GPL-2.0-or-later",
    "libjpeg": "IJG AND BSD-3-Clause",
    "libk5crypto": "MIT",
    "libkeyutils": "LGPL-2.0-or-later",
    "libkrb5": "MIT",
    "libkrb5support": "MIT",
    "liblber": "OLDAP-2.8",
    "liblcms2": "MIT",
    "libldap": "OLDAP-2.8",
    "libleptonica": "BSD-2-Clause",
    "liblzma": "0BSD",
    "libonnxruntime": "MIT",
    "libonnxruntime_providers_shared": "MIT",
    "libopenblasp": "BSD-3-Clause",
    "libopenjp2": "BSD-2-Clause",
    "libpdfium": "BSD-3-Clause AND Apache-2.0",
    "libpng16": "libpng-2.0",
    "libpq": "PostgreSQL",
    "libqpdf": "Apache-2.0",
    "libquadmath": "LGPL-2.0-or-later",
    "libsasl2": "BSD-4-Clause-UC",
    "libscipy_openblas": "BSD-3-Clause",
    "libscipy_openblas64_": "BSD-3-Clause",
    "libsharpyuv": "BSD-3-Clause",
    "libssl": "Apache-2.0",
    "libswresample": "LGPL-2.1-or-later",
    "libswscale": "LGPL-2.1-or-later",
    "libtesseract": "Apache-2.0",
    "libtiff": "libtiff",
    "libvpx": "BSD-3-Clause",
    "libwebp": "BSD-3-Clause",
    "libwebpdemux": "BSD-3-Clause",
    "libwebpmux": "BSD-3-Clause",
    "libx265": "GPL-2.0-or-later",
    "libxcb": "MIT",
    "libzstd": "BSD-3-Clause",
}
"""Licences (SPDX) of native libraries in wheels, as their projects state them."""
_OF_OLD_OPENSSL = "OpenSSL"
"""Of OpenSSL before version 3, which the file name tells."""
_SPDX = {
    "3-Clause BSD License": "BSD-3-Clause",
    "Apache 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "BSD 3-Clause License": "BSD-3-Clause",
    "BSD License": "BSD-3-Clause",
    "BSD-3-Clause, Apache-2.0, dependency licenses": "BSD-3-Clause AND Apache-2.0",
    "GNU Lesser General Public License v3 (LGPLv3)": "LGPL-3.0-only",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "The Unlicense (Unlicense)": "Unlicense",
}
"""SPDX names of what older metadata say in other words."""
_PLAIN_SPDX = re.compile(r"[A-Za-z0-9.+-]+")
_OF_PAGES = (
    ("OpenSeadragon", "BSD-3-Clause", "app/static/vendor/openseadragon"),
    ("Swagger UI", "Apache-2.0", "fastapi-offline"),
    ("ReDoc", "MIT", "fastapi-offline"),
)
"""Scripts of browsers, and where they are."""
_DEBIAN = (
    ("python:3.11-slim-bookworm", "Debian 12 and CPython (PSF-2.0)"),
    ("make", "GPL-3.0-or-later; a program of its own, which sets the image up"),
    ("tesseract-ocr-eng, tesseract-ocr-osd, one package for each of LANGUAGES", "Apache-2.0"),
)


class UnknownLicence(LookupError):
    """The licence of a package or a library is not known; the message says where to add it."""


@dataclass(frozen=True, slots=True)
class Part:
    """A Python package, or a native library that is in the wheel of one."""

    name: str
    version: str
    licence: str
    wheel: str | None = None
    """The package whose wheel holds this library; None for packages."""


def find_parts() -> list[Part]:
    """Packages of the lock that are installed here, each followed by the libraries of its wheel.

    Raises
    ------
    UnknownLicence
    """
    parts: list[Part] = []
    for name, version in re.findall(r"^([a-z0-9._-]+)==([^\s;]+)", LOCK.read_text("utf-8"), re.MULTILINE):
        try:
            package = distribution(name)
        except PackageNotFoundError:
            continue
        if package.version == version:
            parts.append(Part(name, version, _licence_of_package(package)))
            parts += sorted(_libraries(name, package), key=_name_of)
    return parts


def _name_of(part: Part) -> str:
    return part.name


def _licence_of_package(package: Distribution) -> str:
    expressions, classifiers, words = (
        package.metadata.get_all(field, []) for field in ("License-Expression", "Classifier", "License")
    )
    if expressions:
        return str(expressions[0])
    classified = [line.rpartition("::")[2] for line in classifiers if line.startswith("License")]
    for said in map(str.strip, (*classified, *words)):
        licence = _SPDX.get(said) or (said if _PLAIN_SPDX.fullmatch(said) else None)
        if licence:
            return licence
    raise UnknownLicence(f"{package.name}: its metadata name no licence that _SPDX knows")


def _libraries(wheel: str, package: Distribution) -> Iterator[Part]:
    for file in package.files or ():
        is_apart = ".libs" in str(file.parent)
        if ".so" not in file.name or not (is_apart or file.name.startswith("lib")):
            continue
        stem = re.sub(r"(-r0)?-[0-9a-f]{8}.*|-?\.so.*", "", file.name)
        version = file.name.partition(".so.")[2]
        licence = _OF_LIBRARY.get(stem)
        if licence is None:
            raise UnknownLicence(f"{file} of {wheel}: add the licence of {stem} to _OF_LIBRARY")
        if stem in ("libssl", "libcrypto") and version.startswith("1."):
            licence = _OF_OLD_OPENSSL
        yield Part(stem, version, licence, wheel)


def page_of(parts: list[Part]) -> str:
    """The page for people."""
    packages = [part for part in parts if part.wheel is None]
    libraries = [part for part in parts if part.wheel is not None]
    copyleft = [part for part in parts if re.search(r"\bA?GPL", part.licence) and "WITH" not in part.licence]
    lines = [
        "# What the image holds, and under which licence",
        "",
        "Written by `make licences`; the tests hold it to requirements.lock and to the wheels. The same as a bill of",
        "materials (CycloneDX): [sbom.cdx.json](sbom.cdx.json). The service itself is under the Apache License 2.0.",
        "",
        "## Under the GPL",
        "These are native libraries in wheels. Whoever passes the image on must offer their sources. The LGPL asks",
        "the same for its libraries below (libav*, libheif, psycopg and others); other builds may take their places.",
        "",
        "| library | licence | wheel |",
        "| --- | --- | --- |",
        *(f"| {part.name} | {part.licence} | {part.wheel} |" for part in copyleft),
        "",
        "libx265 encodes HEVC, which the service never does; libheif of the same wheel links it. `make serve",
        "HEIC=without` and `docker build --build-arg HEIC=without` leave the wheel out: photos in HEIC are then",
        "refused as `unsupported-media-type`. libjbig packs one kind of TIFF; libtiff of the same wheel links it.",
        "",
        "## From Debian and its base image",
        "Each package has its licence in the image, as `/usr/share/doc/NAME/copyright`.",
        "",
        "| package | licence |",
        "| --- | --- |",
        *(f"| {name} | {licence} |" for name, licence in _DEBIAN),
        "",
        "## Scripts for browsers",
        "| script | licence | where |",
        "| --- | --- | --- |",
        *(f"| {name} | {licence} | {where} |" for name, licence, where in _OF_PAGES),
        "",
        "## Python packages",
        "| package | version | licence |",
        "| --- | --- | --- |",
        *(f"| {part.name} | {part.version} | {part.licence} |" for part in packages),
        "",
        "## Native libraries in their wheels",
        "| library | version of the file | licence | wheel |",
        "| --- | --- | --- | --- |",
        *(f"| {part.name} | {part.version} | {part.licence} | {part.wheel} |" for part in libraries),
    ]
    return "\n".join(lines) + "\n"


def bill_of(parts: list[Part]) -> str:
    """The bill of materials as JSON (CycloneDX 1.6): the same text for the same parts."""
    bill = Bom(serial_number=uuid5(NAMESPACE_URL, repr(parts)))
    bill.metadata.timestamp = datetime(2026, 1, 1, tzinfo=UTC)  # the same text every day
    for part in parts:
        where = part.wheel or part.name
        bill.components.add(
            Component(
                name=part.name,
                version=part.version or None,
                type=ComponentType.LIBRARY,
                bom_ref=part.name if part.wheel is None else f"{part.wheel}/{part.name}/{part.version}",
                purl=PackageURL("pypi", None, part.name, part.version) if part.wheel is None else None,
                group=None if part.wheel is None else where,
                licenses=[LicenseExpression(part.licence)],
            )
        )
    return json.dumps(json.loads(JsonV1Dot6(bill).output_as_string()), indent=1, sort_keys=True) + "\n"


def main() -> int:
    """Write both files."""
    try:
        parts = find_parts()
    except UnknownLicence as error:
        print(error, file=sys.stderr)
        return 1
    PAGE.write_text(page_of(parts), "utf-8")
    BILL.write_text(bill_of(parts), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
