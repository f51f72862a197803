"""The dissertation's own way to the shape of a curved page (3.3.3 to 3.3.6): rulings, vanishing points, planar strips.

Rulings are a family of four numbers over the page, then found by dynamic programming without crossings; their vanishing
points follow from profiles of lines and the cross ratio of paragraphs (`rulings`). Strips are fitted under six
constraints (`strips`). The product does not use it: its surface starts from flat sheets and is as accurate without. The
benchmarks measure each of its steps for the dissertation's tables.
"""
