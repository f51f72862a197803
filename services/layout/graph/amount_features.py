"""How the amount of a zone agrees with the other amounts of its page.

A total stands on a page again beside the payment, and it is what other amounts add up to.
"""

import re

import numpy as np
from numpy.typing import NDArray

from services.layout.page import Page

AMOUNT_FEATURES = ("amount:again", "amount:sum", "amount:part")
"""Whether the page has the same amount in another place, whether two other amounts add up to it, and whether it and
another one add up to a third. They are content features that samples teach, not rules. That no amount is larger is not
among them: payments in cash are."""

MOST_AMOUNTS = 60
"""Different amounts of a page; among more, sums occur by chance."""
_SEARCHED = 4000
"""Characters of a zone that are read."""
_AMOUNT = re.compile(r"(?<![\d.,])\d{1,3}(?:[.,' ]?\d{3}){0,3}[.,]\d{2}(?![.,]?\d)")


def find_amounts(text: str) -> list[int]:
    """The numbers with two decimals in a text, in hundredths."""
    return [int(re.sub(r"\D", "", match[0])) for match in _AMOUNT.finditer(text[:_SEARCHED])]


def measure_amounts(page: Page, printed: Page) -> NDArray[np.float64]:
    """`AMOUNT_FEATURES` (N, 3) of the zones of a page, each 0 or 1; 0 for zones without an amount, or with several.

    `printed` is the same page with all of its print.
    """
    features = np.zeros((len(page.zones), len(AMOUNT_FEATURES)))
    every = [amount for zone in printed.zones for amount in find_amounts(zone.text) if amount > 0]
    values, times = np.unique(np.array(every, np.int64), return_counts=True)
    if len(values) > MOST_AMOUNTS:
        return features
    for place, zone in enumerate(page.zones):
        own = find_amounts(zone.text)
        if len(own) != 1 or own[0] <= 0:
            continue
        others = values[values != own[0]]
        # Two of the same amount are one value here, so none is twice another one.
        addends = others[2 * others != own[0]]
        features[place] = (
            np.any(times[values == own[0]] > 1),
            np.any(np.isin(own[0] - addends, addends)),
            np.any(np.isin(own[0] + others, others)),
        )
    return features
