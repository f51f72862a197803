"""How well the aspect of a sheet is known."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SheetAspect:
    """How well the aspect of a flat sheet is known whose four sides are seen.

    `aspect` is that of the rectangle between the lines of its sides, width over height on the page, and
    `log_deviation` the standard deviation of the logarithm. Where the photo alone does not show the aspect, `likely`
    is the most probable of the known formats, with its `probability`.
    """

    aspect: float
    log_deviation: float
    likely: str | None = None
    probability: float = 0.0
