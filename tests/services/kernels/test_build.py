"""The set-up's compilation: a library that is named by its sources, or a reason why there is none."""

import errno
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from services.kernels import build, library


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of its own with the kernels' sources, in place of the package's."""
    for source in [*library.FOLDER.glob("*.[ch]"), library.FOLDER / "build.py"]:
        shutil.copy(source, tmp_path)
    monkeypatch.setattr(library, "FOLDER", tmp_path)
    monkeypatch.setattr(build, "FOLDER", tmp_path)
    library.find_kernels.cache_clear()
    yield tmp_path
    library.find_kernels.cache_clear()


def test_without_a_compiler_the_reason_is_told(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    assert build.build_kernels() == "there is no C compiler"
    assert library.find_kernels() is None
    assert not list(sources.glob("compiled-*"))


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_folder_that_cannot_be_written_is_told(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**options: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryDirectory", refuse)
    assert build.build_kernels() == f"{sources.name}/ cannot be written: Permission denied"


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_sources_that_do_not_compile_leave_nothing(sources: Path) -> None:
    (sources / "usable.c").write_text("int usable(void) { return nothing; }")
    assert build.build_kernels().startswith("the compiler said: ")
    assert not list(sources.glob("compiled-*"))
    assert not [path for path in sources.iterdir() if path.is_dir()]


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_library_of_other_sources_is_replaced(sources: Path) -> None:
    (sources / library.PATTERN.replace("*", "of-other-sources")).touch()
    assert build.build_kernels() == ""
    made = library.library_path()
    assert list(sources.glob(library.PATTERN)) == [made]
    built = made.stat().st_mtime_ns
    assert build.build_kernels() == ""
    assert made.stat().st_mtime_ns == built
    made.write_bytes(b"")
    assert build.build_kernels() == ""
    assert made.stat().st_size
    with (sources / "usable.c").open("a") as file:
        file.write("\n/* Another one. */\n")
    assert library.library_path() != made
    assert library.find_kernels() is None


def test_the_command_succeeds_where_it_cannot_compile(tmp_path: Path) -> None:
    """`make serve` goes on without kernels."""
    package = tmp_path / "services" / "kernels"
    shutil.copytree(library.FOLDER, package, ignore=shutil.ignore_patterns(library.PATTERN, "__pycache__"))
    (tmp_path / "services" / "__init__.py").touch()
    done = subprocess.run(
        [sys.executable, "-m", "services.kernels.build"],
        cwd=tmp_path,
        env={"PATH": "", "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0
    assert "there is no C compiler" in done.stderr
    assert "plain versions" in done.stderr


def test_the_address_of_an_array_is_that_of_its_first_number() -> None:
    array = np.arange(60.0).reshape(6, 10)
    fixed = array.copy()
    fixed.flags.writeable = False
    for each in (array, array[2:, 3:], array[::-1], array.T, fixed, array > 3, array.view(np.uint8)):
        assert library.address(each) == each.ctypes.data
