"""Photos of the data: kinds from the README's table, texts and scans beside them."""

from pathlib import Path

import pytest

from benchmarks.rectify.photos import choose_photos
from benchmarks.rectify.real_photos import find_photos, varied


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Two folders; only the second has a table."""
    more = tmp_path / "photos_more"
    for folder in (tmp_path / "photos", more):
        folder.mkdir()
    for file in ("photos/book-a.jpg", "photos/desk.png", "photos_more/one.jpg", "photos_more/one.scan.jpg"):
        (tmp_path / file).touch()
    (more / "two.jpg").touch()
    for name in ("photos/book-a", "photos/desk", "photos_more/one"):
        (tmp_path / f"{name}.txt").write_text("A line\n")
    (more / "README.md").write_text(
        "| name | kind | text |\n| --- | --- | --- |\n| one | crumpled | yes |\n| two | curved |  |\n"
    )
    return tmp_path


def test_what_is_known_of_each_photo(data: Path) -> None:
    photos = find_photos(data)
    kinds = {photo.name: photo.kind for photo in photos}
    assert kinds == {"book-a": "book", "desk": "planar", "one": "crumpled", "two": "no-text"}
    assert {photo.name: photo.scan for photo in photos if photo.scan} == {
        "one": data / "photos_more" / "one.scan.jpg"
    }
    assert photos[0].truth == "A line\n"


def test_photos_are_chosen_by_name_and_kind(data: Path) -> None:
    photos = find_photos(data)
    assert [photo.name for photo in choose_photos(photos, "", "book,crumpled")] == ["book-a", "one"]
    assert [photo.name for photo in choose_photos(photos, "one,desk", "")] == ["desk", "one"]
    assert choose_photos(photos, "one", "book") == []


def test_kinds_take_turns_under_a_limit(data: Path) -> None:
    for name in ("book-b", "book-c"):
        (data / "photos" / f"{name}.jpg").touch()
        (data / "photos" / f"{name}.txt").write_text("Words")
    names = [photo.name for photo in varied(find_photos(data), 4)]
    assert names == ["one", "book-a", "desk", "two"]
    assert len(varied(find_photos(data), None)) == 6
