"""Text lines of a flat page as observations: baselines level, spacings equal, margins flush, with their deviations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Homography, Points, Vector
from services.geometry.focal_prior import FOCAL
from services.geometry.homographies import transform_points
from services.order_statistics import median_along
from services.robust import robust_scale
from services.sheet.developable.observations import MARGIN_DEVIATION, ObservationParameters
from services.sheet.tracing.baselines import Baselines, Paragraph, find_margins, group_alike, group_paragraphs

# Standard deviations of the observations of a flat page.
FLOW_FLOOR_RAD = np.deg2rad(0.1)
STROKE_FLOOR_RAD = np.deg2rad(0.3)
SHARP_TEXT_HEIGHT_PX = 18.0
"""Below this size of characters in the photo their mean slant varies, by the square of the ratio."""
BASELINE_FLOOR_RAD = np.deg2rad(0.03)
SKEW_RAD = np.deg2rad(0.3)
"""Angle between print and its sheet by printers and copiers; its loss permits a larger one, since print may be
slanted on purpose."""


@dataclass(frozen=True, slots=True)
class RefinementParameters(ObservationParameters):
    """Standard deviations of the observations of a flat page."""

    baseline_factor: float = 1.0
    believable_focal: float = FOCAL.believable
    """Infinite where the focal length is kept at the typical one already."""


@dataclass(frozen=True, slots=True, eq=False)
class FlatObservations:
    """Observed text lines in centred unit coordinates of the photo, with their groups."""

    starts: Points
    ends: Points
    slope_deviations: Vector
    relative_heights: Vector
    """Character height over the line's length."""
    paragraphs: list[Paragraph]
    margins: list[tuple[NDArray[np.intp], str]]
    alike: list[NDArray[np.intp]]
    """Groups of paragraph numbers with nearly the same spacing."""


def for_text(text_height_px: float) -> RefinementParameters:
    """Parameters for characters of this size in the photo: the apparent slant of small, blurred type varies more."""
    p = RefinementParameters()
    return replace(p, slant_rad=p.slant_rad * max(1.0, (SHARP_TEXT_HEIGHT_PX / text_height_px) ** 2))


def rescale_deviations(parameters: RefinementParameters, scales: tuple[float, float]) -> RefinementParameters:
    """Parameters whose deviations are those that a first fit has shown, where they are larger."""
    baseline, spacing = (max(1.0, scale) for scale in scales)
    return replace(
        parameters,
        baseline_factor=parameters.baseline_factor * baseline,
        spacing=parameters.spacing * spacing,
    )


def observe_lines(
    lines: Baselines, H_centred_flat: Homography, parameters: RefinementParameters
) -> FlatObservations:
    """Text lines of a flat view as observations in the photo."""
    p = parameters
    paragraphs = group_paragraphs(lines)
    length = np.maximum(lines.ends[:, 0] - lines.starts[:, 0], 1e-9)
    slope = p.baseline_factor * np.maximum(np.sqrt(2) * lines.deviations / length, BASELINE_FLOOR_RAD)
    margins = [(group, side) for side in ("left", "right") for group in find_margins(lines, side)]
    y = 0.5 * (lines.starts[:, 1] + lines.ends[:, 1])
    spacings = np.array([np.polyfit(q.order, y[q.lines], 1)[0] for q in paragraphs])
    return FlatObservations(
        transform_points(H_centred_flat, lines.starts),
        transform_points(H_centred_flat, lines.ends),
        slope,
        lines.heights / length,
        paragraphs,
        margins,
        group_alike(spacings),
    )


@dataclass(frozen=True, slots=True, eq=False)
class LineResiduals:
    """Residuals of the text lines under planes, in units of their deviations: (..., N) each."""

    baselines: Floats
    spacings: Floats
    margins: Floats

    def scales(self) -> tuple[float, float]:
        """Robust deviation of the baselines' and the spacings' residuals; 1 when the deviations were right."""
        return robust_scale(self.baselines, 1.0), robust_scale(self.spacings, 1.0)


