"""PAGE-XML: what is written is valid and reads back; what others write is read."""

from datetime import timedelta, timezone
from xml.etree.ElementTree import fromstring

import pytest
from hypothesis import given, settings

from services.layout.exchange.page_xml import NAMESPACE, write_page_xml
from services.layout.exchange.xml_writing import clean
from services.layout.exchange.zones_file import read_zones_file
from services.layout.page import InvalidLayout, Page, Zone
from services.notices import Notice
from tests.services.layout.exchange.pages import CREATED, LIMITS, pages, printed_figure, read_page, recognized
from tests.services.layout.exchange.schema_rules import faults_of_page_xml


def page_xml(regions: str, order: str = "", version: str = "2019-07-15", more: str = "") -> bytes:
    return (
        f'<?xml version="1.0"?><pc:PcGts xmlns:pc="{NAMESPACE.replace("2019-07-15", version)}">'
        f'<pc:Page imageFilename="a.png" imageWidth="1000" imageHeight="2000" {more}>'
        f"{order}{regions}</pc:Page></pc:PcGts>"
    ).encode()


def region(
    name: str, tag: str = "TextRegion", points: str = "10,20 110,20 110,60 10,60", **parts: str
) -> str:
    more = " ".join(f'{key}="{value}"' for key, value in parts.items() if key != "inside")
    return f'<pc:{tag} id="{name}" {more}><pc:Coords points="{points}"/>{parts.get("inside", "")}</pc:{tag}>'


def test_a_page_of_a_turned_image_says_so() -> None:
    written = write_page_xml(recognized(Page(10, 20, ())), "p.png", CREATED, 90)
    assert faults_of_page_xml(written) == []
    assert b"turned clockwise by 90 degrees" in written
    assert b"turned" not in write_page_xml(recognized(Page(10, 20, ())), "p.png", CREATED)


@pytest.mark.pipeline
@given(pages())
@settings(max_examples=60, deadline=None)
def test_what_is_written_is_valid_and_reads_back(page: Page) -> None:
    written = write_page_xml(recognized(page), "page.png", CREATED)
    assert faults_of_page_xml(written) == []
    back = read_zones_file(written, LIMITS)
    assert (back.width, back.height) == (page.width, page.height)
    for zone, again in zip(page.zones, back.zones, strict=True):
        assert again.box == zone.box
        assert (again.kind, again.label) == (zone.kind, zone.label)
        text = clean(zone.text) if zone.text.strip() else ""  # blank text is none
        assert (again.id, again.text) == (zone.id, text)
        assert (again.lines, again.font_size, again.line_spacing, again.weight) == (
            zone.lines,
            zone.font_size,
            zone.line_spacing,
            zone.weight,
        )
        assert zone.kind != "text" or again.alignment == zone.alignment


def test_words_are_written_with_their_places_and_confidences() -> None:
    written = write_page_xml(recognized(read_page()), "p.png", CREATED)
    assert faults_of_page_xml(written) == []
    space = {"pc": NAMESPACE}
    lines = fromstring(written).findall(".//pc:TextLine", space)
    assert [len(line.findall("pc:Word", space)) for line in lines] == [2, 1]
    points = [line.find("pc:Coords", space).get("points") for line in lines]  # type: ignore[union-attr]
    assert points == ["10,10 80,10 80,21 10,21", "10,30 35,30 35,40 10,40"]
    sure = [read.get("conf") for read in fromstring(written).findall(".//pc:Word/pc:TextEquiv", space)]
    assert sure == ["0.9", "0.25", "1"]
    [back] = read_zones_file(written, LIMITS).zones
    assert (back.text, back.lines) == ("Dear Ms <&>\nRoe,", 2)


def test_words_within_a_figure_are_written_and_the_figure_stays_one_zone() -> None:
    written = write_page_xml(recognized(printed_figure()), "p.png", CREATED)
    assert faults_of_page_xml(written) == []
    words = fromstring(written).findall(
        ".//pc:ImageRegion//pc:Word/pc:TextEquiv/pc:Unicode", {"pc": NAMESPACE}
    )
    assert [word.text for word in words] == ["Axis", "0.5"]
    [back] = read_zones_file(written, LIMITS).zones
    assert (back.id, back.kind, back.label, back.box) == ("f", "figure", "figure", (5.0, 5.0, 80.0, 40.0))


