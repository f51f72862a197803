"""Numbers of cells, however their countries write them."""

import math
import re
from decimal import Decimal

_DIGITS = re.compile(r"[-−–]?\d[\d.,'’ \u00a0\u202f]*")


def number_of(text: str) -> Decimal | None:
    """The one number of a text, whichever signs it has for decimals and thousands; None where it has none, or several.

    What follows the last point or comma are decimals unless they are three digits.
    """
    found = _DIGITS.findall(" ".join(text.split()))
    if len(found) != 1:
        return None
    digits = re.sub(r"[\s'’]", "", found[0]).replace("−", "-").replace("–", "-").rstrip(".,")
    whole, sign, decimals = digits, "", ""
    if (last := max(digits.rfind("."), digits.rfind(","))) >= 0:
        whole, sign, decimals = digits[:last], digits[last], digits[last + 1 :]
    if sign and len(decimals) == 3 and whole.lstrip("-") not in ("0", ""):
        whole, decimals = whole + decimals, ""
    whole = whole.replace(".", "").replace(",", "")
    try:
        return Decimal(f"{whole or '0'}.{decimals or '0'}")
    except ArithmeticError:
        return None


def size_of(number: Decimal) -> float:
    """The common logarithm of a number without its sign; of less than a thousandth that of this."""
    return math.log10(max(abs(float(number)), 1e-3))
