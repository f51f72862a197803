"""The segmentation of a page, from its image to zones in reading order."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.layout.page import Box, Page, Zone
from services.layout.segmentation.components import Boxes, Indices
from services.layout.segmentation.entries import find_entries
from services.layout.segmentation.frame import Frame, PrintedPage, analyse_print
from services.layout.segmentation.gathering import gather_scraps, trim_figures
from services.layout.segmentation.ink import Components
from services.layout.segmentation.measures import (
    zone_alignment,
    zone_font_size,
    zone_line_spacing,
    zone_weight,
)
from services.layout.segmentation.non_text import Part, find_parts, without_dirt
from services.layout.segmentation.page_numbers import split_page_numbers
from services.layout.segmentation.parameters import SegmentationParameters
from services.layout.segmentation.reading_order import reading_order
from services.layout.segmentation.text_line_choice import ReadLines, choose_text_lines
from services.layout.segmentation.text_lines import Line, find_lines, measure_line, unite_boxes
from services.layout.segmentation.words import assign_words, line_confidences, line_texts
from services.layout.segmentation.zone_grouping import group_lines
from services.ocr.engine import Word


def segment_page(
    gray: GrayImage,
    words: Sequence[Word] | None,
    parameters: SegmentationParameters | None = None,
) -> Page:
    """Zones of a flat, upright page: text at paragraph level, figures, rules and noise, in reading order.

    Lines and zones are found from connected components alone; words show which of them are text, and what it says.

    Parameters
    ----------
    gray : (H, W) uint8, print dark or light on its ground, skewed by at most `largest_skew_deg`.
    words : OCR words of the page, boxes in its pixels; None or empty without an engine.

    Returns
    -------
    Page of W x H px; boxes in its pixels, ids "z1", "z2" ... in reading order. A blank page has no zones.
    """
    parameters = parameters or SegmentationParameters()
    height, width = gray.shape
    printed = analyse_print(gray, parameters)
    if printed is None:
        return Page(float(width), float(height), ())
    levelled = printed.levelled
    lines = find_lines(levelled, np.flatnonzero(printed.kinds.glyphs), parameters)
    lines = split_page_numbers(lines, levelled, printed.frame.size[1], parameters)
    read = _read(lines, words, printed.frame, parameters)
    is_text = choose_text_lines(lines, read, levelled, printed.frame.size, parameters)
    texts = [text for text, kept in zip(read.texts, is_text, strict=True) if kept]
    lines = [line for line, kept in zip(lines, is_text, strict=True) if kept]
    lines, texts, begins = _join_entries(lines, texts, levelled, parameters)
    line_boxes = np.array([line.box for line in lines]).reshape(-1, 4)
    blocks = group_lines(lines, begins, levelled, printed.frame.size[1], parameters)
    hulls = np.array([_hull([lines[index] for index in block]) for block in blocks]).reshape(-1, 4)
    unused = ~_lie_within(levelled.boxes, hulls)
    for line in lines:
        unused[line.members] = False
    parts = find_parts(
        levelled, printed.kinds, unused, line_boxes, printed.unit, printed.frame.size, parameters
    )
    blocks = _without_inner(blocks, hulls, lines, texts, parts, levelled, parameters)
    is_sure = np.array([sum(map(str.isalnum, text)) > 1 for text in texts], dtype=bool)
    blocks, parts = gather_scraps(blocks, lines, is_sure, parts, levelled, printed.unit, parameters)
    parts = without_dirt(parts, levelled, printed.unit, parameters)
    column = (float(line_boxes[:, 0].min()), float(line_boxes[:, 2].max())) if lines else (0.0, 0.0)
    zones = [
        _text_zone([lines[i] for i in block], [texts[i] for i in block], printed, column) for block in blocks
    ]
    for part in parts:
        zones.append(Zone("", _union(printed.components, part.members, printed.frame), kind=part.kind))
    zones = trim_figures(zones, parameters)
    order = reading_order([zone.box for zone in zones])
    numbered = (replace(zones[index], id=f"z{number}") for number, index in enumerate(order, 1))
    return Page(float(width), float(height), tuple(numbered))


def _join_entries(
    lines: list[Line], texts: list[str], levelled: Components, parameters: SegmentationParameters
) -> tuple[list[Line], list[str], set[int]]:
    """Lines and their texts with entries of lists joined, and the indices of those, which begin zones."""
    value_of = dict(find_entries(lines, parameters))
    values = set(value_of.values())
    joined: list[Line] = []
    read: list[str] = []
    begins: set[int] = set()
    for index, line in enumerate(lines):
        if index in values:
            continue
        text, value, members = texts[index], value_of.get(index), line.members
        if value is not None:
            begins.add(len(joined))
            members = np.concatenate([members, lines[value].members])
            text = f"{text} {texts[value]}".strip()
        joined.append(line if value is None else measure_line(levelled, members, parameters))
        read.append(text)
    return joined, read, begins


def _read(
    lines: Sequence[Line], words: Sequence[Word] | None, frame: Frame, parameters: SegmentationParameters
) -> ReadLines:
    """Text and confidence of every line."""
    sure = [
        word
        for word in words or ()
        if word.confidence >= parameters.least_confidence and any(map(str.isalnum, word.text))
    ]
    if not sure or not lines:
        return ReadLines([""] * len(lines), np.zeros(len(lines)))
    boxes = np.array([line.box for line in lines])
    word_boxes = frame.level(np.array([word.box for word in sure]) / np.array([*frame.scale, *frame.scale]))
    line_of_word = assign_words(sure, word_boxes, boxes)
    texts = line_texts(sure, word_boxes, line_of_word, len(lines))
    return ReadLines(texts, line_confidences(sure, line_of_word, len(lines)))


def _hull(lines: Sequence[Line]) -> NDArray[np.float64]:
    boxes = np.array([line.box for line in lines])
    return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])


def _lie_within(boxes: Boxes, blocks: Boxes) -> NDArray[np.bool_]:
    """Which of `boxes` (N, 4) lie by most of their area in one of `blocks` (M, 4)."""
    area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    within = np.zeros(len(boxes), dtype=bool)
    for x0, y0, x1, y1 in blocks:
        across = np.minimum(boxes[:, 2], x1) - np.maximum(boxes[:, 0], x0)
        down = np.minimum(boxes[:, 3], y1) - np.maximum(boxes[:, 1], y0)
        within |= np.maximum(across, 0.0) * np.maximum(down, 0.0) > 0.6 * area
    return within


def _without_inner(
    blocks: list[list[int]],
    hulls: Boxes,
    lines: Sequence[Line],
    texts: Sequence[str],
    parts: Sequence[Part],
    levelled: Components,
    parameters: SegmentationParameters,
) -> list[list[int]]:
    """`blocks` without scraps of unread print that lie in a figure: letters of a plot, a logo or a stamp."""
    figures = [
        unite_boxes(levelled.boxes[part.members], np.zeros(len(part.members), dtype=np.intp))
        for part in parts
        if part.kind == "figure"
    ]
    if not figures or not blocks:
        return blocks
    inner = _lie_within(hulls, np.concatenate(figures))
    kept = []
    for block, lies in zip(blocks, inner, strict=True):
        count = sum(len(lines[index].members) for index in block)
        if not lies or count >= parameters.inner_components or any(texts[index] for index in block):
            kept.append(block)
    return kept


def _union(components: Components, members: Indices, frame: Frame) -> Box:
    """Box of components in pixels of the page."""
    boxes = components.boxes[members]
    sx, sy = frame.scale
    x0, y0 = boxes[:, :2].min(axis=0)
    x1, y1 = boxes[:, 2:].max(axis=0)
    return float(x0 * sx), float(y0 * sy), float(x1 * sx), float(y1 * sy)


def _text_zone(
    lines: list[Line], texts: list[str], printed: PrintedPage, column: tuple[float, float]
) -> Zone:
    scale = printed.frame.mean_scale
    em = zone_font_size(lines)
    spacing = zone_line_spacing(lines)
    members = np.concatenate([line.members for line in lines])
    return Zone(
        id="",
        box=_union(printed.components, members, printed.frame),
        kind="text",
        lines=len(lines),
        font_size=em * scale,
        line_spacing=None if spacing is None else spacing * scale,
        weight=zone_weight(lines),
        alignment=zone_alignment(lines, column, em),
        text="\n".join(text for text in texts if text),
    )
