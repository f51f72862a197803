"""The page's view "Layout" in a real browser, with the product behind it: recognized, corrected, confirmed, undone."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Locator, expect

from simulation.labelled_pages import letter_page, memo_page
from tests.end_to_end.accessibility import violations
from tests.end_to_end.browser import NEEDS_CHROMIUM
from tests.end_to_end.page_visit import PHONE, Visit, chromium, visiting
from tests.end_to_end.processes import PRODUCT, running

pytestmark = NEEDS_CHROMIUM
MARKUP = '<img src=x onerror="document.title=1">'


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """The browser of this module."""
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def learned() -> Iterator[httpx.Client]:
    """A product of this module's own that knows letters and memos."""
    with running(PRODUCT, workers=1) as process, httpx.Client(base_url=process.url, timeout=120) as client:
        for name, maker in (("letter", letter_page), ("memo", memo_page)):
            for seed in range(3):
                page = maker(np.random.default_rng(seed), draw=False).document()
                client.post(f"/layout/models/{name}/samples", json=page).raise_for_status()
            client.post(f"/layout/models/{name}/initialize").raise_for_status()
        yield client


@pytest.fixture
def visit(browser: Browser, learned: httpx.Client) -> Iterator[Visit]:
    """A tab that shows the page."""
    with visiting(browser, str(learned.base_url).rstrip("/")) as opened:
        yield opened