class LineTerms:
    """The residuals of observed text lines as functions of the plane, with the groups of lines as flat arrays."""

    def __init__(self, observations: FlatObservations, parameters: RefinementParameters) -> None:
        o, p = observations, parameters
        self.o, self.p = o, p
        self._lines, self._paragraph = _flat([q.lines for q in o.paragraphs])
        orders = [q.order - q.order.mean() for q in o.paragraphs]
        self._order = np.concatenate([*orders, np.zeros(0)])
        self._sizes = np.bincount(self._paragraph, minlength=len(o.paragraphs)).astype(np.float64)
        self._squares = np.bincount(self._paragraph, self._order**2, len(o.paragraphs))
        self._begins = _begins(self._paragraph)
        self._alike, self._kind = _flat(o.alike)
        self._sizes_alike = self._sizes[self._alike]
        self._kind_sizes = np.bincount(self._kind, self._sizes_alike, len(o.alike))
        self._kind_begins = _begins(self._kind)
        # A short paragraph knows its spacing less well: its own deviation is added to the common one.
        own = p.spacing * np.sqrt(12.0) / np.maximum(self._sizes_alike, 1.0) ** 1.5
        self._alike_deviation = np.hypot(p.spacing, own)
        self._ends, self._margin = _flat([members for members, _ in o.margins])
        left = np.array([side == "left" for _, side in o.margins], bool)
        self._left = left[self._margin]

    def at(self, H: Floats) -> LineResiduals:
        """Baselines horizontal, spacing equal, margins vertical, in flat views `H` (..., 3, 3; plane <- centred)."""
        o, p = self.o, self.p
        a, b = transform_points(H, o.starts), transform_points(H, o.ends)
        delta = b - a
        y = (0.5 * (a[..., 1] + b[..., 1]))[..., self._lines]
        index = self._paragraph
        # The line through the places y of a paragraph's lines: `order` has no mean.
        spacing = _sums(self._order * y, self._begins) / self._squares
        middle = _sums(y, self._begins) / self._sizes
        each = spacing[..., index]
        uneven = (y - middle[..., index] - each * self._order) / (np.abs(each) * p.spacing)
        log = np.log(np.maximum(spacing[..., self._alike], 1e-9))
        mean = _sums(self._sizes_alike * log, self._kind_begins) / self._kind_sizes
        unlike = (log - mean[..., self._kind]) / self._alike_deviation
        length = np.hypot(delta[..., 0], delta[..., 1])
        text_height = (
            median_along(o.relative_heights * length, -1)[..., None] if len(o.starts) else np.ones(1)
        )
        x = np.where(self._left, a[..., self._ends, 0], b[..., self._ends, 0])
        margins = (x - _medians(x, self._margin)[..., self._margin]) / (MARGIN_DEVIATION * text_height)
        slopes = np.arctan2(delta[..., 1], np.abs(delta[..., 0])) / o.slope_deviations
        return LineResiduals(slopes, np.concatenate([uneven, unlike], axis=-1), margins)


def _flat(groups: Sequence[NDArray[np.intp]]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The members of all groups one after another (N,), and the number of each one's group (N,)."""
    members = np.concatenate([*groups, np.zeros(0, np.intp)]).astype(np.intp)
    return members, np.repeat(np.arange(len(groups)), [len(group) for group in groups])


def _begins(group: NDArray[np.intp]) -> NDArray[np.intp]:
    """Index of the first member of every group, whose numbers (N,) ascend from 0 without gaps."""
    return np.flatnonzero(np.diff(group, prepend=-1))


def _sums(values: Floats, begins: NDArray[np.intp]) -> Floats:
    """Sums (..., G) of the groups of `values` (..., N) that begin at `begins` (G,)."""
    if not len(begins):
        return np.zeros((*values.shape[:-1], 0))
    return np.asarray(np.add.reduceat(values, begins, axis=-1))


def _medians(values: Floats, group: NDArray[np.intp]) -> Floats:
    """Medians (..., G) of the groups of `values` (..., N), whose numbers (N,) ascend from 0 without gaps."""
    if not len(group):
        return np.zeros((*values.shape[:-1], 0))
    order = np.lexsort((values, np.broadcast_to(group, values.shape)), axis=-1)
    ordered = np.take_along_axis(values, order, axis=-1)
    size, first = np.bincount(group), _begins(group)
    return np.asarray(0.5 * (ordered[..., first + (size - 1) // 2] + ordered[..., first + size // 2]))
