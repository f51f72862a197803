"""How well the aspect of a sheet is known."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SheetAspect:
    """How well the aspect of a flat sheet is known whose four sides are seen.

    `log_deviation` is the standard deviation of its logarithm. Where the photo alone does not show the aspect, `likely`
    is the most probable of the known formats, with its `probability`.
    """

    log_deviation: float
    likely: str | None = None
    probability: float = 0.0
