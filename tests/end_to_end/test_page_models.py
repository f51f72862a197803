"""The page's view "Models" in a real browser, with the product behind it."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

from simulation.labelled_pages import letter_page, memo_page
from tests.end_to_end.accessibility import violations
from tests.end_to_end.browser import NEEDS_CHROMIUM
from tests.end_to_end.page_visit import PHONE, Visit, chromium, visiting
from tests.end_to_end.processes import PRODUCT, running

pytestmark = NEEDS_CHROMIUM


@pytest.fixture(scope="module")
def learned() -> Iterator[httpx.Client]:
    """A product that knows letters and memos, has feedback on one letter, and three unknown pages of one kind."""
    with running(PRODUCT, workers=1) as process, httpx.Client(base_url=process.url, timeout=120) as client:
        for name, maker in (("letter", letter_page), ("memo", memo_page)):
            for seed in range(2):
                page = maker(np.random.default_rng(seed), draw=False).document()
                client.post(f"/layout/models/{name}/samples", json=page).raise_for_status()
            client.post(f"/layout/models/{name}/initialize").raise_for_status()
        page = letter_page(np.random.default_rng(9), draw=False).document()
        labels = {zone["id"]: zone.pop("label") for zone in page["zones"]}
        feed(client, page, {"class": "letter", "labels": labels})
        for place in range(3):
            zones = [
                {
                    "id": f"a{row}",
                    "box": [100 + 5 * place, 100 + 200 * row, 800, 180 + 200 * row],
                    "text": f"Item {row}",
                }
                for row in range(6)
            ]
            feed(client, {"width": 1000, "height": 1400, "zones": zones}, {"class": None})
        yield client


def feed(client: httpx.Client, page: dict[str, Any], body: dict[str, Any]) -> None:
    result = client.post("/layout", data={"zones": json.dumps(page)}).json()["id"]
    client.post(f"/layout/results/{result}/feedback", json=body).raise_for_status()


@pytest.fixture
def visit(learned: httpx.Client) -> Iterator[Visit]:
    """A tab that shows the page."""
    with chromium() as browser, visiting(browser, str(learned.base_url).rstrip("/")) as opened:
        yield opened


def test_a_model_is_seen_rolled_back_exported_and_imported(visit: Visit, learned: httpx.Client) -> None:
    page = visit.page
    visit.open("Models")
    page.get_by_role("link", name="letter", exact=True).click()
    expect(page.get_by_role("img", name="Wrong labels of letter")).to_be_visible()
    page.get_by_role("button", name="Difference of 2").click()
    expect(page.get_by_role("heading", name="Version 2 compared with 1")).to_be_visible()
    page.get_by_role("button", name="Show", exact=True).first.click()
    expect(page.get_by_role("img", name="zones", exact=False).last).to_be_visible()
    page.get_by_role("button", name="Back to 1").click()
    page.get_by_role("button", name="Go back").click()
    expect(page.get_by_role("button", name="Difference of 3")).to_be_visible()
    with page.expect_download() as download:
        page.get_by_role("button", name="Export").click()
    saved = Path(download.value.path())
    assert json.loads(saved.read_text())["format"]
    page.get_by_label("Import a model").set_input_files(
        {"name": "letter-model.json", "mimeType": "application/json", "buffer": saved.read_bytes()}
    )
    expect(page.get_by_role("row", name="letter").first).to_contain_text("4")
    assert violations(page) == []
    visit.check()


def test_unknown_pages_become_a_class_with_labels_carried_over(visit: Visit, learned: httpx.Client) -> None:
    page = visit.page
    visit.open("Models")
    page.get_by_role("button", name="Look for proposals").click()
    page.get_by_role("button", name="Begin with the typical one").click()
    page.locator(".zone").first.focus()
    page.get_by_label("Label", exact=True).select_option(label="another name…")
    page.get_by_label("Another name").fill("first-item")
    page.get_by_label("Another name").press("Enter")
    page.get_by_label("Class", exact=True).select_option(label="another name…")
    page.get_by_label("Name of the new kind").fill("list")
    page.get_by_role("button", name="Confirm").click()
    expect(page.locator(".answer")).to_contain_text("3 samples were added to list")
    samples = learned.get("/layout/models/list/samples").json()["samples"]
    assert [sample["labels"].get("first-item") for sample in samples] == [1, 1, 1]
    assert learned.get("/layout/unknown-pages").json()["pages"] == []
    expect(page.get_by_text("No unknown documents")).to_be_visible()
    assert [one for one in visit.complaints if "404" not in one] == []


def test_on_a_phone(learned: httpx.Client) -> None:
    url = str(learned.base_url).rstrip("/")
    with (
        chromium() as browser,
        visiting(browser, url, viewport=PHONE, has_touch=True, is_mobile=True) as visit,
    ):
        visit.open("Models")
        visit.page.get_by_role("link", name="letter", exact=True).click()
        expect(visit.page.get_by_role("heading", name="Health")).to_be_visible()
        assert visit.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        visit.check()
