"""Typical properties of print that several steps use. Lengths are multiples of the em of the print in question."""

LEAST_SPACE = 0.2
"""Narrower gaps are between letters."""
EDGE_SLACK = 0.35
"""Edges of print that differ by less are aligned."""
WEIGHT_STEP = 1.3
"""Bold strokes are 1.4 to 1.7 times as wide as regular ones."""
FULL_LINE = 12.0
"""Lines of running text are at least this wide, 24 letters: the columns of newspapers. Narrower lines are headings,
names, entries."""
UNRELIABLE_STEP = 1.35
"""The same where few letters show the size."""
SIZE_STEP = 1.12
"""Lines whose sizes differ by more are set in different sizes: print steps by 1.1 to 1.2."""
ROW_REACH = 3.6
"""Rows nearer than this are next to each other: three lines above and below. No print is wider spaced."""
WIDEST_VALUE = 22.0
"""Values of entries, items and notes are narrower; running text is wider."""
