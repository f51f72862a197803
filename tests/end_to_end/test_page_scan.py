"""The page's view "Flatten" in a real browser, with the product behind it: from photos to one searchable PDF."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pikepdf
import pytest
from playwright.sync_api import Browser, Download, Locator, Page, Response, expect

from tests.end_to_end.accessibility import violations
from tests.end_to_end.browser import NEEDS_CHROMIUM
from tests.end_to_end.page_visit import PHONE, Visit, address, chromium, visiting

pytestmark = NEEDS_CHROMIUM
EXAMPLES = Path(__file__).parents[2] / "examples"
MARKUP = "<img src=x onerror=alert(1)>"
DESKTOP = {"width": 1366, "height": 768}


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """The browser of this module."""
    with chromium() as started:
        yield started


@pytest.fixture
def visit(browser: Browser, service: httpx.Client) -> Iterator[Visit]:
    """A tab that shows the page."""
    with visiting(browser, address(service), viewport=DESKTOP) as opened:
        yield opened


def check(visit: Visit) -> None:
    """No complaint and no other host. A tab that goes while a page is read costs the only worker: the browser notes the
    503, and the page asks again until there is one.
    """
    visit.complaints[:] = [one for one in visit.complaints if "status of 503" not in one]
    visit.check()


def choose(page: Page, *names: str) -> None:
    page.get_by_label("Photos").set_input_files([EXAMPLES / name for name in names])


def strip(page: Page) -> Locator:
    return page.get_by_role("list", name="Pages").locator(":scope > li")


def wait_until_ready(page: Page, count: int) -> None:
    expect(page.get_by_text(f"{count} of {count} page")).to_be_visible()


def names_of(page: Page) -> list[str]:
    return page.locator(".file-name").all_text_contents()


def bodies(page: Page, path: str) -> list[dict[str, object]]:
    """What the page sends from now on to a path, as JSON; the list grows."""
    found: list[dict[str, object]] = []

    def note(method: str, url: str, data: str | None) -> None:
        if method == "POST" and re.search(path, url) and data:
            found.append(json.loads(data))

    page.on("request", lambda request: note(request.method, request.url, request.post_data))
    return found


def is_change(response: Response, name: str) -> bool:
    """Whether it answers what a person says about a page."""
    return response.url.endswith("/render") and f'"{name}"' in (response.request.post_data or "")


def is_deletion(response: Response, deleted: set[str]) -> bool:
    """Whether it is one; its address is added to those that are `deleted`."""
    if response.request.method == "DELETE":
        deleted.add(response.url)
        return True
    return False


def words_of(download: Download) -> tuple[int, bool]:
    """Number of pages of a PDF, and whether each has a text layer."""
    with pikepdf.open(download.path()) as document:
        return len(document.pages), all("/Font" in page.get("/Resources", {}) for page in document.pages)


def test_the_whole_way_on_a_phone_by_touch(browser: Browser, service: httpx.Client) -> None:
    with visiting(browser, address(service), viewport=PHONE, has_touch=True, is_mobile=True) as visit:
        page = visit.page
        expect(page.get_by_role("button", name="Try an example")).to_be_visible()
        assert violations(page) == []
        choose(page, "photo.jpg", "page-2.jpg")
        wait_until_ready(page, 2)
        expect(page.get_by_alt_text("Flat page")).to_have_count(2)
        assert violations(page) == []
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        renders = bodies(page, "/render$")
        first = strip(page).first
        with page.expect_response(lambda one: is_change(one, "rotate")):
            first.get_by_role("button", name="Rotate").tap()
        with page.expect_response(lambda one: is_change(one, "illumination")):
            first.get_by_label("Look").select_option(label="Black and white")
        said = [{key: one[key] for key in ("rotate", "illumination") if key in one} for one in renders]
        assert [one for one in said if one] == [{"rotate": 90}, {"illumination": "bw"}]
        first.get_by_role("button", name="Move later").tap()
        assert names_of(page) == ["page-2.jpg", "photo.jpg"]
        page.get_by_label("Name").fill(f"Two pages {MARKUP}")
        with page.expect_download() as download:
            page.get_by_role("button", name="Download PDF").tap()
        assert download.value.suggested_filename == "Two pages img src=x onerror=alert(1).pdf"
        assert words_of(download.value) == (2, True)
        deleted: set[str] = set()
        # Photos are forgotten one by one, in no order: all is done when the second one is.
        with page.expect_response(lambda one: is_deletion(one, deleted) and len(deleted) == 2):
            strip(page).nth(1).get_by_role("button", name="Remove").tap()
            expect(strip(page)).to_have_count(1)
            page.get_by_role("button", name="Clear").tap()
            page.get_by_role("button", name="Delete all").tap()
        expect(page.get_by_role("button", name="Try an example")).to_be_visible()
        assert visit.count("POST /rectify") == 2, "no photo is sent twice"
        assert len([one for one in visit.sent if one.startswith("DELETE /pages/")]) == 2
        check(visit)


def test_corners_by_keyboard_alone_and_by_mouse(visit: Visit) -> None:
    page = visit.page
    choose(page, "photo.jpg")
    wait_until_ready(page, 1)
    renders = bodies(page, "/render$")
    page.get_by_role("button", name="Corners").focus()
    page.keyboard.press("Enter")
    first = page.get_by_role("button", name="Corner 1")
    expect(first).to_be_focused()
    before = first.bounding_box()
    for key in ("ArrowRight", "Shift+ArrowDown"):
        page.keyboard.press(key)
    after = first.bounding_box()
    assert before is not None
    assert after is not None
    assert after["x"] > before["x"]
    assert after["y"] > before["y"] + (after["x"] - before["x"])
    expect(page.get_by_text("The page is flat by these corners.")).to_be_visible()
    assert violations(page) == []
    given = [one["corners"] for one in renders if "corners" in one]
    assert len(given) == 1, "keys that follow each other are one word"
    box = page.get_by_role("button", name="Corner 3").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] - 6, box["y"] - 4)
    expect(page.locator(".loupe")).to_be_visible()
    with page.expect_response(lambda one: is_change(one, "corners")) as response:
        page.mouse.up()
    answer = response.value.json()
    moved = [one["corners"] for one in renders if "corners" in one][-1]
    assert isinstance(moved, list)
    assert [moved[index] != corner for index, corner in enumerate(given[0])] == [False, False, True, False]  # type: ignore[arg-type]
    # The view ends at the given corners: its mesh begins in the middle of a pixel of the small picture that is shown.
    seen = [answer["mesh"]["source"][0][0], answer["mesh"]["source"][-1][-1]]
    np.testing.assert_allclose(
        seen, [moved[0], moved[2]], atol=0.6 * answer["photo"]["width"] / answer["width"]
    )
    # Who gives up has the page as it was.
    with page.expect_request(lambda sent: "/render" in sent.url and '"auto"' in (sent.post_data or "")):
        page.keyboard.press("Escape")
    expect(page.get_by_role("button", name="Corner 1")).to_have_count(0)
    expect(page.get_by_role("button", name="Corners")).to_be_focused()
    assert visit.count("POST /rectify") == 1
    check(visit)


def test_a_reload_loses_nothing_and_sends_nothing_again(visit: Visit) -> None:
    page = visit.page
    page.get_by_label("Name").evaluate("field => field.value")  # the view is there
    choose(page, "page-2.jpg", "photo.jpg")
    expect(page.get_by_text(re.compile("Flattening"))).to_have_count(2)
    page.reload()
    wait_until_ready(page, 2)
    page.get_by_label("Name").fill("Kept")
    page.reload()
    expect(page.get_by_alt_text("Flat page")).to_have_count(2)
    expect(page.get_by_label("Name")).to_have_value("Kept")
    assert names_of(page) == ["page-2.jpg", "photo.jpg"]
    assert visit.count("POST /rectify") == 2
    check(visit)


def test_parts_of_a_large_page_are_joined_and_bound_with_the_others(visit: Visit) -> None:
    page = visit.page
    page.get_by_label("Each photo shows").select_option(label="a part of one large page")
    choose(page, "left.png")
    expect(page.get_by_text("Add the other photos")).to_be_visible()
    page.get_by_label("Add parts").set_input_files(EXAMPLES / "right.png")
    wait_until_ready(page, 1)
    expect(page.locator("svg .patch.mark")).to_have_count(2)
    expect(page.get_by_role("button", name="Corners")).to_be_hidden()
    assert violations(page) == []
    page.get_by_role("button", name="View").click()
    page.get_by_role("button", name="100 %").click()
    expect(page.get_by_role("region", name="Page")).to_be_visible()
    assert violations(page) == []
    page.get_by_role("button", name="Close").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Download PDF").click()
    assert words_of(download.value) == (1, True)
    assert visit.count("POST /mosaic") == 1
    check(visit)


def test_a_damaged_photo_says_what_to_do_and_the_others_go_on(visit: Visit, tmp_path: Path) -> None:
    """The browser's own message about the status is the only one in the console."""
    page = visit.page
    broken = tmp_path / f"{MARKUP}.jpg"
    broken.write_bytes((EXAMPLES / "photo.jpg").read_bytes()[:4000])
    page.get_by_label("Photos").set_input_files([broken, EXAMPLES / "page-2.jpg"])
    expect(page.get_by_role("alert")).to_contain_text("This file is damaged")
    expect(page.get_by_text("1 of 2 pages are ready. 1 needs you.")).to_be_visible()
    assert names_of(page)[0] == broken.name
    assert page.locator("img[src=x]").count() == 0
    assert violations(page) == []
    expect(page.get_by_role("button", name="Flatten")).to_be_visible()
    assert [one for one in visit.complaints if "status of 422" not in one] == []
