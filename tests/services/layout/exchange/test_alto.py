"""ALTO: what is written is valid and reads back; what others write is read."""

from xml.etree.ElementTree import fromstring

import pytest
from hypothesis import given, settings

from services.layout.exchange.alto import write_alto
from services.layout.exchange.xml_writing import clean
from services.layout.exchange.zones_file import read_zones_file
from services.layout.page import InvalidLayout, Page, Zone
from services.notices import Notice
from tests.services.layout.exchange.pages import CREATED, LIMITS, pages, printed_figure, read_page, recognized
from tests.services.layout.exchange.schema_rules import faults_of_alto

V2, V3, V4 = (f"http://www.loc.gov/standards/alto/ns-v{version}#" for version in (2, 3, 4))
LONG_TAG = f'<Tags><LayoutTag ID="t" LABEL="{"x" * 61}"/></Tags>'
PLACE = 'HPOS="10" VPOS="20" WIDTH="100" HEIGHT="40"'


def alto(
    blocks: str,
    unit: str = "pixel",
    namespace: str = V4,
    parts: str = "",
    size: str = 'WIDTH="1000" HEIGHT="2000"',
) -> bytes:
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><alto xmlns="{namespace}">'
        f"<Description><MeasurementUnit>{unit}</MeasurementUnit></Description>{parts}"
        f'<Layout><Page ID="p" PHYSICAL_IMG_NR="1" {size}><PrintSpace>{blocks}</PrintSpace></Page></Layout></alto>'
    ).encode()


def test_a_page_of_a_turned_image_says_so() -> None:
    written = write_alto(recognized(Page(10, 20, ())), "p.png", CREATED, 270)
    assert faults_of_alto(written) == []
    assert b"turned clockwise by 270 degrees" in written
    assert b"turned" not in write_alto(recognized(Page(10, 20, ())), "p.png", CREATED)


@pytest.mark.pipeline
@given(pages())
@settings(max_examples=60, deadline=None)
def test_what_is_written_is_valid_and_reads_back(page: Page) -> None:
    written = write_alto(recognized(page), "page.png", CREATED)
    assert faults_of_alto(written) == []
    back = read_zones_file(written, LIMITS)
    assert (back.width, back.height) == (page.width, page.height)
    for zone, again in zip(page.zones, back.zones, strict=True):
        assert again.box == pytest.approx(zone.box, abs=0.01)
        assert (again.id, again.kind, again.label) == (zone.id, zone.kind, zone.label)
        assert again.text.split() == (clean(zone.text).split() if zone.kind == "text" else [])
        if zone.lines is not None:  # else those of its text are counted
            assert again.lines == zone.lines
        assert (again.font_size, again.line_spacing) == (zone.font_size, zone.line_spacing)
        assert (again.weight, again.alignment) == (zone.weight, zone.alignment)


def test_words_are_written_with_their_places_and_confidences() -> None:
    written = write_alto(recognized(read_page()), "p.png", CREATED)
    assert faults_of_alto(written) == []
    words = list(fromstring(written).iter(f"{{{V4}}}String"))
    assert [(word.get("CONTENT"), word.get("WC")) for word in words] == [
        ("Dear", "0.9"),
        ("Ms <&>", "0.25"),
        ("Roe,", "1"),
    ]
    assert [words[1].get(side) for side in ("HPOS", "VPOS", "WIDTH", "HEIGHT")] == ["45", "11", "35", "10"]
    [back] = read_zones_file(written, LIMITS).zones
    assert (back.text, back.lines) == ("Dear Ms <&>\nRoe,", 2)


def test_words_within_a_figure_are_written_and_the_figure_stays_one_zone() -> None:
    written = write_alto(recognized(printed_figure()), "p.png", CREATED)
    assert faults_of_alto(written) == []
    words = [word.get("CONTENT") for word in fromstring(written).iter(f"{{{V4}}}String")]
    assert words == ["Axis", "0.5"]
    [back] = read_zones_file(written, LIMITS).zones
    assert (back.id, back.kind, back.label, back.box) == ("f", "figure", "figure", (5.0, 5.0, 80.0, 40.0))


