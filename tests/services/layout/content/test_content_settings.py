"""A user's file of content features: what it may do, and how its errors are told."""

import re
from pathlib import Path

import pytest

from services.layout.content.content_features import ContentFeatures
from services.layout.content.content_settings import InvalidContentSettings

FEATURES = ContentFeatures.load()


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_adds_extends_replaces_and_removes(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        """
        [greeting]
        phrases = ["moin"]
        words_at_most = 3
        [tax-number]
        patterns = ['[0-9]{2}-[0-9]{7}']
        [zipcode]
        replace = true
        at = "whole"
        patterns = ['[A-Z][0-9][A-Z] ?[0-9][A-Z][0-9]']
        [ps]
        remove = true
        """,
    )
    mine = ContentFeatures.load(path)
    assert set(mine.names) == (set(FEATURES.names) | {"tax-number"}) - {"ps"}
    assert mine.measure("Moin Herr Bell")["greeting"] == mine.measure("Dear Herr Bell")["greeting"] == 1.0
    assert FEATURES.measure("Moin Herr Bell")["greeting"] == 0.0
    assert mine.measure("Dear Mr. Bell and all the others")["greeting"] < 0.5
    assert mine.measure("EIN 12-3456789")["tax-number"] == 1.0
    assert mine.measure("K1A 0B1")["zipcode"] == 1.0
    assert mine.measure("MD 20742")["zipcode"] == 0.0


WRONG = [
    ("greeting = 3", "greeting", "table"),
    ("[x]\nat = 'middle'\nphrases = ['a']", "x.at", "start, line"),
    ("[x]\nphrase = ['a']", "x.phrase", "no such key"),
    ("[x]\nphrases = 'a'", "x.phrases", "list"),
    ("[x]\nphrases = ['a', '']", "x.phrases[1]", "empty"),
    ("[x]\npatterns = ['(']", "x.patterns[0]", "regular expression"),
    ("[x]\npatterns = ['b', '(a+)+b']", "x.patterns[1]", "too many ways"),
    ("[x]\nwords_at_most = 2", "x", "neither"),
    ("[x]\nphrases = ['a']\nfull_share = 7", "x.full_share", "0.01 to 1"),
    ("[x]\nphrases = ['a']\nfull_share = nan", "x.full_share", "0.01 to 1"),
    ("[x]\nphrases = ['a']\nwords_at_most = true", "x.words_at_most", "whole number"),
    ("[x]\nphrases = ['a']\nfuzzy = 'no'", "x.fuzzy", "0 to 1"),
    ("[x]\nphrases = ['a']\nreplace = 1", "x.replace", "true or false"),
    ("[x]\nremove = 1", "x.remove", "true or false"),
    ("[x", "", "TOML"),
]


@pytest.mark.parametrize(("text", "key", "reason"), WRONG)
def test_errors_name_file_and_key(tmp_path: Path, text: str, key: str, reason: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(InvalidContentSettings, match=re.escape(reason)) as caught:
        ContentFeatures.load(path)
    assert (caught.value.path, caught.value.key) == (path, key)
    assert str(path) in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidContentSettings, match="cannot be read"):
        ContentFeatures.load(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(InvalidContentSettings, match="no TOML"):
        ContentFeatures.load(tmp_path / "bytes.toml")
