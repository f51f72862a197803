"""Wrong class decisions as feedback, all models competing: memos taken for letters, classes with one sample."""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.common.baseline import Figures
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.protocols import make_model, page_labels, recognized, unlabelled
from benchmarks.layout.specimens import OTHER_LETTERS, Specimen, by_class
from benchmarks.learning.pages import verdict
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.pipeline import VerifiedPage, content_features, learn_from_feedback
from services.layout.recognition.results import Recognition

MEMOS = "real memos"
MEMO_ORDERS = 3
MOST_STREAM = 15
"""Pages of a class that begins with one sample."""
MOST_OTHERS = 6
"""Pages of each class by which it is seen whether the feedback spoils the decision on other pages."""
WINDOW = 5

Models = Mapping[str, LayoutModel]


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    classes = by_class(specimens)
    if len(classes) < 2:
        return []
    memos = [MEMOS] if "memo" in classes and _real_memos(specimens) else []
    jobs = [f"{name}, order {seed + 1}" for name in memos for seed in range(MEMO_ORDERS)]
    return [*jobs, *(f"{name}, order 1" for name in classes)]


def _real_memos(specimens: Sequence[Specimen]) -> list[Page]:
    """In the zones of our segmentation, none of which has a label: the class alone is known."""
    return [
        each.own
        for each in specimens
        if each.source == OTHER_LETTERS and each.class_name == "memo" and each.own and each.own.zones
    ]


def _halves(classes: Mapping[str, Sequence[Specimen]]) -> tuple[dict[str, list[Page]], dict[str, list[Page]]]:
    """Pages that models are made of, and pages that they are asked about: every second one."""
    learned = {name: [each.true for each in members[::2]] for name, members in classes.items()}
    asked = {name: [each.true for each in members[1::2][:MOST_OTHERS]] for name, members in classes.items()}
    return learned, asked


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    name, _, order = job.partition(", order ")
    rng = np.random.default_rng(int(order))
    classes = by_class(specimens)
    learned, asked = _halves(classes)
    if name == MEMOS:
        memos = _real_memos(specimens)
        stream = [memos[index] for index in rng.permutation(len(memos))]
        name = "memo"
    else:
        pages = [learned[name][index] for index in rng.permutation(len(learned[name]))]
        learned[name], stream = pages[:1], pages[1 : 1 + MOST_STREAM]
    models = {each: make_model(each, lessons_of(pages)) for each, pages in learned.items()}
    others = {each: pages for each, pages in asked.items() if each != name}
    return follow(name, models, stream, others, asked[name])


def lessons_of(pages: Sequence[Page]) -> list[tuple[Page, Page | None]]:
    return [(page, None) for page in pages if page.zones]


def follow(
    name: str,
    models: Models,
    stream: Sequence[Page],
    others: Mapping[str, Sequence[Page]],
    same: Sequence[Page],
) -> Result:
    """Decisions on pages of the class `name` as they come, each followed by feedback, and on other pages around it.

    The feedback tells the labels of the zones where the pages have any, else the class alone.
    """
    without = [chosen(recognized(page, models)) for page in stream]
    taught, with_feedback = dict(models), []
    for page in stream:
        answer = recognized(page, taught)
        with_feedback.append(chosen(answer))
        taught |= _feed_back(name, page, answer, taught)
    result: Result = {
        "stream": len(stream),
        "unlearned": [found == name for found in without],
        "learned": [found == name for found in with_feedback],
        "afterwards": [chosen(recognized(page, taught)) == name for page in stream],
        "taken_for": [found for found in with_feedback if found != name],
    }
    for when, by in (("before", models), ("after", taught)):
        found = [chosen(recognized(page, by)) == each for each, pages in others.items() for page in pages]
        result[f"others_{when}"], result["others"] = sum(found), len(found)
        result[f"same_{when}"] = sum(chosen(recognized(page, by)) == name for page in same)
    result["same"] = len(same)
    return result


def chosen(answer: Recognition) -> str:
    """Class of a page, "unknown" for none."""
    return answer.chosen.name if answer.chosen else "unknown"


