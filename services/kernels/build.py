"""Compile the kernels with the machine's C compiler; where that cannot be, say so and succeed.

python -m services.kernels.build
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from services.kernels.library import FOLDER, PATTERN, library_path

FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-fPIC", "-shared")
"""Sums are those that are written: no product and sum are contracted."""
MOST_S = 300.0


def build_kernels() -> str:
    """Compile what is not compiled yet; what is wrong, or an empty text.

    The library is named by its sources and moved into its place whole: a process that runs keeps the one it has.
    """
    target = library_path()
    if target.exists() and target.stat().st_size:
        return ""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return "there is no C compiler"
    try:
        with tempfile.TemporaryDirectory(dir=FOLDER) as folder:
            made = Path(folder) / target.name
            wrong = _compile(compiler, made)
            if not wrong:
                for old in FOLDER.glob(PATTERN):
                    old.unlink(missing_ok=True)
                made.replace(target)
    except OSError as error:
        return f"{FOLDER.name}/ cannot be written: {error.strerror}"
    return wrong


def _compile(compiler: str, made: Path) -> str:
    command = [compiler, *FLAGS, *map(str, sorted(FOLDER.glob("*.c"))), "-o", str(made), "-lm"]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=MOST_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"the compiler did not run: {error}"
    first = next(iter(done.stderr.strip().splitlines()), "nothing")
    return f"the compiler said: {first}" if done.returncode else ""


if __name__ == "__main__":
    wrong = build_kernels()
    if wrong:
        print(
            f"Kernels are not compiled: {wrong}. The service runs with the plain versions; photos take longer.",
            file=sys.stderr,
        )