def test_lines_of_the_text_are_lines() -> None:
    page = Page(100, 100, (Zone("a", (1, 2, 3.25, 4), text="two words\n\nof  three\n", lines=2),))
    written = write_alto(recognized(page, None), "", CREATED)
    assert b"OtherTag" not in written
    assert b"PAGECLASS" not in written
    zone = read_zones_file(written, LIMITS).zones[0]
    assert (zone.text, zone.lines, zone.box) == ("two words\nof three", 2, (1, 2, 3.25, 4))


@pytest.mark.parametrize("namespace", [V2, V3, V4, ""])
def test_blocks_of_others(namespace: str) -> None:
    line = '<TextLine HPOS="1" VPOS="2" WIDTH="30" HEIGHT="4">{}</TextLine>'
    data = alto(
        f'<TextBlock ID="b1" {PLACE} TAGREFS="t0 t1" STYLEREFS="s1 s2">'
        + line.format('<String CONTENT="Lay"/><SP/><String CONTENT="struc"/><HYP CONTENT="-"/>')
        + line.format('<String CONTENT="ture"/>')
        + "</TextBlock>"
        f'<ComposedBlock ID="c" TAGREFS="t2"><TextBlock ID="b2" {PLACE}/>'
        f'<TextBlock ID="b3" {PLACE} TAGREFS="t1"/></ComposedBlock>'
        '<Illustration ID="b4"><Shape><Polygon POINTS="5,6 70,6 70,80"/></Shape></Illustration>'
        '<GraphicalElement ID="b5" HPOS="10" VPOS="500" WIDTH="900" HEIGHT="0"/>'
        f'<ComposedBlock ID="b6" TYPE="table" {PLACE}/>'
        f'<TextBlock ID="b7">{line.format("")}</TextBlock>',
        namespace=namespace,
        parts='<Styles><TextStyle ID="s1"/><ParagraphStyle ID="s2" ALIGN="Block" LINESPACE="30"/></Styles>'
        '<Tags><NamedEntityTag ID="t0" LABEL="Bonn"/><LayoutTag ID="t1" LABEL="title"/>'
        '<StructureTag ID="t2" TYPE="Article" LABEL="body"/></Tags>',
    )
    zones = {zone.id: zone for zone in read_zones_file(data, LIMITS).zones}
    assert list(zones) == ["b1", "b2", "b3", "b4", "b5", "b6", "b7"]
    assert zones["b1"].text == "Lay struc-\nture"
    assert (zones["b1"].lines, zones["b1"].alignment, zones["b1"].line_spacing) == (2, "justified", 30)
    assert [zones[name].label for name in ("b1", "b2", "b3", "b4")] == ["title", "body", "title", None]
    assert (zones["b4"].kind, zones["b4"].box) == ("figure", (5, 6, 70, 80))
    assert (zones["b5"].kind, zones["b5"].box) == ("rule", (10, 500, 910, 501))
    assert zones["b6"].kind == "figure"
    assert zones["b7"].box == (1, 2, 31, 6)
    assert zones["b7"].font_size == pytest.approx(4 / 0.9)