def _feed_back(name: str, page: Page, answer: Recognition, models: Models) -> dict[str, LayoutModel]:
    labels = dict(zip((zone.id for zone in page.zones), page_labels(page), strict=True))
    said = VerifiedPage(
        page=unlabelled(page),
        found_class=answer.chosen.name if answer.chosen else None,
        found=tuple(zone.label for zone in answer.zones),
        verified_class=name,
        verified=labels if any(label is not None for label in labels.values()) else {},
    )
    _, learned = learn_from_feedback(said, models, {}, content_features())
    return {each: after.model for each, after in learned.items()}


def _merged(results: Results) -> dict[str, list[Result]]:
    rows: dict[str, list[Result]] = {}
    for job, result in results.items():
        rows.setdefault(job.partition(", order ")[0], []).append(result)
    return rows


def _wrong_percent(rows: Sequence[Result], key: str, start: int = 0, end: int | None = None) -> float:
    decisions = [right for row in rows for right in row[key][start:end]]
    return share(sum(not right for right in decisions), len(decisions))


def _row(name: str, rows: Sequence[Result]) -> list[object]:
    def right(key: str, of: str) -> float:
        return share(sum(row[key] for row in rows), sum(row[of] for row in rows))

    return [
        *(name, "/".join(str(row["stream"]) for row in rows[:1])),
        _wrong_percent(rows, "unlearned"),
        *(_wrong_percent(rows, "learned", start, start + WINDOW) for start in range(0, 3 * WINDOW, WINDOW)),
        _wrong_percent(rows, "learned", 3 * WINDOW),
        _wrong_percent(rows, "afterwards"),
        *(right("same_before", "same"), right("same_after", "same")),
        *(right("others_before", "others"), right("others_after", "others")),
    ]


def _report(results: Results) -> str:
    merged = _merged(results)
    rows = [_row(name, members) for name, members in merged.items()]
    single = [row for name, members in merged.items() if name != MEMOS for row in members]
    if single:
        rows.append(_row("all with one sample", single))
    head = (
        *("class", "stream", "no learning"),
        *(f"pages {start + 1}-{start + WINDOW}" for start in range(0, 3 * WINDOW, WINDOW)),
        *(f"{3 * WINDOW + 1}-", "asked again", "same class %", "after", "others right %", "after"),
    )
    title = (
        f"Class decisions, all models competing, wrong in percent of a stream with feedback (real memos, "
        f"{MEMO_ORDERS} orders, by models of made ones, all other rows: a class with one sample); "
        "right decisions on other pages before and after"
    )
    required = []
    for name, members in {**merged, "all": [row for row in results.values()]}.items():
        before, after = (sum(row[f"others_{when}"] for row in members) for when in ("before", "after"))
        if name in (MEMOS, "all"):
            of = sum(row["others"] for row in members)
            required.append(
                [f"{name}: other pages no worse", f"{before} -> {after} of {of}", verdict(after >= before)]
            )
            first, last = (_wrong_percent(members, key) for key in ("unlearned", "learned"))
            required.append(
                [
                    f"{name}: class error over the whole stream falls",
                    f"{first:.1f} -> {last:.1f} %",
                    verdict(last < first or first == 0 == last),
                ]
            )
    taken: dict[str, int] = {}
    for row in results.values():
        for found in row["taken_for"]:
            taken[found] = taken.get(found, 0) + 1
    note = "taken for: " + ", ".join(f"{found} {count}" for found, count in sorted(taken.items()))
    return "\n\n".join(
        [f"{table(title, head, rows)}\n{note}", table("Required", ("what", "measured", "met"), required)]
    )


def _figures(results: Results) -> Figures:
    merged = _merged(results)
    groups = {
        MEMOS: merged.get(MEMOS, []),
        "one sample": [row for name, rows in merged.items() if name != MEMOS for row in rows],
    }
    return {
        f"class feedback, {name}": {
            "class_error_percent": _wrong_percent(rows, "learned"),
            "others_right_percent": share(
                sum(row["others_after"] for row in rows), sum(row["others"] for row in rows)
            ),
        }
        for name, rows in groups.items()
        if rows
    }


FEEDBACK_CLASSES = Part(_jobs, _measure, _report, _figures)
