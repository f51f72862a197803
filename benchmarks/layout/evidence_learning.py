"""Learning the weights of evidence: how probably a label is right, from images of labelled pages.

python -m benchmarks layout_evidence [--sets letters/real,memos] [--sizes 3,5,all] [--limit N]

Models of N samples label other pages: from their images, and once more as if no text had been read. A logistic
regression on the features of these labels gives the weights of `label_evidence`, for read and for unread pages; each
set and number of samples weighs the same. For each set the weights are learned once more without it; of these are the
expected calibration error and the log loss, without the line that a class adds. Nothing is compared with a baseline.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks.layout.label_trust import expected_error, splits_of
from benchmarks.layout.part import table
from benchmarks.layout.protocols import make_model, recognize_finely, recognized
from benchmarks.layout.truth import TITLES_MADE
from benchmarks.layout.weight_learning import Task, measure_cases, told
from benchmarks.layout.word_labels import SETS, Photo
from services.layout.graph.layout_graph import build_graph
from services.layout.learning.label_transfer import transfer_labels
from services.layout.matching import conditional_costs
from services.layout.model.compiled_model import compile_model
from services.layout.model.cost import build_cost_tables
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.pipeline import content_features
from services.layout.recognition.label_evidence import (
    EVIDENCE_FEATURES,
    READ,
    UNREAD,
    LabelEvidence,
    label_features,
)
from services.layout.recognition.results import Recognition

NAME = "layout_evidence"
LEARNED_SETS: Mapping[str, tuple[str, str | None]] = {
    **SETS,
    **{source: (source, None) for source in TITLES_MADE},
    "made letters": ("letters/made", "letter"),
}
"""Folder and class (None: all) of each set."""
SIZES = ("1", "3", "5", "10", "all")
DRAWS = 3
RIDGE = 1e-4
"""Weight of the squares of the weights: it decides only where a feature is the same for all labels."""
KINDS = {"read": READ, "unread": UNREAD}

Judged = tuple[NDArray[np.float64], NDArray[np.bool_]]
"""Features (N, 8) of labels, and which of them are right."""
Case = tuple[str, str]
"""Set and number of samples."""


def without_texts(page: Page) -> Page:
    """The page as if no engine had read it."""
    return replace(page, zones=tuple(replace(zone, content={}, text="", words=()) for zone in page.zones))


def features_of(seen: Recognition, model: LayoutModel, kind: LabelEvidence) -> NDArray[np.float64]:
    """`EVIDENCE_FEATURES` (N, 8) of the labels of a page that this model alone has labelled."""
    graph = build_graph(seen.page, content_features().names)
    compiled = compile_model(model, graph.content_names)
    tables = build_cost_tables(graph, compiled)
    labels = np.array([compiled.labels.index(zone.label) for zone in seen.zones])
    return label_features(tables, labels, conditional_costs(tables, labels), model.samples, kind)


def judge_labels_of(photos: Sequence[Photo], size: str) -> dict[str, Judged]:
    """Labels of pages by models of `size` samples, of each of the `KINDS`."""
    found: dict[str, list[Judged]] = {name: [] for name in KINDS}
    for learned, tested in splits_of(len(photos), size, DRAWS):
        read = make_model("class", [(photos[at].true, photos[at].own) for at in learned])
        bare = [(without_texts(photos[at].true), without_texts(photos[at].own)) for at in learned]
        unread = make_model("class", bare)
        for at in tested:
            seen = recognize_finely(photos[at].fine, read)
            found["read"].append(_judge(seen, transfer_labels(photos[at].true, seen.page), read, READ))
            page = without_texts(photos[at].own)
            seen = recognized(page, {"class": unread})
            found["unread"].append(_judge(seen, page, unread, UNREAD))
    return {name: join(each) for name, each in found.items()}


def _judge(seen: Recognition, true: Page, model: LayoutModel, kind: LabelEvidence) -> Judged:
    is_right = [each.label == zone.label for each, zone in zip(seen.zones, true.zones, strict=True)]
    return features_of(seen, model, kind), np.array(is_right, bool)


def join(judged: Sequence[Judged]) -> Judged:
    """All of them as one."""
    features, is_right = zip(*judged, strict=True)
    return np.concatenate(features), np.concatenate(is_right)


def fit_weights(cases: Sequence[Judged], kind: LabelEvidence) -> NDArray[np.float64]:
    """Weights (8,) under which the labels are most probable, each case weighing the same.

    Features without a weight in `kind` are left out.
    """
    features, is_right = join(cases)
    weight = np.concatenate([np.full(len(right), 1.0 / len(right)) for _, right in cases])
    used = np.flatnonzero(kind.weights)
    features = features[:, used]

    def cost(weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        odds = features @ weights
        value = weight @ (np.logaddexp(0.0, odds) - is_right * odds) + RIDGE * weights @ weights
        slope = (weight * (expit(odds) - is_right)) @ features + 2 * RIDGE * weights
        return float(value), slope

    weights = np.zeros(len(EVIDENCE_FEATURES))
    weights[used] = minimize(cost, np.zeros(len(used)), jac=True).x
    return weights


def log_loss(confidence: NDArray[np.float64], is_right: NDArray[np.bool_]) -> float:
    """Mean negative logarithm of the probability of what is so."""
    return float(-np.mean(np.log(np.where(is_right, confidence, 1.0 - confidence))))


def report(kind: str, cases: Mapping[Case, Judged]) -> str:
    """The weights, and what each set is believed with weights that were learned without it."""
    evidence = KINDS[kind]
    weights = fit_weights(list(cases.values()), evidence)
    rows: list[list[object]] = []
    others: list[NDArray[np.float64]] = []
    for name in dict.fromkeys(name for name, _ in cases):
        rest = [each for case, each in cases.items() if case[0] != name]
        if not rest:
            continue
        others.append(fit_weights(rest, evidence))
        for (of, size), (features, is_right) in cases.items():
            if of == name:
                confidence = expit(features @ others[-1])
                error = 100 * expected_error((confidence, is_right))
                loss = f"{log_loss(confidence, is_right):.3f}"
                rows.append([f"{name}, {size} samples", error, loss, len(is_right)])
    head = (f"{kind} pages: log odds for", *EVIDENCE_FEATURES)
    lines = [["learned", *told(weights)], ["shipped", *told(evidence.weights)]]
    if others:
        lines.append(["most change without a set", *told(np.abs(np.array(others) - weights).max(axis=0))])
    parts = [table(f"Weights of {kind} pages", head, lines)]
    if rows:
        title = f"Confidences of {kind} pages by weights that were learned without the set"
        parts.append(table(title, ("set, samples", "expected_error_percent", "log_loss", "zones"), rows))
    return "\n\n".join(parts)


def main(arguments: Sequence[str] | None = None) -> int:
    """Learn and print."""
    judged = measure_cases(NAME, __doc__, arguments, LEARNED_SETS, SIZES, _measure)
    for kind in KINDS if judged else ():
        print(report(kind, {case: each[kind] for case, each in judged.items()}), end="\n\n", flush=True)
    return 0


def _measure(task: Task) -> tuple[Case, dict[str, Judged]]:
    name, size, photos = task
    return (name, size), judge_labels_of(photos, size)
