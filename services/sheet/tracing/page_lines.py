"""All straight print of a page as lines: text by its characters or by profiles of darkness, and rules."""

from dataclasses import replace

import numpy as np

from services.arrays import Mask
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet.developable.observations import LineObservations
from services.sheet.tracing.line_tracing import trace_by_characters
from services.sheet.tracing.page_text import TracedText
from services.sheet.tracing.profile_tracing import trace_by_profiles
from services.sheet.tracing.rule_tracing import trace_rules

# When text by its characters does not do.
ENOUGH_LINES = 20
"""Text of as many lines shows the shape without rules and profiles."""
LONGER = 1.5
"""Profiles are used where they trace this much more: characters of some scripts hang together, and do not chain."""
THINNING = 4
"""Every so many windows of a profile are one point: neighbours share their error."""


def trace_lines(text: TracedText, view: PhotoFrame, page_map: PageMap) -> LineObservations:
    """The straight print in the flat view of `page_map`, in centred coordinates of the photo."""
    return with_rules(trace_by_characters(text, view, page_map), text, view, page_map)


def with_rules(
    lines: LineObservations, text: TracedText, view: PhotoFrame, page_map: PageMap
) -> LineObservations:
    """Text `lines`; where they are few, the rules after them, or lines by profiles where these are longer than both."""
    if lines.count // 2 >= ENOUGH_LINES:
        return lines
    both = _join(lines, trace_rules(text, view, page_map))
    profiles = trace_by_profiles(text, view, page_map)
    return _thinned(profiles, THINNING) if traced_length(profiles) > LONGER * traced_length(both) else both


def _join(lines: LineObservations, rules: LineObservations) -> LineObservations:
    if not rules.count:
        return lines
    return replace(
        lines,
        points=np.concatenate([lines.points, rules.points]),
        index=np.concatenate([lines.index, rules.index + lines.count]),
        deviations=np.concatenate([lines.deviations, rules.deviations]),
        text_height=lines.text_height if lines.count else rules.text_height,
    )


def traced_length(lines: LineObservations) -> float:
    """Sum of the lines' lengths in the photo, centred units."""
    if not lines.count:
        return 0.0
    low, high = np.full((lines.count, 2), np.inf), np.full((lines.count, 2), -np.inf)
    np.minimum.at(low, lines.index, lines.points)
    np.maximum.at(high, lines.index, lines.points)
    placed = np.isfinite(low).all(axis=1)
    return float(np.linalg.norm((high - low)[placed], axis=1).sum())


def _thinned(lines: LineObservations, step: int) -> LineObservations:
    """Every `step`-th point of each line; all lines keep their numbers."""
    order = np.argsort(lines.index, kind="stable")
    first = np.searchsorted(lines.index[order], lines.index[order])
    kept: Mask = np.zeros(len(order), bool)
    kept[order] = (np.arange(len(order)) - first) % step == 0
    return replace(
        lines, points=lines.points[kept], index=lines.index[kept], deviations=lines.deviations[kept]
    )