def test_a_table_is_one_zone_and_other_tags_label_where_no_other_does() -> None:
    line = '<TextLine><String CONTENT="{}"/></TextLine>'
    data = alto(
        f'<ComposedBlock ID="c1" TYPE="TableRegion" {PLACE}><TextBlock ID="b1">{line.format("cell")}'
        "</TextBlock></ComposedBlock>"
        f'<ComposedBlock ID="c2" TAGREFS="t1"><TextBlock ID="b2" {PLACE} TAGREFS="t2"/>'
        f'<TextBlock ID="b3" {PLACE}/><TextBlock ID="b4" {PLACE} TAGREFS="t3 t2"/></ComposedBlock>',
        parts='<Tags><StructureTag ID="t1" LABEL="article"/><OtherTag ID="t2" TYPE="block type" LABEL="MainZone"/>'
        '<LayoutTag ID="t3" LABEL="title"/></Tags><ReadingOrder><OrderedGroup ID="g"><ElementRef ID="e" REF="b4"/>'
        '<ElementRef ID="f" REF="b1"/></OrderedGroup></ReadingOrder>',
    )
    told = [(zone.id, zone.kind, zone.label, zone.text) for zone in read_zones_file(data, LIMITS).zones]
    assert told == [
        ("b4", "text", "title", ""),
        ("c1", "figure", None, "cell"),
        ("b2", "text", "MainZone", ""),
        ("b3", "text", "article", ""),
    ]


def test_sizes_are_those_of_the_lines() -> None:
    lines = "".join(
        f'<TextLine HPOS="10" VPOS="{y}" WIDTH="500" HEIGHT="{height}"/>'
        for y, height in ((100, 27), (140, 27), (181, 28))
    )
    data = alto(
        f'<TextBlock ID="b" HPOS="10" VPOS="100" WIDTH="500" HEIGHT="110">{lines}</TextBlock>', unit="mm10"
    )
    zone = read_zones_file(data, LIMITS, pixels=(2000.0, 4000.0)).zones[0]
    assert (zone.font_size, zone.line_spacing) == (pytest.approx(60), pytest.approx(81.5, abs=1))


def test_references_of_any_length_are_read_in_time() -> None:
    inner = f'<ComposedBlock ID="c"><TextBlock ID="b" {PLACE}/></ComposedBlock>' * 5_000
    with pytest.raises(InvalidLayout, match="5000 zones"):
        read_zones_file(
            alto(f'<ComposedBlock ID="o" TAGREFS="{"t " * 1_000_000}">{inner}</ComposedBlock>'), LIMITS
        )


def test_reading_order_by_groups_and_by_next() -> None:
    blocks = "".join(f'<TextBlock ID="b{i}" {PLACE} {{{i}}}/>' for i in range(4))
    order = (
        '<ReadingOrder><OrderedGroup ID="g"><ElementRef ID="e1" REF="b2"/>'
        '<UnorderedGroup ID="h"><ElementRef ID="e2" REF="b0 gone"/></UnorderedGroup></OrderedGroup></ReadingOrder>'
    )
    told = read_zones_file(alto(blocks.format("", "", "", ""), parts=order), LIMITS)
    assert [zone.id for zone in told.zones] == ["b2", "b0", "b1", "b3"]
    chain = blocks.format("", 'IDNEXT="b0"', 'IDNEXT="b1"', "")
    assert [zone.id for zone in read_zones_file(alto(chain), LIMITS).zones] == ["b2", "b1", "b0", "b3"]
    ring = blocks.format('IDNEXT="b1"', 'IDNEXT="b0"', "", "")
    assert {zone.id for zone in read_zones_file(alto(ring), LIMITS).zones} == {"b0", "b1", "b2", "b3"}


@pytest.mark.parametrize("unit", ["mm10", "inch1200"])
def test_other_units_need_the_page_in_pixels(unit: str) -> None:
    data = alto(f'<TextBlock ID="b" {PLACE}/>', unit=unit)
    with pytest.raises(InvalidLayout, match=unit) as refusal:
        read_zones_file(data, LIMITS)
    assert refusal.value.field == "zones_file"
    page = read_zones_file(data, LIMITS, pixels=(500.0, 500.0))
    assert (page.width, page.height, page.zones[0].box) == (500, 500, (5, 5, 55, 15))
    with pytest.raises(InvalidLayout, match="WIDTH"):
        read_zones_file(alto("", unit=unit, size=""), LIMITS, pixels=(500.0, 500.0))


