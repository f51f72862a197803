"""Tables of items in files: PAGE-XML and ALTO with a region for each cell, valid, and read back as one zone."""

from dataclasses import replace
from xml.etree.ElementTree import fromstring

from services.layout.exchange import alto
from services.layout.exchange.alto import write_alto
from services.layout.exchange.page_xml import NAMESPACE, write_page_xml
from services.layout.exchange.zones_file import read_zones_file
from services.layout.page import Page, Zone
from services.layout.recognition.results import Recognition
from services.layout.tables.item_table import ItemTable, TableCell
from tests.services.layout.exchange.pages import CREATED, LIMITS, recognized
from tests.services.layout.exchange.schema_rules import faults_of_alto, faults_of_page_xml


def cell(text: str, x: float, y: float) -> TableCell:
    return TableCell((x, y, x + 90.0, y + 20.0), text, text, None, None, 0.75)


TABLE = ItemTable(
    columns=("description", "amount"),
    types=("text", "amount"),
    headers=("Item", None),
    box=(100.0, 200.0, 500.0, 300.0),
    rows=((cell("Oak <shelf>\nplaned", 100, 230), cell("4.50", 400, 230)), (None, cell("7.00", 400, 270))),
)
TABLE_ZONE = Zone("z2", (100.0, 200.0, 500.0, 300.0), text="Item\nOak <shelf> 4.50\nplaned\n7.00")
HEAD = Zone("z1", (100.0, 20.0, 300.0, 60.0), text="Invoice", label="title")


def with_table(*zones: Zone) -> Recognition:
    return replace(recognized(Page(600.0, 800.0, zones)), tables=(TABLE,))


def test_a_table_is_a_region_with_cells() -> None:
    written = write_page_xml(with_table(HEAD, TABLE_ZONE), "a.png", CREATED)
    assert faults_of_page_xml(written) == []
    space = {"pc": NAMESPACE}
    [table] = fromstring(written).iterfind(".//pc:TableRegion", space)
    assert (table.get("id"), table.get("rows"), table.get("columns")) == ("z2", "2", "2")
    cells = [
        (
            role.get("rowIndex"),
            role.get("columnIndex"),
            region.get("custom"),
            region.findtext("pc:TextEquiv/pc:Unicode", namespaces=space),
        )
        for region in table.iterfind("pc:TextRegion", space)
        for role in region.iterfind("pc:Roles/pc:TableCellRole", space)
    ]
    assert cells == [
        ("0", "0", "structure {type:description; score:0.75;}", "Oak <shelf>\nplaned"),
        ("0", "1", "structure {type:amount; score:0.75;}", "4.50"),
        ("1", "1", "structure {type:amount; score:0.75;}", "7.00"),
    ]


def test_a_table_that_is_no_zone_stands_beside_the_zones() -> None:
    parts = tuple(Zone(f"c{k}", (100.0, 230.0 + 40 * k, 190.0, 250.0 + 40 * k), text="x") for k in range(2))
    written = write_page_xml(with_table(HEAD, *parts), "a.png", CREATED)
    assert faults_of_page_xml(written) == []
    root = fromstring(written)
    assert [region.get("id") for region in root[1].iterfind(f"{{{NAMESPACE}}}TextRegion")] == [
        "z1",
        "c0",
        "c1",
    ]
    [table] = root.iterfind(f".//{{{NAMESPACE}}}TableRegion")
    assert table.get("id") == "table"


def test_alto_has_a_block_for_each_cell_with_the_label_of_its_column() -> None:
    written = write_alto(with_table(HEAD, TABLE_ZONE), "a.png", CREATED)
    assert faults_of_alto(written) == []
    root, space = fromstring(written), {"a": alto.NAMESPACE}
    labels = {tag.get("ID"): tag.get("LABEL") for tag in root.iterfind(".//a:LayoutTag", space)}
    [table] = root.iterfind(".//a:ComposedBlock", space)
    assert (table.get("ID"), table.get("TYPE")) == ("z2", "table")
    cells = [
        (
            block.get("ID"),
            labels[block.get("TAGREFS")],
            " ".join(word.get("CONTENT", "") for word in block.iterfind(".//a:String", space)),
        )
        for block in table.iterfind("a:TextBlock", space)
    ]
    assert cells == [
        ("z2-r1-c1", "description", "Oak <shelf> planed"),
        ("z2-r1-c2", "amount", "4.50"),
        ("z2-r2-c2", "amount", "7.00"),
    ]


def test_files_with_a_table_read_back_as_one_zone() -> None:
    for write in (write_page_xml, write_alto):
        back = read_zones_file(write(with_table(HEAD, TABLE_ZONE), "a.png", CREATED), LIMITS)
        assert [zone.id for zone in back.zones] == ["z1", "z2"]
        assert back.zones[1].box == TABLE.box
        assert "4.50" in back.zones[1].text


def test_a_cell_that_a_person_drew_stands_in_its_table_alone() -> None:
    drawn = Zone("n1", (400.0, 270.0, 490.0, 290.0), text="7.00", label="amount")
    for written in (
        write_page_xml(with_table(HEAD, TABLE_ZONE, drawn), "a.png", CREATED),
        write_alto(with_table(HEAD, TABLE_ZONE, drawn), "a.png", CREATED),
    ):
        assert written.decode().count("7.00") == 1
        assert 'D="n1"' not in written.decode().replace("id=", "ID=")
    other = replace(drawn, label="note")
    assert 'id="n1"' in write_page_xml(with_table(HEAD, TABLE_ZONE, other), "a.png", CREATED).decode()
