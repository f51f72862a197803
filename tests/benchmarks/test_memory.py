"""What is kept between runs is found again by the picture itself, and failures are not kept."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.memory import Memory
from benchmarks.common.reading import Reading
from benchmarks.common.scan_distances import ScanDistances
from benchmarks.common.stopwatch import Usage
from services.ocr.engine import Word

IMAGE = np.full((40, 30, 3), 200, np.uint8)
IMAGE[10:12, 5:25] = 20


class Counting:
    """Reads how often it was asked."""

    def __init__(self, name: str = "counting") -> None:
        self.name = name
        self.asked = 0

    def read(self, image: np.ndarray) -> Reading:
        """See `Reader`."""
        self.asked += 1
        return Reading(f"“{self.asked}”", self.asked)


def test_an_image_is_read_once(tmp_path: Path) -> None:
    reader = Counting()
    assert Memory(tmp_path).read(reader, IMAGE) == Reading("“1”", 1)
    assert Memory(tmp_path).read(reader, IMAGE) == Reading("“1”", 1)
    assert Memory(tmp_path).read(reader, IMAGE[::-1]).sure_characters == 2
    assert Memory(tmp_path).read(Counting("other"), IMAGE).sure_characters == 1
    assert reader.asked == 2
    assert {file.suffix for file in tmp_path.iterdir()} == {".json"}


def test_words_of_a_page_are_read_once(tmp_path: Path) -> None:
    class Engine:
        name = "counting"
        asked = 0

        def read_page(self, image: np.ndarray) -> list[Word]:
            """See `OcrEngine`."""
            self.asked += 1
            return [Word("Ä", (1.0, 2.0, 3.0, 4.5), 0.5)]

        def read_line(self, image: np.ndarray) -> tuple[str, float]:
            """See `OcrEngine`."""
            return "", 0.0

    engine, page = Engine(), np.ascontiguousarray(IMAGE[..., 0])
    first = Memory(tmp_path).page_words(engine, page)
    assert Memory(tmp_path).page_words(engine, page) == first == [Word("Ä", (1.0, 2.0, 3.0, 4.5), 0.5)]
    assert engine.asked == 1
    Memory(None).page_words(engine, page)
    assert engine.asked == 2


def test_without_a_folder_nothing_is_kept() -> None:
    reader, memory = Counting(), Memory(None)
    assert [memory.read(reader, IMAGE).sure_characters for _ in range(2)] == [1, 2]


@pytest.mark.parametrize("peer", ["page_dewarp", "uvdoc"])
def test_the_peers_pages_are_kept_and_its_failures_are_not(
    peer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = [(None, Usage(1.0, 1.0, 5.0), "exit status 1"), (IMAGE, Usage(2.0, 3.0, 4.0), "")]
    monkeypatch.setattr(f"benchmarks.common.memory.run_{peer}", lambda command, photo: answers.pop(0))
    ask = getattr(Memory(tmp_path), peer)
    assert ask("/one/command", IMAGE)[2] == "exit status 1"
    for command in ("/one/command", "/another"):
        page, usage, trouble = ask(command, IMAGE)
        assert page is not None
        assert np.array_equal(page, IMAGE)
        assert usage == Usage(2.0, 3.0, 4.0)
        assert trouble == ""
    assert not answers


def test_distances_are_kept_for_the_view_and_the_scan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = [ScanDistances(0.5, 2.0, 0.1, 1.0), ScanDistances(0.7, 1.0, 0.2, 3.0)]
    monkeypatch.setattr("benchmarks.common.memory.compare_with_scan", lambda view, scan: answers.pop(0))
    memory = Memory(tmp_path)
    assert memory.distances(IMAGE, IMAGE) == memory.distances(IMAGE, IMAGE)
    assert memory.distances(IMAGE, IMAGE[::-1]).ms_ssim == 0.7
    assert not answers