def test_a_page_without_a_size_has_that_of_its_image() -> None:
    assert read_zones_file(alto("", size=""), LIMITS, pixels=(300.0, 400.0)) == Page(300, 400, ())
    with pytest.raises(InvalidLayout) as refusal:
        read_zones_file(alto("", size=""), LIMITS)
    assert refusal.value.field == "width"


@pytest.mark.parametrize(
    ("data", "field"),
    [
        (b"<alto/>", "zones_file"),
        (alto("").replace(b"</Layout>", b'<Page ID="q"/></Layout>'), "zones_file"),
        (alto('<TextBlock ID="b"/>'), "zones[0].box"),
        (alto('<TextBlock ID="b" HPOS="x" VPOS="1" WIDTH="1" HEIGHT="1"/>'), "zones[0].box"),
        (alto(f'<TextBlock ID="b" {PLACE} TAGREFS="t"/>', parts=LONG_TAG), "zones[0].label"),
    ],
)
def test_what_is_refused(data: bytes, field: str) -> None:
    with pytest.raises(InvalidLayout) as refusal:
        read_zones_file(data, LIMITS)
    assert refusal.value.field == field


def test_one_bad_block_costs_that_block() -> None:
    told: list[Notice] = []
    bad = '<TextBlock ID="wild" HPOS="5" VPOS="-94923152" WIDTH="61.6" HEIGHT="-48132729"/>'
    data = alto(f'<TextBlock ID="a" {PLACE}/>{bad}<TextBlock ID="b" {PLACE}/><TextBlock ID="b" {PLACE}/>')
    zones = read_zones_file(data, LIMITS, warn=told.append).zones
    assert [zone.id for zone in zones] == ["a", "b", "b-2"]
    [notice] = told
    assert (notice.code, "'wild'" in notice.detail) == ("block-left-out", True)


def test_the_print_space_gives_the_size_of_a_page_without_one() -> None:
    space = '<PrintSpace HPOS="100" VPOS="0" WIDTH="1900" HEIGHT="3000">'
    data = alto(f'<TextBlock ID="b" {PLACE}/>', size="").replace(b"<PrintSpace>", space.encode())
    page = read_zones_file(data, LIMITS)
    assert (page.width, page.height) == (2000, 3000)
    image = read_zones_file(data, LIMITS, pixels=(500.0, 600.0))
    assert (image.width, image.height) == (500, 600)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ('<String CONTENT="exa"/><HYP CONTENT="-"/>', "exa-"),
        ('<String CONTENT="exa-" SUBS_TYPE="HypPart1" SUBS_CONTENT="example"/><HYP CONTENT="-"/>', "exa-"),
        ('<String CONTENT="exa\u00ac"/><HYP CONTENT="\u00ac"/>', "exa\u00ac"),
        ('<String CONTENT="an"/><SP/><String CONTENT="exa\u2010"/><HYP CONTENT="-"/>', "an exa\u2010"),
    ],
)
def test_a_line_has_its_hyphen_once(words: str, text: str) -> None:
    data = alto(f'<TextBlock ID="b" {PLACE}><TextLine>{words}</TextLine></TextBlock>')
    assert read_zones_file(data, LIMITS).zones[0].text == text


@pytest.mark.parametrize(
    "tag",
    [
        '<OtherTag ID="t" TYPE="language" LABEL="deu"/>',
        '<OtherTag ID="t" DESCRIPTION="language" LABEL="deu"/>',
        '<LayoutTag ID="t" TYPE="Script" LABEL="Latn"/>',
    ],
)
def test_languages_are_no_labels(tag: str) -> None:
    data = alto(f'<TextBlock ID="b" {PLACE} TAGREFS="t"/>', parts=f"<Tags>{tag}</Tags>")
    assert read_zones_file(data, LIMITS).zones[0].label is None
