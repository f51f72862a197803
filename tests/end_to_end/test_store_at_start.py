"""A service that cannot remember does not start, and says why."""

import json
from pathlib import Path

import pytest

from tests.end_to_end.processes import ended


@pytest.mark.parametrize("what", ["no folder", "no database"])
def test_the_reason_is_told(tmp_path: Path, what: str) -> None:
    if what == "no folder":
        (tmp_path / "data").write_text("a file is in the way")
    else:
        (tmp_path / "data").mkdir()
        (tmp_path / "data" / "layout.sqlite3").write_text("no database at all" * 100)
    status, log = ended(data_dir=tmp_path / "data")
    assert status != 0
    (line,) = [line for line in log if line["logger"] == "app.storage.layout_store"]
    assert line["level"] == "error"
    assert line["data_dir"] == str(tmp_path / "data")
    assert f"{tmp_path / 'data'} (DATA_DIR)" in line["message"]
    assert ("cannot be made" if what == "no folder" else "damaged") in line["message"]


def test_a_server_that_does_not_answer_is_told_without_its_password(tmp_path: Path) -> None:
    url = f"postgresql://someone:secret-word@/layout?host={tmp_path}"
    status, log = ended(data_dir=tmp_path / "data", database_url=url)
    assert status != 0
    (line,) = [line for line in log if line["logger"] == "app.storage.layout_store"]
    assert "the database of DATABASE_URL could not be opened" in line["message"]
    assert "secret-word" not in json.dumps(log)
    assert not (tmp_path / "data").exists()