@pytest.fixture(scope="module")
def letter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A letter as an image file."""
    path = tmp_path_factory.mktemp("pages") / "letter.png"
    Image.fromarray(letter_page(np.random.default_rng(77)).image).save(path)
    return path


def recognize(visit: Visit, letter: Path) -> None:
    visit.open("Layout")
    visit.page.get_by_label("Page").set_input_files(letter)
    visit.page.get_by_role("button", name="Recognize", exact=True).click()
    expect(zone(visit, "receiver")).to_be_visible()


def zone(visit: Visit, label: str) -> Locator:
    return visit.page.get_by_role("button", name=label, exact=True).first


def version(client: httpx.Client, name: str) -> int:
    number: int = next(
        model["version"] for model in client.get("/layout/models").json()["models"] if model["name"] == name
    )
    return number


def sent_feedback(visit: Visit) -> dict[str, Any]:
    with visit.page.expect_request("**/feedback") as sent:
        visit.page.get_by_role("button", name="Confirm").click()
    body: dict[str, Any] = sent.value.post_data_json
    return body


def test_a_label_is_corrected_with_two_keys_and_taken_back(
    visit: Visit, learned: httpx.Client, letter: Path
) -> None:
    page, before = visit.page, version(learned, "letter")
    recognize(visit, letter)
    expect(page.get_by_label("Class", exact=True)).to_have_value("letter")
    zone(visit, "letterhead").focus()
    page.keyboard.press("Tab")  # the next zone in reading order
    wrong = page.evaluate("document.activeElement.getAttribute('aria-label')")
    page.keyboard.press("d")
    label = page.evaluate("document.activeElement.getAttribute('aria-label')")
    assert label == "date" != wrong
    page.keyboard.press("Control+Enter")
    expect(page.get_by_role("heading", name="What the models learned")).to_be_visible()
    expect(page.locator(".learned")).to_contain_text("is now version")
    assert version(learned, "letter") == before + 1
    page.get_by_role("button", name="Take the feedback back").click()
    expect(page.locator(".answer")).to_contain_text("Taken back")
    assert version(learned, "letter") == before + 2
    assert violations(page) == []
    visit.check()


def test_boxes_are_moved_split_merged_drawn_and_deleted(visit: Visit, letter: Path) -> None:
    page = visit.page
    recognize(visit, letter)
    count = page.locator(".zone").count()
    zone(visit, "receiver").click()
    left = float(page.get_by_label("Left", exact=True).input_value())
    box = zone(visit, "receiver").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 30, box["y"] + box["height"] / 2, steps=3)
    page.mouse.up()
    assert float(page.get_by_label("Left", exact=True).input_value()) > left + 10
    page.get_by_role("button", name="Undo").click()
    assert float(page.get_by_label("Left", exact=True).input_value()) == pytest.approx(left)

    zone(visit, "receiver").focus()
    page.keyboard.press("Alt+ArrowRight")
    assert float(page.get_by_label("Left", exact=True).input_value()) == pytest.approx(left + 4)
    page.get_by_role("button", name="Split", exact=True).click()
    expect(page.locator(".zone")).to_have_count(count + 1)
    page.get_by_role("button", name="Earlier").click()
    page.get_by_role("button", name="Merge with next").click()
    expect(page.locator(".zone")).to_have_count(count)

    page.get_by_role("button", name="Draw zone").click()
    page.locator(".viewer").scroll_into_view_if_needed()
    view = page.locator(".viewer").bounding_box()
    assert view is not None
    x, y = view["x"] + view["width"] / 2, view["y"] + view["height"] * 0.6
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y + 40, steps=3)
    page.mouse.up()
    expect(page.locator(".zone")).to_have_count(count + 1)
    expect(page.get_by_label("Label", exact=True)).to_have_value("")
    page.get_by_label("Label", exact=True).select_option("cc")
    page.get_by_label("Text", exact=True).fill("CC: The archive")
    zone(visit, "date").focus()
    page.keyboard.press("Delete")
    expect(page.locator(".zone")).to_have_count(count)

    zones = sent_feedback(visit)["zones"]
    assert len(zones) == count
    assert [one["label"] for one in zones if one.get("text") == "CC: The archive"] == ["cc"]
    expect(page.get_by_role("heading", name="What the models learned")).to_be_visible()
    visit.check()


def test_a_new_class_begins_with_the_page(visit: Visit, learned: httpx.Client, letter: Path) -> None:
    page = visit.page
    recognize(visit, letter)
    page.get_by_label("Class", exact=True).select_option(label="another name…")
    page.get_by_label("Name of the new kind").fill("circular")
    page.get_by_role("button", name="Confirm").click()
    expect(page.locator(".answer")).to_contain_text("circular is new")
    expect(page.get_by_label("Class", exact=True)).to_have_value("circular")
    [made] = learned.get("/layout/results", params={"limit": 1}).json()["results"]
    assert (made["state"], made["class"]) == ("corrected", "circular")
    learned.delete("/layout/models/circular").raise_for_status()
    visit.check()


def test_a_page_of_no_class_is_given_one(visit: Visit, learned: httpx.Client) -> None:
    """The view asks for the class; what was said is then shown, in the list too."""
    zones = [
        {"id": f"z{n}", "box": [100 + 9 * n, 1300 - 90 * n, 180 + 40 * n, 1380 - 90 * n], "text": "7"}
        for n in range(14)
    ]
    found = learned.post("/layout", data={"zones": json.dumps(page_of(zones))}).json()
    assert found["class"] is None
    page = visit.page
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    page.goto(f"{learned.base_url}#layout/{found['id']}")
    page.reload()
    class_ = page.get_by_label("Class", exact=True)
    expect(class_.locator("option:checked")).to_have_text("choose its class…")
    zone_of(visit, 0).click()
    page.get_by_label("Label", exact=True).select_option(label="another name…")
    page.get_by_label("Another name", exact=True).fill("subject")
    page.get_by_label("Another name", exact=True).press("Enter")
    page.get_by_role("button", name="Confirm").click()
    expect(page.get_by_role("alert")).to_contain_text("Which class")
    class_.select_option(label="another name…")
    page.get_by_label("Name of the new kind").fill(".not a name")
    page.get_by_role("button", name="Confirm").click()
    expect(page.get_by_role("alert")).to_contain_text("needs a name")
    assert sent == [], "nothing is done before the class is known"
    before = version(learned, "memo")
    class_.select_option("memo")
    page.get_by_role("button", name="Confirm").click()
    expect(page.locator(".learned")).to_contain_text("none was found, memo is right")
    expect(page.get_by_text("memo, 100 % (found: no class")).to_be_visible()
    assert version(learned, "memo") == before + 1
    shown = learned.get(f"/layout/results/{found['id']}").json()
    assert (shown["class"]["name"], shown["found"]["class"]) == ("memo", None)
    assert sum(one["label"] == "subject" for one in shown["zones"]) >= 1
    listed = learned.get("/layout/results", params={"state": "corrected"}).json()["results"]
    assert (found["id"], "memo") in [(one["id"], one["class"]) for one in listed]
    page.get_by_role("button", name="Take the feedback back").click()
    expect(page.locator(".answer")).to_contain_text("Taken back")
    expect(class_.locator("option:checked")).to_have_text("choose its class…")
    class_.select_option("")
    page.get_by_role("button", name="Confirm").click()
    expect(page.locator(".learned")).to_contain_text("nothing was learned")
    assert violations(page) == []
    visit.check()


def zone_of(visit: Visit, place: int) -> Locator:
    return visit.page.locator(".zone").nth(place)


def page_of(zones: list[dict[str, Any]]) -> dict[str, Any]:
    return {"width": 1000, "height": 1400, "zones": zones}


def test_markup_in_labels_and_texts_is_text(visit: Visit, learned: httpx.Client) -> None:
    """A label, a text and an id full of HTML are shown as they are; no script runs and nothing is requested."""
    zones = [
        {"id": MARKUP, "box": [100, 100, 600, 200], "label": MARKUP, "text": MARKUP},
        {"id": "b", "box": [100, 300, 600, 900], "label": "<script>alert(1)</script>", "text": "</textarea>"},
    ]
    learned.post("/layout/models/hostile/samples", json=page_of(zones)).raise_for_status()
    learned.post("/layout/models/hostile/initialize").raise_for_status()
    answer = learned.post("/layout", data={"zones": json.dumps(page_of(zones)), "models": "hostile"}).json()
    visit.page.goto(f"{learned.base_url}#layout/{answer['id']}")
    visit.page.reload()
    zone(visit, MARKUP).click()
    expect(visit.page.get_by_label("Text", exact=True)).to_have_value(MARKUP)
    sent_feedback(visit)
    expect(visit.page.get_by_role("heading", name="What the models learned")).to_be_visible()
    assert visit.page.title() == "Layout - Document rectification"
    assert visit.page.locator("img[src=x]").count() == 0
    learned.delete("/layout/models/hostile").raise_for_status()
    assert [
        one for one in visit.complaints if "404" not in one
    ] == []  # no picture is kept of zones that were sent
    assert visit.other_hosts == []


def test_a_page_of_100_zones_is_shown_soon(visit: Visit, learned: httpx.Client) -> None:
    zones = [
        {
            "id": f"z{index}",
            "box": [
                100 * (index % 10),
                140 * (index // 10),
                100 * (index % 10) + 80,
                140 * (index // 10) + 90,
            ],
        }
        for index in range(100)
    ]
    answer = learned.post("/layout", data={"zones": json.dumps(page_of(zones))}).json()
    visit.open("Layout")
    began = time.monotonic()
    visit.page.evaluate("id => { location.hash = `layout/${id}`; }", answer["id"])
    expect(visit.page.locator(".zone")).to_have_count(100)
    assert time.monotonic() - began < 10


def test_a_phone_shows_the_whole_view(browser: Browser, learned: httpx.Client, letter: Path) -> None:
    url = str(learned.base_url).rstrip("/")
    with visiting(browser, url, viewport=PHONE, has_touch=True, is_mobile=True, color_scheme="dark") as visit:
        recognize(visit, letter)
        zone(visit, "receiver").tap()
        visit.page.get_by_label("Label", exact=True).select_option("cc")
        expect(visit.page.get_by_label("Label", exact=True)).to_have_value("cc")
        assert visit.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert violations(visit.page) == []
        visit.check()
