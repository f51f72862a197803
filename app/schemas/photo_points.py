"""Points of a photo in forms, as JSON: a region round the text, and the corners of a sheet."""

import json
import math

from services.contract.rectify import Corners

REGION_POINTS = (3, 200)
REGION_LIMIT_PX = 1e6
CORNERS = 4
_NUMBER = r"-?(0|[1-9][0-9]{0,5})(\.[0-9]{1,6})?"
_POINT = rf"\[ ?{_NUMBER} ?, ?{_NUMBER} ?\]"
REGION_PATTERN = rf"^(\[ ?{_POINT}( ?, ?{_POINT}){{2,199}} ?\])?$"
"""Pattern of `region` in the OpenAPI document. The parser also accepts other spellings of the same JSON.

An empty field counts as absent, as for every field of a form.
"""


def parse_region(text: str) -> tuple[tuple[float, float], ...]:
    """Polygon ((x, y), ...) in pixels, from JSON `[[x, y], ...]`.

    Raises
    ------
    ValueError
        When the text is not a JSON list of 3 to 200 points, each of two finite numbers of at most 1e6 in size.
    """
    expected = "expected JSON [[x, y], ...] of 3 to 200 points"
    try:
        points = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"{expected}; it is not JSON") from error
    if not isinstance(points, list) or not REGION_POINTS[0] <= len(points) <= REGION_POINTS[1]:
        raise ValueError(expected)
    for point in points:
        if not isinstance(point, list) or len(point) != 2 or not all(map(_is_coordinate, point)):
            raise ValueError(f"{expected}, each of two finite numbers of at most {REGION_LIMIT_PX:g} in size")
    return tuple((float(x), float(y)) for x, y in points)


def _is_coordinate(value: object) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
        and abs(value) <= REGION_LIMIT_PX
    )


def checked_region(text: str) -> str:
    """The unchanged `text`; ValueError if it is no region."""
    parse_region(text)
    return text


_CORNERS = rf"\[ ?{_POINT}( ?, ?{_POINT}){{3}} ?\]"
CORNERS_PATTERN = rf"^({_CORNERS}|\[ ?({_CORNERS}|null)( ?, ?({_CORNERS}|null)){{0,63}} ?\])?$"
"""Pattern of `corners` in the OpenAPI document; see `REGION_PATTERN`."""
MOST_PAGES = 1000
"""Entries of `corners` and `rotate`; the limit of pages is lower."""


def parse_corners(text: str) -> tuple[Corners | None, ...]:
    """The four corners of each page, None where they are sought, from JSON `[[x, y], ...]` or a list of such lists.

    Raises
    ------
    ValueError
        When the text is neither four points nor a list of four points or null for each page.
    """
    expected = (
        "expected JSON [[x, y], [x, y], [x, y], [x, y]], or a list of such corners and null for several pages"
    )
    try:
        sent = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"{expected}; it is not JSON") from error
    if not isinstance(sent, list) or not 0 < len(sent) <= MOST_PAGES:
        raise ValueError(expected)
    one_page = len(sent) > 0 and isinstance(sent[0], list) and not any(isinstance(v, list) for v in sent[0])
    return tuple(_corners(entry, expected) for entry in ([sent] if one_page else sent))


def _corners(entry: object, expected: str) -> Corners | None:
    if entry is None:
        return None
    if not isinstance(entry, list) or len(entry) != CORNERS:
        raise ValueError(f"{expected}; a sheet has {CORNERS} corners")
    for point in entry:
        if not isinstance(point, list) or len(point) != 2 or not all(map(_is_coordinate, point)):
            raise ValueError(f"{expected}, each of two finite numbers of at most {REGION_LIMIT_PX:g} in size")
    a, b, c, d = ((float(x), float(y)) for x, y in entry)
    return a, b, c, d


def checked_corners(text: str) -> str:
    """The unchanged `text`; ValueError if it has no corners."""
    parse_corners(text)
    return text
