"""Lines cut into parts, where a class labels parts of what segmentation keeps together.

A line is cut where a key ends, where a value begins or ends, and at wide spaces. The class's model labels all parts of
a page at once. Parts that it gives a label which its samples have within larger zones are taken out of their zone; what
is left of that stays together. So a grouping by print and one by words are matched, and the words decide only where
samples say so.
"""

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np

from services.layout.content.content_features import ContentFeatures
from services.layout.graph.layout_graph import build_graph
from services.layout.graph.zone_words import KEY_LEFT
from services.layout.grouping.line_cuts import places_of_cuts
from services.layout.matching import NO_PROOF, conditional_costs, match_directly
from services.layout.matching.cost_tables import CostTables
from services.layout.model.compiled_model import compile_model
from services.layout.model.cost import build_cost_tables
from services.layout.model.layout_model import LayoutModel, ModelNode
from services.layout.page import Page
from services.layout.recognition.label_evidence import zone_shares
from services.layout.segmentation import FinePage, Line, compose_with_lines
from services.layout.segmentation.measures import rows_of_lines
from services.ocr.engine import Word

MOST_PARTS = 200
"""Of a page; pairs grow with their square. A page with more lines is no form."""
LEAST_SHARE = 0.1
"""Of the zones of a label that lie within larger ones, from which on it is looked for there."""
KEY_SHARE = 0.5
"""Of the zones of a label that are parts, those whose key ends with one word, from which on a line is cut behind it."""
_MAY_BE = 2.0
"""Log odds against a label up to which a part may have it, as for values (`recognition.label_evidence`)."""


SINGLE = 2.5
"""Log odds of one zone a page against any larger number: one sample of twelve may have had two, or a sample whose total
segmentation divided would end it."""


ONE_LINE = 1.3
"""Mean number of lines of a label's zones from which on they are no single parts. Between 2.4 and 2.6 log odds an
address in one box became one of its lines: 13 of 13 addresses of a shop right, after a page was confirmed 1."""


LEAST_PAGES = 0.15
"""Parts with the label, per sample, from which on it is looked for. A caption of one title page in twelve that lay in a
larger zone made parts of lines of all others: zones with a wrong label 4.3 -> 18.8 %."""

LEAST_PARTS = 2
"""Parts with the label from which on it is looked for, where there are as many samples: one is chance."""


def labels_of_parts(model: LayoutModel) -> frozenset[str]:
    """The labels that the samples of a model have often enough within larger zones."""
    least = max(LEAST_PAGES * model.samples, min(LEAST_PARTS, model.samples))
    return frozenset(
        node.label
        for node in model.nodes
        if node.label is not None and node.pieces.within >= least and node.pieces.share_within >= LEAST_SHARE
    )


def take_out_parts(fine: FinePage, model: LayoutModel, features: ContentFeatures) -> FinePage:
    """The page with the parts taken out that `model` labels; the same object where it takes none.

    It takes nothing where no label of the model lies within larger zones, or where nothing was read.
    """
    within = labels_of_parts(model)
    if not within or not any(fine.words):
        return fine
    cut = cut_lines(fine, key_ends(model, within))
    if len(cut.fine.lines) > MOST_PARTS:
        return fine
    taken = _labels_of_parts(cut.fine, model, features, within)
    blocks = tuple(part for block in cut.blocks for part in _without_taken(cut.fine, block, taken))
    if len(blocks) == len(cut.blocks):
        return fine
    return _with_whole_lines(fine, cut, blocks)


def key_ends(model: LayoutModel, labels: Set[str]) -> frozenset[str]:
    """The words that most keys left of the zones of one of these labels end with."""
    found = set()
    for node in model.nodes:
        words = node.words.get(KEY_LEFT)
        if node.label in labels and words is not None:
            most = (token for token, count in words.tokens.items() if count > KEY_SHARE * words.zones)
            found |= {token[:-1] for token in most if token.endswith("$")}
    return frozenset(found)


def single_parts(model: LayoutModel) -> frozenset[str]:
    """The labels of parts that samples have once a page."""
    within = labels_of_parts(model)
    return frozenset(node.label for node in model.nodes if node.label in within and _is_single(node))


