"""Labels of parts of lines: how many zones have them, and where."""

from dataclasses import replace

import numpy as np

from services.layout.grouping.line_parts import cut_lines
from services.layout.grouping.zones_of_label import (
    with_lines_between,
    with_near_zones,
    with_single_zones,
    without_equal_values,
)
from services.layout.model.layout_model import LayoutModel, ModelEdge
from services.layout.page import Box, Page
from services.layout.pipeline import VersionedModel, recognize
from services.layout.recognition.results import Recognition
from services.layout.segmentation import compose_page
from tests.services.layout.grouping.slips import fine_page, model_of_slips, slip


def test_of_a_label_that_occurs_once_the_surest_zone_keeps_it() -> None:
    model = model_of_slips()
    fine = cut_lines(slip(11)).fine
    models = [VersionedModel(model, 1)]
    seen = recognize(compose_page(fine), models)
    amounts = [each for each in seen.zones if each.zone.text.endswith("0")]
    assert len(amounts) >= 3
    doubled = replace(
        seen,
        zones=tuple(
            replace(each, label="total", evidence=float(k), confidence=0.6) if each in amounts else each
            for k, each in enumerate(seen.zones)
        ),
    )
    single = with_single_zones(doubled, model)
    kept = [each for each in single.zones if each.label == "total"]
    assert kept == [each for each in doubled.zones if each.label == "total"][-1:]
    lost = [each for each in single.zones if each.others == {"total": 0.6}]
    assert len(lost) == len(amounts) - 1


def test_zones_farther_apart_than_on_any_sample_lose_their_label() -> None:
    """Samples have two lines next to each other; on the page a third one stands at its foot."""
    model = model_of_slips()
    [total] = [node for node in model.nodes if node.label == "total"]
    near = ModelEdge("total", "total", {"gap-along": (0.0, -0.5, 0.0, 2.0, 2.0, 2.0, 2.0)})
    edges = (near, *(edge for edge in model.edges if (edge.upper, edge.lower) != ("total", "total")))
    seen = recognize(compose_page(fine_page(("one",), ("two",), ("three",))), [VersionedModel(model, 1)])
    boxes = [(30.0, top, 80.0, top + 12.0) for top in (40.0, 55.0, 600.0)]
    zones = tuple(
        replace(each, label="total", confidence=sure, zone=replace(each.zone, box=box))
        for each, box, sure in zip(seen.zones, boxes, (0.5, 0.4, 0.8), strict=True)
    )
    page = replace(seen.page, zones=tuple(each.zone for each in zones))
    left = with_near_zones(replace(seen, page=page, zones=zones), replace(model, edges=edges))
    assert [each.label for each in left.zones] == ["total", "total", None], "both together are surer"
    assert left.zones[2].others == {"total": 0.8}
    far = replace(near, costs={"gap-along": (0.0,) * 7})
    kept = replace(model, edges=(far, *edges[1:]))
    assert with_near_zones(replace(seen, page=page, zones=zones), kept).zones == zones
    assert total.pieces.within > 0


def test_a_label_whose_zones_have_lines_is_no_single_part() -> None:
    """An address that every sample has once, in one box, is all of its lines: more than one part may have it."""
    model = model_of_slips()
    fine = cut_lines(slip(11)).fine
    twice = recognize(compose_page(fine), [VersionedModel(model, 1)])
    two = tuple(replace(each, label="total") for each in twice.zones[:2])
    seen = replace(twice, zones=(*two, *(replace(each, label=None) for each in twice.zones[2:])))

    def lines_of_total(lines: float) -> LayoutModel:
        nodes = (
            replace(
                node,
                numeric={**node.numeric, "lines": replace(node.numeric["lines"], value=np.log2(1 + lines))},
            )
            if node.label == "total"
            else node
            for node in model.nodes
        )
        return replace(model, nodes=tuple(nodes))

    def left(lines: float) -> int:
        return sum(each.label == "total" for each in with_single_zones(seen, lines_of_total(lines)).zones)

    assert (left(1.0), left(1.2), left(2.0)) == (1, 1, 2)


