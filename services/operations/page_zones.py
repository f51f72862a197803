"""Zones from a request: parsed, checked, and in pixels of the page's image."""

import json
from collections.abc import Collection
from dataclasses import replace

from services.arrays import RgbImage
from services.contract.layout import LayoutSettings
from services.contract.page_json import PageJson
from services.errors import InvalidOption
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_from_document
from services.layout.exchange.zones_file import read_zones_file
from services.layout.page import Box, InvalidLayout, Page
from services.notices import Notice

_MIN_SIDE_PX = 1.0
"""Of a box that a person gives as true: nothing is printed in less than a pixel."""


def read_zones(zones: bytes, settings: LayoutSettings) -> Page:
    """The page described by zones JSON of the HTTP contract."""
    try:
        return page_from_document(json.loads(zones), exchange_limits(settings))
    except InvalidLayout as error:
        raise InvalidOption(f"{error.field or 'zones'}: {error.detail}", error.field or "zones") from error
    except (ValueError, RecursionError) as error:
        raise InvalidOption("zones: this is not JSON.", "zones") from error


def read_file(
    data: bytes, picture: RgbImage | None, settings: LayoutSettings
) -> tuple[Page, tuple[Notice, ...]]:
    """The page of a zones file, and warnings about what was left out of it.

    The size of `picture` is needed when the file does not measure in pixels, or has no size.
    """
    notices: list[Notice] = []
    size = None if picture is None else (float(picture.shape[1]), float(picture.shape[0]))
    try:
        page = read_zones_file(data, exchange_limits(settings), size, notices.append)
    except InvalidLayout as error:
        within = "" if error.field in {None, "zones_file"} else f"{error.field}: "
        raise InvalidOption(f"zones_file: {within}{error.detail}", "zones_file") from error
    return page, tuple(notices)


def read_kept_page(document: PageJson, settings: LayoutSettings) -> Page:
    """The page of a stored result. Its zones are not limited again: it was within the limits at recognition."""
    bounds = replace(exchange_limits(settings), max_zones=max(settings.max_zones, 10_000))
    try:
        return page_from_document(document, bounds)
    except InvalidLayout as error:
        raise InvalidOption(f"page: {error.detail}", "page") from error


def exchange_limits(settings: LayoutSettings) -> ExchangeLimits:
    """Limits of a description of zones."""
    return ExchangeLimits(max_zones=settings.max_zones, max_bytes=settings.max_zones_file_bytes)


def check_boxes(page: Page, known: Collection[Box] = ()) -> None:
    """Raise `InvalidOption` for a box thinner than a pixel on the page, unless it is one of those that are `known`.

    What was found may be thin, such as a zone that the page's edge cuts, and may be confirmed as answers round it.
    """
    taken = {_rounded(box) for box in known}
    for index, zone in enumerate(page.zones):
        x0, y0, x1, y1 = zone.box
        if min(x1 - x0, y1 - y0) < _MIN_SIDE_PX and _rounded(zone.box) not in taken:
            field = f"zones[{index}].box"
            raise InvalidOption(
                f"{field}: The box is {x1 - x0:.3g} x {y1 - y0:.3g} pixels large on the page; give at least "
                f"{_MIN_SIDE_PX:g} x {_MIN_SIDE_PX:g}, or leave the zone out.",
                field,
            )


def _rounded(box: Box) -> tuple[float, ...]:
    return tuple(round(side, 2) for side in box)


def check_frame(page: Page, picture: RgbImage | None) -> None:
    """Raise `InvalidOption` unless the page has the size of the image."""
    if picture is None:
        return
    height, width = picture.shape[:2]
    if abs(page.width - width) > 1 or abs(page.height - height) > 1:
        raise InvalidOption(
            f"zones: they are on a page of {page.width:g} x {page.height:g} pixels, the image has {width} x {height}; "
            "give them in the image's pixels.",
            "zones",
        )
