"""Words found again after they were misread."""

from services.layout.content.fuzzy_words import ANCHORED, ANYWHERE, FuzzyWords


def test_words_are_found_again_after_misreading() -> None:
    words = FuzzyWords(["dear", "sincerely", "march", "cc", "maryland"], ANCHORED)
    assert words.near("deer") == ("dear",)
    assert words.near("s1ncerety") == ("sincerely",)
    assert words.near("rnarch") == ("march",)
    assert words.near("marylamd") == ("maryland",)
    assert words.near("ce") == words.near("x") == words.near("1234") == words.near("door") == ()
    assert "dear" in words
    assert "deer" not in words
    running = FuzzyWords(["march", "maryland", "mary"], ANYWHERE)
    assert running.near("match") == running.near("many") == ()
    assert running.near("rnarch") == ("march",)
    assert running.near("maryiand") == running.near("mryland") == ("maryland",)