def test_boxes_are_rounded_and_stay_on_the_page() -> None:
    page = Page(100.4, 50.6, (Zone("a", (0.2, 1.6, 100.4, 50.6)), Zone("b", (99.9, 50.55, 100.4, 50.6))))
    written = write_page_xml(recognized(page, None), "", CREATED)
    assert faults_of_page_xml(written) == []
    assert [zone.box for zone in read_zones_file(written, LIMITS).zones] == [
        (0, 2, 100, 51),
        (99, 50, 100, 51),
    ]


def test_class_confidence_and_time_are_written() -> None:
    page = Page(100, 100, (Zone("a", (1, 2, 3, 4), label="subject"),))
    created = CREATED.astimezone(timezone(timedelta(hours=2)))
    written = write_page_xml(recognized(page), "p.png", created).decode()
    assert 'custom="class {name:letter; probability:0.97;}"' in written
    assert 'type="other" custom="structure {type:subject; score:0.9;} zone {}"' in written
    assert "<Created>2026-03-01T12:30:00Z</Created>" in written


@pytest.mark.parametrize(
    ("label", "type_"), [("title", "heading"), ("body", "paragraph"), ("footer", "footer")]
)
def test_labels_that_page_has_a_word_for(label: str, type_: str) -> None:
    page = Page(100, 100, (Zone("a", (1, 2, 3, 4), label=label),))
    assert f'type="{type_}"' in write_page_xml(recognized(page), "p.png", CREATED).decode()


def test_a_logo_is_a_graphic() -> None:
    page = Page(100, 100, (Zone("a", (1, 2, 3, 4), kind="figure", label="logo", text="ACME"),))
    written = write_page_xml(recognized(page), "p.png", CREATED)
    assert b'<GraphicRegion id="a" type="logo"' in written
    assert read_zones_file(written, LIMITS).zones[0].text == "ACME"


@pytest.mark.parametrize("version", ["2013-07-15", "2017-07-15", "2019-07-15"])
def test_regions_of_others(version: str) -> None:
    text = "<pc:TextEquiv><pc:Unicode>{}</pc:Unicode></pc:TextEquiv>"
    line = '<pc:TextLine id="l"><pc:Coords points="0,0 1,1"/>' + text + "</pc:TextLine>"
    data = page_xml(
        region("r1", type="heading", inside=line.format(1) + line.format(2))
        + region("r2", custom="readingOrder {index:0;} structure {type:sub\\u0020title;}", type="paragraph")
        + region("r3", "SeparatorRegion", "10,100 900,100")
        + region("r4", "ImageRegion")
        + region("r5", "NoiseRegion")
        + region("r6", "TableRegion", inside=region("c1", inside=text.format("cell")))
        + region("r7", "AdvertRegion", inside=region("c2") + region("c3", "ImageRegion"))
        + region("r8", type="other", align="justify"),
        order='<pc:ReadingOrder><pc:OrderedGroup id="g"><pc:RegionRefIndexed index="1" regionRef="r1"/>'
        '<pc:UnorderedGroupIndexed id="h" index="0"><pc:RegionRef regionRef="r4"/><pc:RegionRef regionRef="c1"/>'
        "</pc:UnorderedGroupIndexed></pc:OrderedGroup></pc:ReadingOrder>",
        version=version,
    )
    zones = read_zones_file(data, LIMITS).zones
    assert [zone.id for zone in zones] == ["r4", "r6", "r1", "r2", "r3", "r5", "c2", "c3", "r8"]
    by_id = {zone.id: zone for zone in zones}
    assert (by_id["r1"].label, by_id["r1"].lines, by_id["r1"].text) == ("heading", 2, "1\n2")
    assert by_id["r2"].label == "sub title"
    assert (by_id["r3"].kind, by_id["r3"].box) == ("rule", (10, 100, 900, 101))
    assert [by_id[name].kind for name in ("r4", "r5", "r6")] == ["figure", "noise", "figure"]
    assert by_id["r6"].text == "cell"
    assert (by_id["r8"].label, by_id["r8"].alignment) == (None, "justified")


