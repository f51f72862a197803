"""Parts of lines: where lines are cut, and which parts a model takes out of their zones."""

from dataclasses import replace

from services.layout.content.content_features import content_features
from services.layout.grouping.line_parts import (
    cut_lines,
    key_ends,
    take_out_parts,
)
from services.layout.learning.label_transfer import come_apart, zones_within
from services.layout.model.layout_model import PieceStatistics
from services.layout.pipeline import VersionedModel, complete_recognition, recognize
from services.layout.segmentation import compose_page
from tests.services.layout.grouping.slips import (
    fine_page,
    model_of_numbered,
    model_of_slips,
    numbered,
    sample,
    slip,
)


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
    shares = {node.label: node.pieces.share_within for node in model.nodes}
    assert shares["total"] > 0.5 > shares["head"]
    fine = slip(11)
    cut = take_out_parts(fine, model, content_features())
    texts = [zone.text for zone in compose_page(cut).zones]
    assert "51.20" in texts
    assert sorted(" ".join(texts).split()) == sorted(" ".join(fine.texts).split()), "no word is lost"
    models = [VersionedModel(model, 1)]
    seen = complete_recognition(fine, recognize(compose_page(fine), models), models)
    assert [each.zone.text for each in seen.zones if each.label == "total"] == ["51.20"]


def test_what_stands_behind_a_key_of_the_samples_is_a_part() -> None:
    model = model_of_numbered()
    assert key_ends(model, {"number"}) == {"no"}
    assert key_ends(model, {"head"}) == frozenset()
    cut = take_out_parts(numbered(17), model, content_features())
    assert "2026-0117" in [zone.text for zone in compose_page(cut).zones]
    # Without its key nothing tells where the number begins.
    nodes = tuple(replace(node, words={}) for node in model.nodes)
    cut = take_out_parts(numbered(17), replace(model, nodes=nodes), content_features())
    assert "2026-0117" not in [zone.text for zone in compose_page(cut).zones]


def test_a_class_without_parts_keeps_its_zones() -> None:
    model = model_of_slips()
    nodes = tuple(replace(node, pieces=replace(node.pieces, within=0.0)) for node in model.nodes)
    fine = slip(11)
    assert take_out_parts(fine, replace(model, nodes=nodes), content_features()) is fine
    rare = replace(model, samples=40)
    assert take_out_parts(fine, rare, content_features()) is fine, "five parts in forty samples are chance"
    assert PieceStatistics(whole=3.0).share_within == 0.0
    unread = replace(fine, words=((),) * len(fine.lines), texts=("",) * len(fine.lines))
    assert take_out_parts(unread, model, content_features()) is unread