def test_a_gap_that_is_narrower_than_those_of_samples_is_not_too_far() -> None:
    """Samples have the label in every other line; two lines next to each other have it too."""
    edges = (ModelEdge("total", "total", {"gap-along": (2.0, 2.0, 2.0, 0.0, 2.0, 2.0, 2.0)}),)
    seen = seen_lines(("total", 0.9, {}), ("total", 0.8, {}))
    assert with_near_zones(seen, replace(model_of_slips(), edges=edges)) == seen


def test_a_line_between_two_of_a_label_has_it_if_it_is_nearly_as_probable() -> None:
    model = model_of_several()
    street, phone = {"total": 0.9, "head": 0.1}, {"total": 0.05, "head": 0.95}

    def labels(*zones: tuple[str | None, float, dict[str, float]]) -> list[str | None]:
        return [each.label for each in with_lines_between(seen_lines(*zones), model).zones]

    sure = ("total", 0.9, {})
    assert labels(sure, (None, 0.7, street), sure) == ["total"] * 3
    assert labels(sure, (None, 0.7, phone), sure) == ["total", None, "total"], "three log odds less"
    assert labels(sure, sure, (None, 0.7, street)) == ["total", "total", None], "below both"
    assert labels(sure, ("head", 0.7, street), sure) == ["total", "head", "total"], "it has another label"
    found = with_lines_between(seen_lines(sure, (None, 0.7, street), sure), model).zones[1]
    assert abs(found.confidence - 0.27 / 0.97) < 1e-9
    assert found.others == {"head": 0.1}
    once = model_of_slips()
    seen = seen_lines(sure, (None, 0.7, street), sure)
    assert with_lines_between(seen, once) == seen, "samples have the label once a page"


def test_a_value_that_is_printed_twice_is_not_joined() -> None:
    """A total above the same payment: as one zone of two lines it is like no total of the samples."""
    model = model_of_slips()
    seen = seen_lines(
        ("total", 0.9, {}), ("total", 0.9, {}), ("head", 0.9, {}), texts=("9.20", "RM 9.20", "a")
    )
    same = tuple(
        replace(each, zone=replace(each.zone, text=text))
        for each, text in zip(seen.zones, ("9.20", "9.20", "A"), strict=True)
    )
    assert without_equal_values(((0, 1), (2,)), same, model) == ((0,), (1,), (2,))
    assert without_equal_values(((0, 1), (2,)), seen.zones, model) == ((0, 1), (2,)), "pieces of one value"
    assert without_equal_values(((0, 1), (2,)), same, model_of_several()) == ((0, 1), (2,))


def model_of_several() -> LayoutModel:
    """A model whose samples have the total as often twice a page as once."""
    model = model_of_slips()
    nodes = (
        replace(node, count_costs=(4.0, 0.7, 0.7, 4.0)) if node.label == "total" else node
        for node in model.nodes
    )
    return replace(model, nodes=tuple(nodes))


def seen_lines(
    *zones: tuple[str | None, float, dict[str, float]], texts: tuple[str, ...] = ()
) -> Recognition:
    """A page of lines below each other with these labels, confidences, and other labels."""
    lines = texts or tuple(f"line {place}" for place in range(len(zones)))
    page = compose_page(fine_page(*((text,) for text in lines)))
    seen = recognize(page, [VersionedModel(model_of_slips(), 1)])
    boxes: list[Box] = [(30.0, 40.0 + 22.0 * k, 80.0, 52.0 + 22.0 * k) for k in range(len(zones))]
    own = tuple(
        replace(
            each,
            zone=replace(each.zone, box=box),
            label=label,
            confidence=sure,
            others=others,
        )
        for each, box, (label, sure, others) in zip(seen.zones, boxes, zones, strict=True)
    )
    return replace(seen, page=Page(page.width, page.height, tuple(each.zone for each in own)), zones=own)
