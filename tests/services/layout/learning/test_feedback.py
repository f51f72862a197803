"""What a correction makes of models: the right one learns, the wrong one yields, nothing else changes."""

from dataclasses import replace

import pytest

from services.contract.layout_learning import VerifiedPage
from services.layout.learning.feedback import LabelsMissing, adapt_models
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.pipeline import VersionedModel, recognize
from tests.services.layout.learning.learning_models import NAMES
from tests.services.layout.samples import FIRST_UNSEEN, labelled_page, model_of


def unseen(document_class: str, seed: int = 0) -> Page:
    return labelled_page(document_class, FIRST_UNSEEN + seed)


def unlabelled(page: Page) -> Page:
    return replace(page, zones=tuple(replace(zone, label=None) for zone in page.zones))


def truth_of(page: Page) -> dict[str, str | None]:
    return {zone.id: zone.label for zone in page.zones}


def recognized(page: Page, *models: LayoutModel):
    return recognize(unlabelled(page), [VersionedModel(model, 1) for model in models])


def said(page: Page, found, verified_class: str | None, labels=None) -> VerifiedPage[Page]:
    return VerifiedPage(
        unlabelled(page),
        None if found.chosen is None else found.chosen.name,
        {each.zone.id: each.label for each in found.zones},
        verified_class,
        truth_of(page) if labels is None else labels,
    )


def errors(page: Page, model: LayoutModel) -> int:
    found = recognized(page, model)
    return sum(a.label != b.label for a, b in zip(found.zones, page.zones, strict=True))


def test_the_verified_class_learns_the_page() -> None:
    model, page = model_of("letter", 1), unseen("letter", 3)
    found = recognized(page, model)
    before = errors(page, model)
    assert before > 0
    labels, learned = adapt_models(said(page, found, "letter"), {"letter": model}, {}, NAMES)
    assert labels == tuple(truth_of(page).values())
    assert list(learned) == ["letter"]
    taught = learned["letter"]
    assert errors(page, taught.model) < before
    assert taught.model.samples == model.samples + 1
    assert taught.model.calibration.pages == model.calibration.pages + 1
    change = taught.verified.after - taught.found.after
    if taught.verified.before is not None and taught.found.before is not None:
        assert change < taught.verified.before - taught.found.before


def test_zones_that_are_not_named_keep_what_was_found() -> None:
    model, page = model_of("memo", 3), unseen("memo", 1)
    found = recognized(page, model)
    corrected = page.zones[0].id
    labels, _ = adapt_models(said(page, found, "memo", {corrected: "note"}), {"memo": model}, {}, NAMES)
    assert labels == ("note", *(zone.label for zone in found.zones[1:]))


def test_a_wrong_class_teaches_both() -> None:
    right, wrong, page = model_of("memo", 1), model_of("letter", 3), unseen("memo", 2)
    pushed = replace(wrong, calibration=replace(wrong.calibration, bias=-8.0))
    found = recognized(page, right, pushed)
    assert found.chosen is not None
    assert found.chosen.name == "letter"
    models = {"memo": right, "letter": pushed}
    _, learned = adapt_models(said(page, found, "memo"), models, {}, NAMES)
    assert set(learned) == {"memo", "letter"}
    assert learned["memo"].model.calibration.bias < 0
    assert learned["letter"].model.calibration.bias > pushed.calibration.bias
    assert learned["letter"].model.nodes == pushed.nodes
    assert learned["letter"].verified.before is None, "memos have labels that letters have not"
    after = recognized(page, *(each.model for each in learned.values()))
    probability = {
        when: {match.name: match.probability for match in recognition.classes}["memo"]
        for when, recognition in (("before", found), ("after", after))
    }
    assert probability["after"] > probability["before"]


