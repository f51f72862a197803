"""How the amount of a zone agrees with the other amounts of its page.

A total stands on a page again beside the payment, and it is what other amounts add up to. Which of several sums it is
says the order on the page: parts are added up below them, and below the last sum there is only what was paid.
"""

import re

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats
from services.layout.graph.node_attributes import LONGEST_TEXT
from services.layout.page import Page

AMOUNT_FEATURES = (
    "amount:again",
    "amount:sum",
    "amount:added-below",
    "amount:added-above",
    "amount:last-sum",
)
"""Of the one amount of a zone, whether

- the page has it in another place;
- two other amounts add up to it;
- it and another one add up to a third, which stands below both (a subtotal, a tax);
- they do, and it stands elsewhere (the total and the change, to the cash between them);
- two amounts above add up to it, and it is in no sum below.

They are content features that samples teach, not rules. That no amount is larger is not among them: payments in cash
are."""

MOST_AMOUNTS = 60
"""Different amounts of a page; among more, sums occur by chance."""
_AMOUNT = re.compile(r"(?<![\d.,])([-−]\s?)?(\d{1,3}(?:[.,' ]?\d{3}){0,3}[.,]\d{2})(?![.,]?\d)")


def find_amounts(text: str) -> list[int]:
    """The numbers with two decimals in a text, in hundredths."""
    found = _AMOUNT.finditer(text[:LONGEST_TEXT])
    return [(-1 if match[1] else 1) * int(re.sub(r"\D", "", match[2])) for match in found]


def measure_amounts(page: Page, printed: Page) -> Floats:
    """`AMOUNT_FEATURES` (N, 5) of the zones of a page, each 0 or 1; 0 for zones without an amount, or with several.

    `printed` is the same page with all of its print. An amount of 0.00 is none.
    """
    features = np.zeros((len(page.zones), len(AMOUNT_FEATURES)))
    every = [
        (amount, (zone.box[1] + zone.box[3]) / 2)
        for zone in printed.zones
        for amount in find_amounts(zone.text)
        if amount
    ]
    amounts, heights = np.array(every, np.float64).reshape(-1, 2).T
    values, place, times = np.unique(amounts, return_inverse=True, return_counts=True)
    if len(values) > MOST_AMOUNTS:
        return features
    first, last = np.full(len(values), np.inf), np.full(len(values), -np.inf)
    np.minimum.at(first, place, heights)
    np.maximum.at(last, place, heights)
    for row, zone in zip(features, page.zones, strict=True):
        own = find_amounts(zone.text)
        if len(own) == 1 and own[0]:
            # Two of the same amount are one value here, so none is twice another one.
            other = values != own[0]
            height = (zone.box[1] + zone.box[3]) / 2
            row[0] = np.any(times[~other] > 1)
            row[1:] = _sums(own[0], height, values[other], first[other], last[other])
    return features


def _sums(
    own: int, height: float, others: Floats, first: Floats, last: Floats
) -> tuple[bool, bool, bool, bool]:
    """The last four of `AMOUNT_FEATURES` of an amount at a height on the page.

    `first` and `last` (M,) are the heights at which the page has the `others` (M,), in ascending order, first and last.
    """
    a, b = _pairs(own - others, others)
    a, b = a[a != b], b[a != b]
    are_above = (first[a] < height) & (first[b] < height)
    by, whole = _pairs(own + others, others)
    is_below = (last[whole] > height) & (last[whole] > first[by])
    added_below = bool(is_below.any())
    return len(a) > 0, added_below, not is_below.all(), bool(are_above.any()) and not added_below


def _pairs(wanted: Floats, others: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places of the `wanted` (M,) that are among the ascending `others` (M,), and where they are there."""
    found = np.flatnonzero(np.isin(wanted, others))
    return found, np.searchsorted(others, wanted[found])
