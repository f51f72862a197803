"""One photo of a page -> its frontal flat view (dissertation, chapter 3)."""
