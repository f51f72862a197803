"""Files of zones: told apart, and hostile ones refused before they cost anything."""

import json
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.exchange.alto import write_alto
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_to_document
from services.layout.exchange.page_xml import NAMESPACE, write_page_xml
from services.layout.exchange.zones_file import read_zones_file
from services.layout.page import InvalidLayout, Page, Zone
from tests.services.layout.exchange.pages import CREATED, LIMITS, recognized

PAGE = Page(100, 200, (Zone("z1", (10, 20, 30, 40), label="date", text="1 March", lines=1),))
EMPTY = f'<PcGts xmlns="{NAMESPACE}"><Page imageFilename="ä" imageWidth="10" imageHeight="20"/></PcGts>'


@pytest.mark.parametrize(
    "data",
    [
        write_page_xml(recognized(PAGE), "p.png", CREATED),
        write_alto(recognized(PAGE), "p.png", CREATED),
        json.dumps(page_to_document(PAGE)).encode(),
        b"\xef\xbb\xbf  " + json.dumps(page_to_document(PAGE)).encode(),
        json.dumps(page_to_document(PAGE)).encode("utf-16"),
    ],
    ids=["page", "alto", "json", "json with a mark", "json in utf-16"],
)
def test_any_of_the_three(data: bytes) -> None:
    assert read_zones_file(data, LIMITS) == PAGE


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1", "windows-1252"])
def test_any_encoding_that_is_told(encoding: str) -> None:
    declared = f'<?xml version="1.0" encoding="{encoding.removesuffix("-sig")}"?>' + EMPTY
    assert read_zones_file(declared.encode(encoding), LIMITS) == Page(10, 20, ())


BOMB = '<!DOCTYPE PcGts [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>'
EXTERNAL = '<!DOCTYPE PcGts [<!ENTITY x SYSTEM "file:///etc/passwd">]>'


@pytest.mark.pipeline
@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "neither"),
        (b"\0\0\0", "neither"),
        (b"width: 10", "neither"),
        (b"<svg/>", "svg"),
        (b"<PcGts><Page>", "well-formed"),
        (b"<PcGts>\xff\xfe</PcGts>", "well-formed"),
        (b'<?xml version="1.0" encoding="utf-16"?>' + EMPTY.encode(), "well-formed"),
        (b'<?xml version="1.0" encoding="klingon"?><PcGts/>', "well-formed"),
        (b'<?xml version="1.0" encoding="shift_jis"?><PcGts/>', "well-formed"),
        (b"<PcGts>&undeclared;</PcGts>", "well-formed"),
        ((BOMB + EMPTY.replace("ä", "&b;")).encode(), "DOCTYPE"),
        ((EXTERNAL + EMPTY.replace("ä", "&x;")).encode(), "DOCTYPE"),
        (b'<!DOCTYPE PcGts SYSTEM "http://localhost/x.dtd"><PcGts/>', "DOCTYPE"),
        (b"<PcGts>" * 100 + b"</PcGts>" * 100, "deeper"),
        (b"<PcGts>" * 1_000_000, "deeper"),
        (b"<PcGts>" + b"<a/>" * 500_000 + b"</PcGts>", "elements"),
        (b"<PcGts>" + b" " * 10_000_000 + b"</PcGts>", "bytes"),
        (b"[" * 10_000_000, "bytes"),
        (b"[" * 100_000, "too deep"),
        (b'{"width": 1', "no JSON"),
        (b'{"width": "\xff"}', "no JSON"),
        (b'{"width": ' + b"9" * 5000 + b"}", "no JSON"),
        (b"[1, 2]", "object"),
    ],
)
def test_hostile_files(data: bytes, why: str) -> None:
    with pytest.raises(InvalidLayout, match=why) as refusal:
        read_zones_file(data, LIMITS)
    assert refusal.value.field in {"zones_file", "zones"}
    assert len(refusal.value.detail) < 300


def test_limits_are_those_given() -> None:
    data = write_alto(recognized(PAGE), "p.png", CREATED)
    for limits in (
        ExchangeLimits(max_bytes=100),
        ExchangeLimits(max_elements=5),
        ExchangeLimits(max_depth=3),
    ):
        with pytest.raises(InvalidLayout):
            read_zones_file(data, limits)


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_damaged_files_are_read_or_refused(data: st.DataObject) -> None:
    whole = data.draw(
        st.sampled_from(
            [write_page_xml(recognized(PAGE), "p", CREATED), write_alto(recognized(PAGE), "p", CREATED)]
        )
    )
    at = data.draw(st.integers(0, len(whole) - 1))
    piece = data.draw(st.binary(max_size=4) | st.sampled_from([b"NaN", b"-", b"1e999", b'"', b"<", b"&#0;"]))
    damaged = whole[:at] + piece + whole[at + data.draw(st.integers(0, 6)) :]
    with suppress(InvalidLayout):
        assert read_zones_file(damaged, LIMITS).width > 0
