"""Fields: the text of every label in reading order, with the joint confidence of class, labels and words."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from services.contract.fields import FieldSetting, FieldType
from services.layout.page import Page, Zone, ZoneWord
from services.layout.recognition.fields import gather_fields, probability_of_value
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone


def labelled(
    order: int, label: str | None, text: str, sure: float = 1.0, words: Sequence[float] = ()
) -> RecognizedZone:
    texts = text.split() if len(words) == len(text.split()) else ["x" * 4] * len(words)
    pairs = zip(texts, words, strict=True)
    read = tuple(ZoneWord(each, (0.0, 0.0, 1.0, 1.0), confidence, 0) for each, confidence in pairs)
    zone = Zone(f"z{order}", (0.0, 10.0 * order, 50.0, 10.0 * order + 8), text=text, words=read)
    return RecognizedZone(zone, label, sure, label, order)


def recognition(*zones: RecognizedZone, probability: float | None = 0.9) -> Recognition:
    page = Page(100.0, 100.0, tuple(each.zone for each in zones))
    classes = () if probability is None else (ClassMatch("letter", 1, -3.0, probability),)
    return Recognition(page, zones, classes[0] if classes else None, classes)


def test_texts_of_a_label_are_joined_in_reading_order() -> None:
    found = gather_fields(
        recognition(labelled(2, "body", "third"), labelled(0, "date", "first"), labelled(1, "body", "second"))
    )
    assert [(field.label, field.text, field.zones) for field in found] == [
        ("date", "first", ("z0",)),
        ("body", "second\nthird", ("z1", "z2")),
    ]


def test_the_confidence_joins_class_labels_and_words() -> None:
    [field] = gather_fields(
        recognition(labelled(0, "date", "a b", 0.8, (0.5, 1.0)), labelled(1, "date", "c", 0.5, (0.75,)))
    )
    assert field.confidence == pytest.approx(0.9 * probability_of_value(0.8 * 0.5, 0.5 * 1.0 * 0.75, "text"))


def test_a_typed_value_is_as_sure_as_its_own_words() -> None:
    zone = labelled(0, "date", "Re: ??, March 3, 1998", 0.8, (0.9, 0.1, 0.5, 1.0, 0.75))
    [field] = gather_fields(recognition(zone), {"date": FieldSetting("date")})
    assert (field.type, field.value, field.problem) == ("date", "1998-03-03", None)
    assert field.confidence == pytest.approx(0.9 * probability_of_value(0.8, 0.5 * 1.0 * 0.75, "date"))
    without_words = labelled(0, "date", "March 3, 1998", 0.8)
    [surer] = gather_fields(recognition(without_words), DATE)
    assert field.confidence < surer.confidence < 0.9


@pytest.mark.parametrize("of_type", ["text", "date", "amount", "phone"])
def test_a_value_is_surer_with_its_labels_and_words(of_type: FieldType) -> None:
    sure = probability_of_value(0.95, 0.9, of_type)
    assert probability_of_value(0.5, 0.9, of_type) < sure < probability_of_value(0.95, 0.99, of_type)
    assert probability_of_value(0.999, 1.0, of_type) < probability_of_value(1.0, 1.0, of_type) == 1.0
    assert 0.0 < probability_of_value(0.0, 0.0, of_type) < 0.1


def test_a_value_that_parses_is_surer_than_its_label_and_words_and_a_text_is_not() -> None:
    assert probability_of_value(0.95, 0.9, "date") > probability_of_value(0.95, 0.9, "phone") > 0.95 * 0.9
    assert probability_of_value(0.95, 0.9, "amount") < probability_of_value(0.95, 0.9, "phone")
    assert probability_of_value(0.95, 0.9, "text") < 0.95 * 0.9


def test_a_text_with_one_word_misread_is_wrong_however_long_it_is() -> None:
    words = "one two three four five six seven eight"
    misread = labelled(0, "body", words, 0.95, (0.3, *[0.96] * 7))
    [doubted] = gather_fields(recognition(misread))
    [read] = gather_fields(recognition(labelled(0, "body", words, 0.95, (0.96,) * 8)))
    assert doubted.confidence < 0.85 * read.confidence


def test_a_text_without_its_type_has_no_value() -> None:
    [field] = gather_fields(
        recognition(labelled(0, "date", "no day\nat all")), {"date": FieldSetting("date")}
    )
    assert (field.value, field.problem, field.text) == (None, "no-value", "no day\nat all")
    [field] = gather_fields(recognition(labelled(0, "date", "no day\nat all")))
    assert (field.value, field.type) == ("no day at all", "text")


def test_text_that_came_with_the_zones_counts_as_right() -> None:
    [field] = gather_fields(recognition(labelled(0, "date", "today", 0.8)))
    assert field.confidence == pytest.approx(0.9 * probability_of_value(0.8, 1.0, "text"))


def test_zones_without_label_or_text_make_no_field() -> None:
    assert gather_fields(recognition(labelled(0, None, "loose"), labelled(1, "logo", " "))) == ()
    assert gather_fields(recognition(probability=None)) == ()


DATE = {"date": FieldSetting("date")}


def test_a_pattern_is_looked_for_zone_by_zone_where_all_together_have_no_value() -> None:
    name = {"signature": FieldSetting("pattern", pattern="^([A-Z][a-z]{1,9} [A-Z][a-z]{1,9})")}
    zones = [labelled(0, "signature", "by phone", 0.5), labelled(1, "signature", "Ann Hall", 0.8)]
    [field] = gather_fields(recognition(*zones), name)
    assert (field.value, field.text, field.zones) == ("Ann Hall", "by phone\nAnn Hall", ("z0", "z1"))
    assert field.confidence == pytest.approx(0.9 * probability_of_value(0.8, 1.0, "pattern"))
    [field] = gather_fields(recognition(*zones, labelled(2, "signature", "Bob Hill")), name)
    assert (field.value, field.problem) == (None, "no-value")


def test_a_value_in_a_zone_of_another_label_is_found_if_that_zone_may_have_this_one() -> None:
    head = labelled(0, "letterhead", "Ann Hall\nMarch 3, 1998", 0.8)
    body = labelled(1, "body", "yours of March 1, 1998", 0.6)
    [letterhead, text] = gather_fields(recognition(head, body), DATE)
    assert [letterhead.label, text.label] == ["letterhead", "body"]
    head, body = replace(head, others={"date": 0.6}), replace(body, others={"date": 0.2})
    found = gather_fields(recognition(head, body), DATE)
    assert [field.label for field in found] == ["letterhead", "date", "body"]
    # The letterhead is wrong with 0.2, and a date then with 0.6; the body is one with 0.4 * 0.2.
    assert (found[1].value, found[1].zones, found[1].text) == ("1998-03-03", ("z0",), head.zone.text)
    assert found[1].confidence == pytest.approx(0.9 * probability_of_value(0.2 * 0.6, 1.0, "date"))
    assert (found[0].value, found[0].zones) == ("Ann Hall March 3, 1998", ("z0",))


def test_zones_of_the_label_come_before_those_of_others() -> None:
    other = replace(labelled(1, "body", "March 1, 1998", 0.5), others={"date": 0.9})
    [own, _] = gather_fields(recognition(labelled(0, "date", "March 3, 1998"), other), DATE)
    assert (own.value, own.zones) == ("1998-03-03", ("z0",))
    several = labelled(0, "date", "March 3, 1998 or May 3, 1998")
    [own, _] = gather_fields(recognition(several, other), DATE)
    assert (own.value, own.problem) == (None, "several-values")
    by_label = {
        field.label: field for field in gather_fields(recognition(labelled(0, "date", "no"), other), DATE)
    }
    assert (by_label["date"].value, by_label["date"].zones) == ("1998-03-01", ("z1",))
    assert by_label["body"].zones == ("z1",)
    nothing = replace(labelled(1, "body", "never", 0.5), others={"date": 0.9})
    [own, _] = gather_fields(recognition(labelled(0, "date", "no day"), nothing), DATE)
    assert (own.text, own.problem) == ("no day", "no-value")


def test_zones_with_equal_values_are_one_value_together() -> None:
    amounts = {"total": FieldSetting("amount")}
    change = replace(labelled(0, "total", "12.55", 0.4), shares={"total": 0.4})
    twice = [replace(labelled(k, None, "87.45", 0.7), shares={"total": 0.3}) for k in (1, 2)]
    [field] = gather_fields(recognition(change, *twice), amounts)
    assert (field.value, field.zones) == ("87.45", ("z1",))
    assert field.confidence == pytest.approx(0.9 * probability_of_value(0.6, 1.0, "amount"))
    [field] = gather_fields(recognition(change, twice[0]), amounts)
    assert (field.value, field.zones) == ("12.55", ("z0",))
    [field] = gather_fields(recognition(labelled(0, "total", "12.55"), *twice[:0]), amounts)
    assert field.value == "12.55", "without shares nothing moves"