def test_sizes_in_points_where_the_resolution_is_told() -> None:
    styled = region("r", inside='<pc:TextStyle fontSize="12"/>')
    more = 'imageYResolution="300" imageResolutionUnit="PPI"'
    assert read_zones_file(page_xml(styled, more=more), LIMITS).zones[0].font_size == pytest.approx(50)
    assert read_zones_file(page_xml(styled), LIMITS).zones[0].font_size is None
    lined = region("r", inside='<pc:TextLine id="l"><pc:Coords points="10,20 110,20 110,38"/></pc:TextLine>')
    assert read_zones_file(page_xml(lined), LIMITS).zones[0].font_size == pytest.approx(20)


def test_corners_as_until_2010() -> None:
    data = page_xml(
        '<pc:TextRegion id="r"><pc:Coords><pc:Point x="5" y="6"/><pc:Point x="50" y="60"/></pc:Coords></pc:TextRegion>'
    )
    assert read_zones_file(data, LIMITS).zones[0].box == (5, 6, 50, 60)


@pytest.mark.parametrize(
    ("data", "field"),
    [
        (b"<PcGts/>", "zones_file"),
        (page_xml(region("r", points="")), "zones[0].box"),
        (page_xml(region("r", points="1,2 x,4 5,6")), "zones[0].box"),
        (page_xml(region("r", points="1,2 3,nan 5,6")), "zones[0].box"),
        (page_xml('<pc:TextRegion id="r"/>'), "zones[0].box"),
        (page_xml(region("r", points="5000,0 6000,9")), "zones[0].box"),
        (page_xml(region("r", custom="structure {type:\\ud800;}")), "zones[0].label"),
        (page_xml("").replace(b'imageWidth="1000"', b'imageWidth="wide"'), "width"),
        (page_xml("".join(region(f"r{i}") for i in range(501))), "zones"),
    ],
)
def test_what_is_refused(data: bytes, field: str) -> None:
    with pytest.raises(InvalidLayout) as refusal:
        read_zones_file(data, LIMITS)
    assert refusal.value.field == field


def test_a_page_without_regions_is_one() -> None:
    assert read_zones_file(page_xml(""), LIMITS) == Page(1000, 2000, ())


def test_custom_of_any_length_is_read_in_time() -> None:
    zone = read_zones_file(page_xml(region("r", custom="a" * 1_000_000 + " {" * 1_000_000)), LIMITS).zones[0]
    assert zone.label is None


TEXT = "<pc:TextEquiv><pc:Unicode>{}</pc:Unicode></pc:TextEquiv>"


def text_line(name: str, place: int, points: str, text: str) -> str:
    custom = f'custom="readingOrder {{index:{place};}}"'
    return (
        f'<pc:TextLine id="{name}" {custom}><pc:Coords points="{points}"/>{TEXT.format(text)}</pc:TextLine>'
    )


def test_one_bad_region_costs_that_region() -> None:
    told: list[Notice] = []
    data = page_xml(region("r1") + region("far", points="5000,0 6000,9") + region("r1") + region("r2"))
    zones = read_zones_file(data, LIMITS, warn=told.append).zones
    assert [zone.id for zone in zones] == ["r1", "r1-2", "r2"]
    [notice] = told
    assert notice.code == "block-left-out"
    assert "'far'" in notice.detail
    assert "outside the page" in notice.detail


