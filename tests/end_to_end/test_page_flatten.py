"""The page's view "Flatten" in a real browser, with the product behind it."""

import json
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, Locator, expect

from tests.end_to_end.accessibility import violations
from tests.end_to_end.browser import NEEDS_CHROMIUM
from tests.end_to_end.page_visit import PHONE, Visit, chromium, visiting

pytestmark = NEEDS_CHROMIUM
NOTE_FORM = """() => {
  const send = window.fetch;
  window.fetch = (address, options) => {
    if (options.body instanceof FormData) window.sent = Object.fromEntries(options.body);
    return send(address, options);
  };
}"""
"""Playwright does not show forms with files, so the page notes what it sends."""
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """The browser of this module."""
    with chromium() as started:
        yield started


@pytest.fixture
def visit(browser: Browser, service: httpx.Client) -> Iterator[Visit]:
    """A tab that shows the page."""
    with visiting(browser, str(service.base_url).rstrip("/")) as opened:
        yield opened


def choose(visit: Visit, *names: str) -> None:
    visit.page.get_by_label("Photos").set_input_files([EXAMPLES / name for name in names])
    expect(visit.page.get_by_role("article")).to_have_count(len(names))


def natural_width(image: Locator) -> int:
    width: int = image.evaluate("image => image.decode().then(() => image.naturalWidth)")
    return width


def test_a_photo_becomes_a_flat_page_that_can_be_saved(visit: Visit) -> None:
    page = visit.page
    choose(visit, "photo.jpg")
    page.get_by_text("Options").click()
    page.get_by_label("Light").select_option("normalize")
    page.get_by_role("button", name="Flatten").click()
    expect(page.get_by_role("progressbar")).to_be_visible()
    flat = page.get_by_alt_text("Flat page")
    expect(flat).to_be_visible()
    assert natural_width(page.get_by_alt_text("Photo", exact=True)) > 100
    assert natural_width(flat) > 100
    outline = page.locator("svg .outline").first
    assert outline.evaluate("line => line.getBBox().width") > 100
    assert any("/events" in address for address in visit.addresses)

    with page.expect_download() as download:
        page.get_by_role("link", name="Download PDF").click()
    assert download.value.suggested_filename == "photo-flat.pdf"
    assert Path(download.value.path()).read_bytes().startswith(b"%PDF")
    with page.expect_download() as download:
        page.get_by_role("link", name="Download JSON").click()
    assert json.loads(Path(download.value.path()).read_text())["kind"] in ("planar", "curved")

    page.get_by_label("Show").select_option("slider")
    slider = page.get_by_label("Before and after")
    slider.press("ArrowRight")
    assert page.locator(".compare").evaluate("one => one.style.getPropertyValue('--cut')") == "51%"
    assert violations(page) == []
    visit.check()


def test_a_region_is_drawn_with_the_keyboard_alone(visit: Visit) -> None:
    """From the photo to the flat page without a pointer, but for the system's file dialog."""
    page = visit.page
    choose(visit, "photo.jpg")
    page.get_by_role("button", name="Draw region").focus()
    page.keyboard.press("Enter")
    for moves in ("ArrowUp*20 ArrowLeft*18", "ArrowRight*36", "ArrowDown*40", "ArrowLeft*36"):
        for move in moves.split():
            key, _, times = move.partition("*")
            for _ in range(int(times)):
                page.keyboard.press(key)
        page.keyboard.press("Enter")
    page.keyboard.press("Escape")
    expect(page.get_by_role("button", name="Clear region")).to_be_visible()
    page.get_by_role("button", name="Flatten").focus()
    page.evaluate(NOTE_FORM)
    page.keyboard.press("Enter")
    expect(page.get_by_alt_text("Flat page")).to_be_visible()
    assert len(json.loads(page.evaluate("window.sent.region"))) == 4
    visit.check()


def test_corners_and_turns_are_the_persons(visit: Visit) -> None:
    page = visit.page
    choose(visit, "photo.jpg")
    page.evaluate(NOTE_FORM)
    page.get_by_role("button", name="Flatten").click()
    expect(page.get_by_alt_text("Flat page")).to_be_visible()
    expect(page.get_by_role("button", name="Corner 1")).to_be_hidden()
    page.get_by_role("button", name="Corners", exact=True).click()
    first = page.get_by_role("button", name="Corner 1")
    expect(first).to_be_focused()
    before = first.bounding_box()
    for key in ("ArrowRight", "Shift+ArrowDown"):
        page.keyboard.press(key)
    box = page.get_by_role("button", name="Corner 3").bounding_box()
    assert before is not None
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] - 6, box["y"] - 4)
    page.mouse.up()
    after = first.bounding_box()
    assert after is not None
    assert after["x"] > before["x"]
    assert after["y"] > before["y"] + (after["x"] - before["x"])
    assert violations(page) == []
    page.get_by_role("button", name="Flatten").click()
    page.wait_for_function("window.sent.corners")
    corners = json.loads(page.evaluate("window.sent.corners"))
    assert len(corners) == 4
    # The view ends at the given corners: the service says so of its mesh.
    expect(page.get_by_role("status")).to_contain_text("is flat")
    page.get_by_role("button", name="Rotate").click()
    page.wait_for_function("window.sent.rotate === '90'")
    expect(page.locator(".facts")).to_contain_text("90°")
    page.get_by_role("button", name="Automatic corners").click()
    expect(first).to_be_hidden()
    visit.check()


def test_a_mosaic_shows_where_each_photo_lies_on_a_phone(browser: Browser, service: httpx.Client) -> None:
    url = str(service.base_url).rstrip("/")
    with visiting(browser, url, viewport=PHONE, has_touch=True, is_mobile=True) as visit:
        page = visit.page
        page.get_by_label("Photos").set_input_files([EXAMPLES / "left.png", EXAMPLES / "right.png"])
        page.get_by_label("Results").select_option("one")
        page.get_by_role("button", name="Flatten").click()
        expect(page.get_by_alt_text("Flat page")).to_be_visible()
        expect(page.locator("svg .patch.mark")).to_have_count(2)
        expect(page.get_by_role("list", name="Places of the photos").get_by_role("listitem")).to_have_count(2)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert violations(page) == []
        visit.check()


def test_a_refusal_says_what_to_do(visit: Visit, tmp_path: Path) -> None:
    """The browser's own message about the status is the only one in the console."""
    broken = tmp_path / "<img src=x onerror=alert(1)>.jpg"
    broken.write_bytes((EXAMPLES / "photo.jpg").read_bytes()[:4000])
    visit.page.get_by_label("Photos").set_input_files(broken)
    visit.page.get_by_role("button", name="Flatten").click()
    expect(visit.page.get_by_role("alert")).to_contain_text("undecodable-image")
    expect(visit.page.get_by_role("heading", name=broken.name)).to_be_visible()
    assert visit.page.locator("img[src=x]").count() == 0
    assert [one for one in visit.complaints if "status of 422" not in one] == []
