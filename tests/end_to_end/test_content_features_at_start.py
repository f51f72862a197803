"""A service whose settings file of content features is damaged does not start, and names the entry."""

from pathlib import Path

import pytest

from tests.end_to_end.processes import ended


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[date]\npatterns = ['(a*)*']", "date.patterns[0]: '(a*)*' can be tried in too many ways"),
        ("no settings", "no TOML"),
    ],
)
def test_the_entry_is_named(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "features.toml"
    path.write_text(text)
    status, log = ended(data_dir=tmp_path, content_features=path)
    assert status != 0
    (line,) = [line for line in log if line["logger"] == "app.main"]
    assert line["level"] == "error"
    assert f"(CONTENT_FEATURES) cannot be used: {path}: {reason}" in line["message"]
