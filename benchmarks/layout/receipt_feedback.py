"""What feedback on receipts teaches: one receipt of a shop before the next one, and streams of any shops.

A person draws the lines of a receipt over its answer and labels them; the model learns as the service does. Values that
are wrong count where the reading has them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.layout.protocols import recognize_finely
from benchmarks.layout.receipt_values import (
    CLASS,
    LABELS,
    Receipt,
    found_values,
    is_right,
    model_of,
    values_as_read,
)
from services.contract.layout_learning import VerifiedPage
from services.layout.learning.feedback import adapt_models
from services.layout.learning.revised_zones import revise_zones
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Zone
from services.layout.pipeline import content_features

FIRST = 10
"""Samples of other shops, before the one feedback."""
BEGUN = 5
"""Samples before a stream."""
LAST = 15
"""Receipts of a stream that count: its last ones."""

Wrong = Mapping[str, bool]
"""Whether each value that the reading has is wrong, by label."""


def taught(model: LayoutModel, receipt: Receipt) -> LayoutModel:
    """The model after a person has drawn the true lines, with their labels, over what it found."""
    features = content_features()
    seen = recognize_finely(receipt.fine, model)
    found = replace(seen.page, zones=tuple(replace(each.zone, label=each.label) for each in seen.zones))
    drawn = tuple(Zone(zone.id, zone.box, zone.kind, label=zone.label) for zone in receipt.true.zones)
    page = features.measure_page(revise_zones(found, replace(receipt.true, zones=drawn)))
    labels = {zone.id: zone.label for zone in page.zones}
    found_class = None if seen.chosen is None else seen.chosen.name
    verified = VerifiedPage(page, found_class, dict.fromkeys(labels), CLASS, labels, found)
    return adapt_models(verified, {CLASS: model}, {}, features.names, features)[1][CLASS].model


def wrong_values(model: LayoutModel, receipt: Receipt) -> Wrong:
    """Which values of a receipt the model gets wrong."""
    found, read = found_values(recognize_finely(receipt.fine, model)), values_as_read(receipt)
    return {
        label: not is_right(label, found[label], true)
        for label, true in receipt.values.items()
        if label in LABELS and is_right(label, read[label], true)
    }


def judge_pairs(receipts: Sequence[Receipt], seed: int, *, set_aside: bool) -> list[tuple[Wrong, Wrong]]:
    """Of each shop with two receipts, what is wrong on one before and after feedback on another one."""
    rng = np.random.default_rng([seed, FIRST])
    shown = [each for each in receipts if not each.is_set_aside]
    shops: dict[str, list[Receipt]] = {}
    for each in receipts:
        if each.is_set_aside == set_aside:
            shops.setdefault(each.shop, []).append(each)
    judged = []
    for shop, own in shops.items():
        if len(own) < 2:
            continue
        others = [each for each in shown if each.shop != shop]
        model = model_of([others[k] for k in rng.choice(len(others), FIRST, replace=False)])
        first, second = (own[k] for k in rng.choice(len(own), 2, replace=False))
        judged.append((wrong_values(model, second), wrong_values(taught(model, first), second)))
    return judged


def judge_stream(receipts: Sequence[Receipt], seed: int) -> list[tuple[Wrong, Wrong]]:
    """Of the last receipts of a stream, what is wrong without learning, and with feedback on all before it."""
    order = np.random.default_rng([seed, BEGUN]).permutation(len(receipts)).tolist()
    plain = learned = model_of([receipts[k] for k in order[:BEGUN]])
    judged = []
    for place, k in enumerate(order[BEGUN:]):
        if place >= len(order) - BEGUN - LAST:
            judged.append((wrong_values(plain, receipts[k]), wrong_values(learned, receipts[k])))
        learned = taught(learned, receipts[k])
    return judged


def count_wrong(judged: Sequence[Wrong]) -> tuple[int, int]:
    """How many values are wrong, and how many there are."""
    values = [value for each in judged for value in each.values()]
    return sum(values), len(values)