def test_labels_that_are_not_named_follow_the_verified_class() -> None:
    right, wrong, page = model_of("memo", 3), model_of("letter", 3), unseen("memo", 4)
    found = recognized(page, wrong)
    named = {page.zones[0].id: "a-new-label"}
    labels, learned = adapt_models(
        replace(said(page, found, "memo", named), found_class="letter"),
        {"memo": right, "letter": wrong},
        {},
        NAMES,
    )
    assert labels[0] == "a-new-label"
    assert "a-new-label" in learned["memo"].model.labels
    assert set(labels[1:]) <= set(right.labels)
    true = [zone.label for zone in page.zones]
    assert sum(a == b for a, b in zip(labels[1:], true[1:], strict=True)) >= 0.7 * len(true)


def test_a_page_of_no_class_is_refused() -> None:
    model, page = model_of("letter", 3), unseen("letter", 5)
    found = recognized(page, model)
    assert found.chosen is not None
    _, learned = adapt_models(said(page, found, None, {}), {"letter": model}, {}, NAMES)
    taught = learned["letter"].model
    assert taught.calibration.bias > 0
    assert taught.nodes == model.nodes
    assert recognized(page, taught).unknown_probability > found.unknown_probability


def test_a_page_taken_for_none_is_accepted() -> None:
    model, page = model_of("letter", 3), unseen("letter", 5)
    strict = replace(model, calibration=replace(model.calibration, bias=6.0))
    found = recognized(page, strict)
    assert found.chosen is None
    _, learned = adapt_models(said(page, found, "letter"), {"letter": strict}, {}, NAMES)
    assert learned["letter"].model.calibration.bias < strict.calibration.bias


@pytest.mark.parametrize("verified_class", ["memo", None])
def test_without_models_only_labels_are_told(verified_class: str | None) -> None:
    page = unseen("memo", 1)
    found = recognized(page)
    labels, learned = adapt_models(said(page, found, verified_class), {}, {}, NAMES)
    assert labels == tuple(truth_of(page).values())
    assert learned == {}


def test_labels_that_nobody_can_tell_are_asked_for() -> None:
    page = unseen("memo", 1)
    with pytest.raises(LabelsMissing) as caught:
        adapt_models(said(page, recognized(page), "memo", {page.zones[0].id: "to"}), {}, {}, NAMES)
    assert caught.value.zone == page.zones[1].id


def test_the_learner_is_chosen_by_model() -> None:
    model, page = model_of("letter", 1), unseen("letter", 3)
    found = recognized(page, model)
    told = said(page, found, "letter")
    by = {
        learner: adapt_models(told, {"letter": model}, {"letter": learner}, NAMES)[1]["letter"].model
        for learner in ("passive-aggressive", "counting", "error-correction")
    }
    assert by["error-correction"].samples == model.samples
    assert by["counting"].samples == by["passive-aggressive"].samples == model.samples + 1
    assert all(expected.weight == 1 for node in by["counting"].nodes for expected in node.numeric.values())
    assert any(
        expected.weight != 1 for node in by["error-correction"].nodes for expected in node.numeric.values()
    )


def test_zones_that_a_person_drew_teach_which_pieces_belong_together() -> None:
    """One zone of the verified page was found in two pieces; feedback on labels alone says nothing of pieces."""
    model, page = model_of("letter", 3), unseen("letter", 4)
    whole = max(page.zones, key=lambda zone: (zone.label is not None) * (zone.box[3] - zone.box[1]))
    x0, y0, x1, y1 = whole.box
    middle = (y0 + y1) / 2
    pieces = [
        replace(whole, id="upper", box=(x0, y0, x1, middle - 4)),
        replace(whole, id="lower", box=(x0, middle + 4, x1, y1)),
    ]
    zones = [each for zone in page.zones for each in (pieces if zone is whole else [zone])]
    told = said(page, recognized(page, model), "letter")
    after = {}
    for name, found_page in (("labels", None), ("zones", unlabelled(replace(page, zones=tuple(zones))))):
        _, learned = adapt_models(replace(told, found_page=found_page), {"letter": model}, {}, NAMES)
        [node] = [node for node in learned["letter"].model.nodes if node.label == whole.label]
        after[name] = node.pieces
    [before] = [node.pieces for node in model.nodes if node.label == whole.label]
    assert after["labels"] == before
    assert after["zones"].divided == before.divided + 1
    assert after["zones"].joining > before.joining