@pytest.mark.parametrize(
    "coords", ["", "<pc:Coords/>", '<pc:Coords points=""/>', '<pc:Coords points="7,7"/>']
)
def test_a_region_without_coordinates_is_where_its_lines_are(coords: str) -> None:
    """The parts of a region have them: lines, their baselines, the words of lines, regions within."""
    lines = text_line("a", 0, "10,20 200,50", "one") + text_line("b", 1, "12,60 240,90", "two")
    inner = '<pc:TextLine id="c"><pc:Baseline points="5,130 90,130"/></pc:TextLine>'
    data = page_xml(
        f'<pc:TextRegion id="r">{coords}{lines}{inner}</pc:TextRegion>'
        f'<pc:TableRegion id="t">{coords}{region("w", points="300,300 350,340")}</pc:TableRegion>'
    )
    first, table = read_zones_file(data, LIMITS).zones
    assert (first.box, first.text) == ((5, 20, 240, 131), "one\ntwo")
    assert table.box == (300, 300, 350, 340)


def test_transcriptions_of_others() -> None:
    both = "<pc:TextEquiv><pc:PlainText>plain</pc:PlainText><pc:Unicode>the text</pc:Unicode></pc:TextEquiv>"
    plain = "<pc:TextEquiv><pc:PlainText>only plain</pc:PlainText><pc:Unicode> </pc:Unicode></pc:TextEquiv>"
    lines = text_line("a", 0, "1,2 30,9", "from lines")
    second = '<pc:TextEquiv index="1"><pc:Unicode>second best</pc:Unicode></pc:TextEquiv>'
    cell = '<pc:TableCell row="0" col="{0}" id="c{0}"><pc:Coords points="1,1 9,9"/>{1}</pc:TableCell>'
    table = cell.format(0, text_line("x", 0, "1,1 9,9", "cell 0")) + cell.format(1, TEXT.format("cell 1"))
    data = page_xml(
        region("r1", inside=both)
        + region("r2", inside=plain)
        + region("r3", inside=lines + TEXT.format("\n  "))
        + region("r4", inside=lines + "<pc:TextEquiv><pc:Unicode/></pc:TextEquiv>")
        + region("r5", inside='<pc:TextEquiv index="0"><pc:Unicode/></pc:TextEquiv>' + second)
        + region("t", "TableRegion", inside=table)
    )
    texts = [zone.text for zone in read_zones_file(data, LIMITS).zones]
    assert texts == ["the text", "only plain", "from lines", "from lines", "second best", "cell 0\ncell 1"]


def test_reading_order_in_custom() -> None:
    """As Transkribus writes it, of regions and of their lines; a ReadingOrder counts more."""
    lines = text_line("b", 1, "1,20 90,30", "below") + text_line("a", 0, "1,2 90,12", "above")
    regions = region("late", custom="readingOrder {index:1;}", inside=lines) + region(
        "early", custom="readingOrder {index:0;} structure {type:heading;}"
    )
    zones = read_zones_file(page_xml(regions), LIMITS).zones
    assert [(zone.id, zone.label, zone.text) for zone in zones] == [
        ("early", "heading", ""),
        ("late", None, "above\nbelow"),
    ]
    first = '<pc:RegionRefIndexed index="0" regionRef="late"/>'
    order = f'<pc:ReadingOrder><pc:OrderedGroup id="g">{first}</pc:OrderedGroup></pc:ReadingOrder>'
    named = read_zones_file(page_xml(regions, order=order), LIMITS).zones
    assert [zone.id for zone in named] == ["late", "early"]
    some = read_zones_file(page_xml(regions + region("without")), LIMITS).zones
    assert [zone.id for zone in some] == ["late", "early", "without"]


def test_a_page_without_a_size_has_that_of_its_print_space() -> None:
    bare = page_xml(region("r")).replace(b'imageWidth="1000" imageHeight="2000"', b"")
    with pytest.raises(InvalidLayout) as refusal:
        read_zones_file(bare, LIMITS)
    assert refusal.value.field == "width"
    assert read_zones_file(bare, LIMITS, pixels=(800.0, 900.0)).width == 800
    space = b'<pc:PrintSpace><pc:Coords points="0,0 1500,0 1500,1700 0,1700"/></pc:PrintSpace><pc:TextRegion'
    read = read_zones_file(bare.replace(b"<pc:TextRegion", space, 1), LIMITS)
    assert (read.width, read.height) == (1500, 1700)
