"""Filters band by band: what a filter needs besides its result is as large as a band, not as the image."""

from collections.abc import Iterator

BAND_ROWS = 256
"""Rows of a band. A band of an analysis image and its filtered versions stay in the processor's cache."""


def row_bands(height: int, halo: int, band_rows: int = BAND_ROWS) -> Iterator[tuple[slice, slice, slice]]:
    """Bands of `band_rows` of an image of `height` rows for a filter that looks `halo` rows up and down.

    Yields the rows of the band, those that the filter has to see, and the rows of the band among the seen ones.
    """
    top = 0
    while top < height:
        bottom = min(top + band_rows, height)
        # The filter reflects at the image's ends only, and needs its halo on this side of them.
        if height - bottom < halo:
            bottom = height
        first = max(top - halo, 0)
        last = min(bottom + halo, height)
        yield slice(top, bottom), slice(first, last), slice(top - first, bottom - first)
        top = bottom