def _is_single(node: ModelNode) -> bool:
    """Whether one zone of the label on a page costs less than any other number, and more zones were never seen.

    Not where its zones have several lines: an address that is drawn as one zone is no single part.
    """
    costs = node.count_costs
    is_once = len(costs) > 2 and costs[1] == min(costs) and min(costs[2:]) - costs[1] > SINGLE
    return is_once and not _has_lines(node)


def _has_lines(node: ModelNode) -> bool:
    """Whether zones of the label mostly have more than one line."""
    lines = node.numeric.get("lines")  # log2(1 + lines)
    return lines is not None and 2.0**lines.value - 1.0 > ONE_LINE


@dataclass(frozen=True, slots=True)
class CutLines:
    """A page whose lines are parts, each of them a block, and the parts of every block and line of the page before."""

    fine: FinePage
    blocks: tuple[tuple[int, ...], ...]
    lines: tuple[tuple[int, ...], ...]


def cut_lines(fine: FinePage, keys: Set[str] = frozenset()) -> CutLines:
    """The page with its lines cut into parts, behind `keys` too."""
    made = _Lines([], [], [], [])
    parts: list[tuple[int, ...]] = []
    for index, line in enumerate(fine.lines):
        own = fine.words[index]
        edges = [0, *places_of_cuts(own, line.em * fine.scale, keys), len(own)]
        parts.append(tuple(made.add(fine, index, a, b) for a, b in pairwise(edges)))
    blocks = tuple(tuple(part for line in block for part in parts[line]) for block in fine.blocks)
    begins = frozenset(parts[line][0] for line in fine.begins)
    finer = made.page(fine, begins, ((part,) for block in blocks for part in block))
    return CutLines(finer, blocks, tuple(parts))


def _with_whole_lines(fine: FinePage, cut: CutLines, blocks: Sequence[Sequence[int]]) -> FinePage:
    """The page with `blocks` of its parts; neighbouring parts of a line that are in one block are one line again."""
    block_of = {part: place for place, block in enumerate(blocks) for part in block}
    made = _Lines([], [], [], [])
    line_of: dict[int, int] = {}
    for index, parts in enumerate(cut.lines):
        ends = np.cumsum([0, *(len(cut.fine.words[part]) for part in parts)]).tolist()
        places = range(len(parts))
        for _, run in groupby(places, key=lambda place: block_of.get(parts[place])):
            own = list(run)
            line = made.add(fine, index, ends[own[0]], ends[own[-1] + 1])
            line_of |= {parts[place]: line for place in own}
    begins = frozenset(line_of[cut.lines[line][0]] for line in fine.begins)
    return made.page(fine, begins, (dict.fromkeys(line_of[part] for part in block) for block in blocks))


@dataclass(frozen=True, slots=True)
class _Lines:
    """Lines of a page that are lines of another one, or parts of them."""

    lines: list[Line]
    boxes: list[np.ndarray]
    words: list[tuple[Word, ...]]
    texts: list[str]

    def add(self, fine: FinePage, index: int, begin: int, end: int) -> int:
        """Adds the words from `begin` to `end` of a line of `fine`; the place of what was added."""
        own, box = fine.words[index], fine.boxes[index]
        if (begin, end) == (0, len(own)):
            part, text = box, fine.texts[index]
        else:
            part, text = _box_of(own[begin:end], box), " ".join(word.text for word in own[begin:end])
        self.lines.append(_narrowed(fine.lines[index], box, part))
        self.boxes.append(part)
        self.words.append(own[begin:end])
        self.texts.append(text)
        return len(self.lines) - 1

    def page(self, fine: FinePage, begins: frozenset[int], blocks: Iterable[Iterable[int]]) -> FinePage:
        """The page of these lines in these blocks."""
        return replace(
            fine,
            lines=tuple(self.lines),
            boxes=np.array(self.boxes).reshape(-1, 4),
            words=tuple(self.words),
            texts=tuple(self.texts),
            begins=begins,
            blocks=tuple(map(tuple, blocks)),
        )


def _box_of(words: Sequence[Word], line: np.ndarray) -> np.ndarray:
    """The words' part of their line, as high as the line."""
    return np.array(
        [min(word.box[0] for word in words), line[1], max(word.box[2] for word in words), line[3]]
    )


