"""Parts of lines: where lines are cut, and which parts a model takes out of their zones."""

from dataclasses import replace

import numpy as np

from services.layout.content.content_features import content_features
from services.layout.grouping.line_parts import (
    cut_lines,
    share_within,
    take_out_parts,
    with_near_zones,
    with_single_zones,
)
from services.layout.learning.initialization import initialize_model
from services.layout.learning.label_transfer import come_apart, transfer_labels, zones_within
from services.layout.model.layout_model import LayoutModel, ModelEdge, PieceStatistics
from services.layout.page import Page
from services.layout.pipeline import VersionedModel, complete_recognition, recognize
from services.layout.segmentation import FinePage, Line, compose_page
from services.ocr.engine import Word

EM = 16.0


def fine_page(*blocks: tuple[str, ...], top: float = 40.0) -> FinePage:
    """A page of blocks of lines; words are separated by blanks, two blanks are a wide space."""
    lines, boxes, words, grouped = [], [], [], []
    y = top
    for block in blocks:
        own = []
        for text in block:
            x, found = 30.0, []
            for chunk in text.split(" "):
                if not chunk:
                    x += 4 * EM
                    continue
                found.append(Word(chunk, (x, y, x + 8.0 * len(chunk), y + 12.0), 0.95))
                x += 8.0 * len(chunk) + 5.0
            box = (30.0, y, found[-1].box[2], y + 12.0)
            own.append(len(lines))
            lines.append(Line(np.arange(6), box, y + 12.0, EM, 8.0, 1.5))
            boxes.append(box)
            words.append(tuple(found))
            y += 22.0
        grouped.append(tuple(own))
        y += 30.0
    texts = tuple(" ".join(word.text for word in own) for own in words)
    return FinePage(
        500.0, 700.0, 1.0, tuple(lines), np.array(boxes), texts, tuple(words), frozenset(), tuple(grouped), ()
    )


def slip(number: int) -> FinePage:
    """A receipt: its head, and one block with a total that stands in any row."""
    rows = ["Cash  60.00", f"Total  {40 + number}.20", "Change  7.80", "Subtotal  38.00"]
    rows = rows[number % 4 :] + rows[: number % 4]
    return fine_page(("ACME TRADING LTD", "Tel 5550 123"), tuple(rows), top=40.0 + 9 * (number % 3))


def sample(number: int) -> tuple[Page, Page]:
    """The slip with its total drawn as a zone of its own, and as segmentation finds it."""
    fine = slip(number)
    found = compose_page(fine)
    amount = next(w for own in fine.words for w in own if w.text == f"{40 + number}.20")
    total = replace(
        found.zones[1], id="t", box=amount.box, label="total", text=amount.text, words=(), lines=1
    )
    head = replace(found.zones[0], label="head")
    verified = Page(found.width, found.height, (head, total))
    return verified, transfer_labels(verified, found)


def model_of_slips(count: int = 5) -> LayoutModel:
    samples = [sample(number) for number in range(count)]
    return initialize_model("slip", [page for page, _ in samples], found=[found for _, found in samples])


def test_lines_are_cut_at_keys_values_and_wide_spaces() -> None:
    cut = cut_lines(fine_page(("Date: 12/01/2018 16:57", "A4 COPY 8  4.24 SR", "plain words only")))
    assert cut.fine.texts == ("Date:", "12/01/2018", "16:57", "A4 COPY 8", "4.24", "SR", "plain words only")
    assert cut.blocks == ((0, 1, 2, 3, 4, 5, 6),)
    numbers = cut_lines(fine_page(("KING'S S/B 273500-U", "ACME BHD (139386 X)", "47500 SUBANG JAYA")))
    assert numbers.fine.texts == ("KING'S S/B", "273500-U", "ACME BHD", "(139386", "X)", "47500 SUBANG JAYA")
    assert [len(block) for block in cut.fine.blocks] == [1] * 7
    boxes = cut.fine.boxes
    assert (boxes[:3, 0][1:] >= boxes[:3, 2][:-1]).all()
    assert cut.fine.lines[1].box[0] == boxes[1, 0], "the working copy has the page's scale here"


def test_what_is_left_of_a_line_is_one_line() -> None:
    fine = fine_page(("ACME TRADING LTD", "Tel: 5550  Fax: 5551"), ("Total: 42.20  paid", "Change: 7.80"))
    taken = take_out_parts(fine, model_of_slips(), content_features())
    texts = [zone.text for zone in compose_page(taken).zones]
    assert "42.20" in texts, "the total is taken out"
    assert "ACME TRADING LTD\nTel: 5550 Fax: 5551" in texts, "a line of which nothing is taken is as it was"
    assert all(len(box) == 4 and box[0] < box[2] for box in taken.boxes)
    assert sorted(word.text for own in taken.words for word in own) == sorted(
        word.text for own in fine.words for word in own
    )


def test_a_drawn_part_of_a_zone_is_a_part_and_the_rest_is_left() -> None:
    verified, found = sample(1)
    assert zones_within(verified, found) == {1: [1]}
    x0, y0, x1, y1 = verified.zones[1].box
    roomy = replace(verified.zones[1], box=(x0 - 1, y0 - 4, x1 + 1, y1 + 4))
    thin = replace(
        found,
        zones=tuple(
            replace(zone, box=(zone.box[0], y0, zone.box[2], y1)) if zone.id == found.zones[1].id else zone
            for zone in found.zones
        ),
    )
    assert zones_within(replace(verified, zones=(verified.zones[0], roomy)), thin) == {1: [1]}
    picture = replace(verified, zones=(verified.zones[0], replace(verified.zones[1], kind="figure")))
    assert zones_within(picture, found) == {}
    apart = come_apart(verified, found)
    assert [zone.label for zone in apart.zones[:2]] == ["head", "total"]
    left = ["Total", "Change", "7.80", "Subtotal", "38.00", "Cash", "60.00"]
    assert [zone.text for zone in apart.zones[2:]] == left
    assert {zone.label for zone in apart.zones[2:]} == {None}


def test_a_model_of_parts_takes_the_part_out_of_a_new_page() -> None:
    model = model_of_slips()
    shares = {node.label: share_within(node.pieces) for node in model.nodes}
    assert shares["total"] > 0.5 > shares["head"]
    fine = slip(11)
    cut = take_out_parts(fine, model, content_features())
    texts = [zone.text for zone in compose_page(cut).zones]
    assert "51.20" in texts
    assert sorted(" ".join(texts).split()) == sorted(" ".join(fine.texts).split()), "no word is lost"
    models = [VersionedModel(model, 1)]
    seen = complete_recognition(fine, recognize(compose_page(fine), models), models)
    assert [each.zone.text for each in seen.zones if each.label == "total"] == ["51.20"]


def test_a_class_without_parts_keeps_its_zones() -> None:
    model = model_of_slips()
    nodes = tuple(replace(node, pieces=replace(node.pieces, within=0.0)) for node in model.nodes)
    fine = slip(11)
    assert take_out_parts(fine, replace(model, nodes=nodes), content_features()) is fine
    rare = replace(model, samples=40)
    assert take_out_parts(fine, rare, content_features()) is fine, "five parts in forty samples are chance"
    assert share_within(PieceStatistics(whole=3.0)) == 0.0
    unread = replace(fine, words=((),) * len(fine.lines), texts=("",) * len(fine.lines))
    assert take_out_parts(unread, model, content_features()) is unread


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