def _narrowed(line: Line, old: np.ndarray, new: np.ndarray) -> Line:
    """The line from and to the sides of its part: both boxes in pixels of the page."""
    x0, y0, x1, y1 = line.box
    scale = (x1 - x0) / max(old[2] - old[0], 1e-9)
    return replace(line, box=(x0 + scale * (new[0] - old[0]), y0, x1 + scale * (new[2] - old[2]), y1))


def _labels_of_parts(
    fine: FinePage, model: LayoutModel, features: ContentFeatures, within: Set[str]
) -> list[str | None]:
    """Which of the labels `within` every part of the page has, None where none is probable.

    A label that no part has is given to the one that may have it most probably: the whole page decides later.
    """
    page, lines = compose_with_lines(fine)
    page = features.measure_page(page)
    graph = build_graph(page, features.names)
    compiled = compile_model(model, graph.content_names)
    tables = _without_counts_of_lines(build_cost_tables(graph, compiled), model, within)
    found = match_directly(tables, NO_PROOF).labels
    costs = conditional_costs(tables, found)
    shares = zone_shares(tables, found)
    is_text = np.array(
        [bool(zone.text.strip()) and bool(own) for zone, own in zip(page.zones, lines, strict=True)]
    )
    labels: list[str | None] = [None] * len(fine.lines)
    single = single_parts(model)
    for place, label in enumerate(compiled.labels):
        if label not in within or not is_text.any():
            continue
        excess = costs[:, place] - np.delete(costs, place, axis=1).min(axis=1)
        if label in single:
            chosen = _of_one_value(page, is_text, shares[:, place])
        else:
            chosen = np.flatnonzero(is_text & (found == place) & (excess < 0))
        if not len(chosen) or excess[chosen].min() >= _MAY_BE:
            nearest = int(np.argmin(np.where(is_text, excess, np.inf)))
            chosen = np.array([nearest] if excess[nearest] < _MAY_BE else [], np.intp)
        for zone in chosen:
            for part in lines[zone]:
                labels[part] = label
    return labels


def _without_counts_of_lines(tables: CostTables, model: LayoutModel, within: Set[str]) -> CostTables:
    """Tables in which several zones of a label cost no more than one, if its zones have lines: here each is a part."""
    count = tables.count.copy()
    for place, node in enumerate(model.nodes):
        if node.label in within and _has_lines(node):
            count[place, 2:] = np.minimum(count[place, 2:], count[place, 1])
    return replace(tables, count=count)


def _of_one_value(page: Page, is_text: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Places of the zones with one text that is most probably the label's, all together; each has its share (N,).

    A total is printed again beside the payment: wherever it is found, the value is the same.
    """
    by_text: dict[str, list[int]] = {}
    for place in np.flatnonzero(is_text).tolist():
        by_text.setdefault(_plain(page.zones[place].text), []).append(place)
    return np.array(max(by_text.values(), key=lambda places: shares[places].sum()), np.intp)


def same_value(texts: Iterable[str]) -> bool:
    """Whether texts have the same letters and digits."""
    return len(set(map(_plain, texts))) == 1


def _plain(text: str) -> str:
    return "".join(filter(str.isalnum, text.casefold()))


def _without_taken(
    fine: FinePage, block: tuple[int, ...], taken: Sequence[str | None]
) -> Iterator[tuple[int, ...]]:
    """Parts of a block that stay together: neighbours of one label in a row, and whole rows of one label."""
    if len({taken[part] for part in block}) == 1:
        yield block
        return
    together: list[int] = []
    before: str | None = None
    for places in rows_of_lines([fine.lines[part] for part in block], fine.boxes[list(block), 0].tolist()):
        row = [block[place] for place in places]
        runs = [(label, list(run)) for label, run in groupby(row, key=lambda part: taken[part])]
        for label, run in runs:
            if together and (len(runs) > 1 or label != before):
                yield tuple(together)
                together = []
            together += run
            before = label
        if len(runs) > 1:
            yield tuple(together)
            together = []
    if together:
        yield tuple(together)
