"""View "Flatten" by its whole ways: with the keyboard alone, over TLS, in two tabs; and files of several pages."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest
from playwright.sync_api import Browser, Route, expect

from tests.app.scripted_kept_pages import MARKUP_READ
from tests.end_to_end.accessibility import violations
from tests.end_to_end.browser import NEEDS_CHROMIUM
from tests.end_to_end.forked import ROOT
from tests.end_to_end.page_visit import HeldRequests, chromium, visiting
from tests.end_to_end.processes import running
from tests.end_to_end.scan_strip import (
    choose,
    choose_by_keys,
    is_lost,
    is_ready,
    names_of,
    names_of_parts,
    photo,
    read_nothing,
    refuse_the_first,
    tab_to,
)

pytestmark = NEEDS_CHROMIUM
DESKTOP = {"width": 1366, "height": 768}
MARKUP = "<img src=x onerror=\"document.title='ran'\">"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser with a camera, which trusts the service's own certificate: else it would register no service worker."""
    with chromium("--use-fake-device-for-media-stream", "--ignore-certificate-errors") as started:
        yield started


@pytest.fixture(scope="module")
def scripted() -> Iterator[str]:
    """The address of a service that answers about a page of 80 x 60 pixels at once."""
    with running(workers=1) as service:
        yield service.url


def qr_text(printed: str) -> str:
    """The address in a QR code of half blocks, of which each shows two light or dark modules."""
    rows = [line for line in printed.splitlines() if line and set(line) <= set("\u2588\u2580\u2584 ")]
    upper = np.array([[sign in "\u2588\u2580" for sign in row] for row in rows])
    lower = np.array([[sign in "\u2588\u2584" for sign in row] for row in rows])
    modules = np.stack([upper, lower], axis=1).reshape(2 * len(rows), -1)
    picture = np.kron(modules, np.ones((8, 8))).astype(np.uint8) * 255
    return cv2.QRCodeDetector().detectAndDecode(picture)[0]


def test_the_whole_way_by_keyboard_alone(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted, viewport=DESKTOP) as visit:
        page = visit.page
        sent: list[dict[str, object]] = []
        page.on(
            "request",
            lambda one: (
                sent.append(json.loads(one.post_data or "{}")) if one.url.endswith("/render") else None
            ),
        )
        choose_by_keys(page, "a.jpg", "b.jpg", "c.jpg")
        is_ready(page, 3)
        assert not is_lost(page)
        tab_to(page, "Rotate")
        page.keyboard.press("Enter")
        expect(page.get_by_alt_text("Flat page").first).to_be_visible()
        tab_to(page, "Corners", back=True)
        page.keyboard.press("Enter")
        expect(page.get_by_role("button", name="Corner 1")).to_be_focused()
        tab_to(page, "Corner 3")
        page.keyboard.press("ArrowLeft")
        expect(page.get_by_text("The page is flat by these corners.")).to_be_visible()
        tab_to(page, "Done")
        page.keyboard.press("Enter")
        expect(page.get_by_role("button", name="Corners").first).to_be_focused()
        tab_to(page, "Move later")
        page.keyboard.press("Enter")
        page.keyboard.press("Enter")
        expect(page.get_by_role("button", name="Move earlier").nth(2)).to_be_focused()
        assert names_of(page) == ["b.jpg", "c.jpg", "a.jpg"]
        for _ in range(40):
            page.keyboard.press("Tab")
            if page.get_by_label("Name").evaluate("field => field === document.activeElement"):
                break
        page.keyboard.type("Letter")
        tab_to(page, "Download PDF")
        with page.expect_download() as download:
            page.keyboard.press("Enter")
        assert download.value.suggested_filename == "Letter.pdf"
        assert not is_lost(page)
        assert any("corners" in one for one in sent)
        assert any(one.get("rotate") for one in sent)
        visit.check()


def test_focus_is_not_lost_with_what_goes(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted, viewport=DESKTOP) as visit:
        page = visit.page
        choose_by_keys(page, "a.jpg", "b.jpg", "c.jpg")
        is_ready(page, 3)
        page.get_by_role("button", name="Move later").nth(1).focus()
        tab_to(page, "Remove")
        page.keyboard.press("Enter")
        expect(page.get_by_role("heading", name="Page 2")).to_be_focused()
        assert names_of(page) == ["a.jpg", "c.jpg"]
        tab_to(page, "Rotate")
        page.keyboard.press("Enter")
        expect(page.get_by_alt_text("Flat page").nth(1)).to_be_visible()
        tab_to(page, "View")
        page.keyboard.press("Enter")
        expect(page.get_by_role("dialog", name="Page")).to_be_visible()
        page.keyboard.press("Escape")
        expect(page.get_by_role("button", name="View").nth(1)).to_be_focused()
        tab_to(page, "Clear")
        page.keyboard.press("Enter")
        expect(page.get_by_role("button", name="Cancel")).to_be_focused()
        assert violations(page) == []
        page.keyboard.press("Escape")
        expect(page.get_by_role("button", name="Clear")).to_be_focused()
        page.keyboard.press("Enter")
        tab_to(page, "Delete all")
        page.keyboard.press("Enter")
        expect(page.get_by_role("button", name="Camera")).to_be_focused()
        visit.check()


def test_the_whole_way_over_tls_with_a_certificate_of_its_own(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "own" / "certificate.pem"
    command = [sys.executable, "-m", "app.http.own_certificate", str(file)]
    said = [
        subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout for _ in range(2)
    ]
    assert said[0] == said[1]
    assert [qr_text(said[0])] == re.findall(r"https://\S+/", said[0])
    assert file.stat().st_mode & 0o077 == 0
    with running(workers=1, tls_certificate=file) as service:
        url = service.url.replace("http:", "https:")
        assert httpx.get(url + "/health/live", verify=str(file)).status_code == 200
        with visiting(browser, url, service_workers="allow", permissions=["camera"]) as visit:
            page = visit.page
            assert page.evaluate("isSecureContext")
            assert page.evaluate("navigator.serviceWorker.ready.then(({ active }) => Boolean(active))")
            page.get_by_role("button", name="Camera").click()
            expect(page.get_by_role("button", name="Take photo")).to_be_visible()
            page.get_by_role("button", name="Close").click()
            choose(page, "a.jpg", "b.jpg")
            is_ready(page, 2)
            page.get_by_role("button", name="Rotate").first.click()
            page.get_by_role("button", name="Move later").first.click()
            assert names_of(page) == ["b.jpg", "a.jpg"]
            page.get_by_label("Name").fill("Letter")
            with page.expect_download() as download:
                page.get_by_role("button", name="Download PDF").click()
            assert download.value.suggested_filename == "Letter.pdf"
            visit.check()


def test_a_turn_is_shown_before_its_answer(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        page = visit.page
        choose(page, "a.jpg")
        is_ready(page, 1)
        page.get_by_label("Look").select_option("bw")
        expect(page.get_by_alt_text("Flat page")).to_be_visible()
        held = HeldRequests(page, "**/render", "rotate")
        sheet, rotate = page.locator(".sheet"), page.get_by_role("button", name="Rotate")
        rotate.click()
        expect(sheet).to_have_attribute("style", re.compile(r"rotate\(90deg\) scale\(0\.75\)"))
        rotate.click()
        expect(sheet).to_have_attribute("style", re.compile(r"rotate\(180deg\)"))
        assert violations(page) == []
        held.take().continue_()
        expect(sheet).to_have_attribute("style", re.compile(r"rotate\(90deg\)"))
        held.take().fulfill(status=504, json={"code": "timed-out", "detail": "It took too long."})
        expect(sheet).not_to_have_attribute("style", re.compile("rotate"))
        expect(page.get_by_text("This took too long. Try again.")).to_be_visible()


def test_a_page_of_a_file_that_fails_is_told_by_its_number_and_tried_again(
    browser: Browser, scripted: str
) -> None:
    problem = {"code": "timed-out", "detail": "It took too long.", "status": 504}

    def three(route: Route) -> None:
        response = route.fetch()
        answer = response.json()
        answer = answer.get("pages", [answer])[0]
        pages = [{**answer, "page_id": f"{answer['page_id']}{number}"} for number in range(3)]
        second = {"problem": problem} if len(routes) == 0 else pages[1]
        routes.append(route)
        route.fulfill(response=response, json={"pages": [pages[0], second, pages[2]]})

    routes: list[Route] = []
    with visiting(browser, scripted) as visit:
        page = visit.page
        read_nothing(page)
        page.route("**/jobs/*/result", three)
        choose(page, "letter.pdf")
        parts = [f"letter.pdf, page {number}" for number in (1, 2, 3)]
        expect(page.locator(".file-name")).to_have_text(parts)
        expect(page.get_by_text("2 of 3 pages are ready. 1 needs you.")).to_be_visible()
        failed = page.get_by_role("listitem", name="Page 2")
        expect(failed.get_by_role("alert")).to_have_text("This took too long. Try again.")
        assert violations(page) == []
        page.reload()
        failed.get_by_role("button", name="Try again").press("Enter")
        expect(page.get_by_role("heading", name="Page 2")).to_be_focused()
        is_ready(page, 3)
        expect(page.locator(".file-name")).to_have_text(parts)
        forgotten = [one for one in visit.sent if one.startswith("DELETE /pages/")]
        assert len(forgotten) == 2, "parts that are there already are not kept twice"


def test_a_page_becomes_both_pages_of_a_book(browser: Browser, scripted: str) -> None:
    def both(route: Route) -> None:
        response = route.fetch()
        answer = response.json()
        answer = answer.get("pages", [answer])[0]
        pages = [{**answer, "page_id": f"{answer['page_id']}{side}"} for side in "ab"]
        route.fulfill(response=response, json={"pages": pages})

    with visiting(browser, scripted) as visit:
        page = visit.page
        read_nothing(page)
        choose(page, "book.jpg", "letter.jpg")
        is_ready(page, 2)
        page.route("**/jobs/*/result", both)
        with page.expect_request("**/rectify") as request:
            page.get_by_role("button", name="Both pages").first.press("Enter")
        sent = (request.value.post_data_buffer or b"").decode("latin1")
        assert re.search(r'name="pages"\r\n\r\nboth', sent)
        assert names_of_parts(sent, "kept_page", "image") == ["kept_page"], "its photo is not sent again"
        is_ready(page, 3)
        expect(page.locator(".file-name")).to_have_text(["book.jpg, left", "book.jpg, right", "letter.jpg"])
        assert not is_lost(page)
        for name in ("Corners", "Rotate", "Remove"):
            assert page.get_by_role("button", name=name).count() == 3
        assert len([one for one in visit.sent if one.startswith("DELETE /pages/")]) == 1, "the page before"


def test_pages_of_the_strip_are_joined_without_sending_their_photos(browser: Browser, scripted: str) -> None:
    """They stay until the joined page is there; the photos that are added to it later are sent, no others."""
    with visiting(browser, scripted) as visit:
        page = visit.page
        read_nothing(page)
        choose(page, "left.jpg", "right.jpg", "letter.jpg")
        is_ready(page, 3)
        refusal = {"code": "not-overlapping", "detail": "-", "status": 422}
        mosaics = refuse_the_first(page, "**/mosaic", refusal, "kept_page", "upload", "images")
        page.get_by_role("button", name="Join with next").first.click()
        joined = page.get_by_role("listitem", name="Page 3")
        expect(joined.get_by_role("alert")).to_contain_text("do not overlap enough")
        expect(joined.get_by_role("heading", name="Page 3")).to_be_focused()
        assert names_of(page) == ["left.jpg", "right.jpg", "One page of 2 photos", "letter.jpg"]
        assert violations(page) == []
        joined.get_by_role("button", name="Try again").click()
        is_ready(page, 2)
        assert names_of(page) == ["One page of 2 photos", "letter.jpg"]
        first = page.get_by_role("listitem", name="Page 1")
        first.get_by_label("Add parts").set_input_files([photo("middle.jpg")])  # type: ignore[list-item]
        expect(page.get_by_text("One page of 3 photos")).to_be_visible()
        is_ready(page, 2)
        assert mosaics == [["kept_page"] * 2] * 2 + [["kept_page"] * 2 + ["upload"]]
        assert visit.count("POST /rectify") == 3
        assert not [one for one in visit.sent if one.startswith("DELETE /pages/")], "kept as long as the page"
        with page.expect_response(lambda one: one.request.method == "DELETE"):
            first.get_by_role("button", name="Remove").click()
        is_ready(page, 1)
        assert [one for one in visit.complaints if not re.search("status of (422|504)", one)] == []


def test_each_photo_of_a_joined_page_is_sent_once(browser: Browser, scripted: str) -> None:
    """Also where the network breaks, the service refuses the page, or it gets parts later; uploads go with the page."""
    with visiting(browser, scripted) as visit:
        page = visit.page
        read_nothing(page)
        refusal = {"code": "not-overlapping", "detail": "-", "status": 422}
        mosaics = refuse_the_first(page, "**/mosaic", refusal, "upload", "images")
        breaks = iter([True])
        page.route("**/uploads/*", lambda route: route.abort() if next(breaks, False) else route.continue_())
        page.get_by_label("Each photo shows").select_option(label="a part of one large page")
        choose(page, "left.jpg", "right.jpg")
        expect(page.get_by_role("alert")).to_contain_text("no connection to the service")
        page.evaluate("dispatchEvent(new Event('online'))")
        expect(page.get_by_role("alert")).to_contain_text("do not overlap enough")
        page.get_by_role("button", name="Try again").click()
        is_ready(page, 1)
        page.get_by_label("Add parts").set_input_files([photo("middle.jpg")])  # type: ignore[list-item]
        expect(page.get_by_text("One page of 3 photos")).to_be_visible()
        is_ready(page, 1)
        assert mosaics == [["upload"] * 2] * 2 + [["upload"] * 3]
        pieces = [one for one in visit.sent if one.startswith("PATCH /uploads/")]
        assert visit.count("POST /uploads") == 3
        assert len(pieces) == 3 + 1, "the first one was sent again"
        with page.expect_response(
            lambda one: one.request.method == "DELETE" and pieces[-1].endswith(one.url[-26:])
        ):
            page.get_by_role("button", name="Remove").click()
        assert {one.replace("PATCH", "DELETE") for one in pieces} <= set(visit.sent)


def test_a_joined_page_is_sent_as_files_where_no_upload_is_kept(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        page = visit.page
        read_nothing(page)
        full = {"code": "busy", "detail": "-", "status": 503}
        page.route("**/uploads", lambda route: route.fulfill(status=503, json=full))
        page.get_by_label("Each photo shows").select_option(label="a part of one large page")
        with page.expect_request("**/mosaic") as request:
            choose(page, "left.jpg", "right.jpg")
        is_ready(page, 1)
        sent = (request.value.post_data_buffer or b"").decode("latin1")
        assert names_of_parts(sent, "upload", "images") == ["images"] * 2


def test_photos_that_the_service_no_longer_keeps_are_sent(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        page = visit.page
        choose(page, "book.jpg")
        is_ready(page, 1)
        refusal = {"code": "not-found", "detail": "It is gone.", "status": 404}
        sent = refuse_the_first(page, "**/rectify", refusal, "kept_page", "image")
        with page.expect_response(lambda one: one.url.endswith("/result")):
            page.get_by_role("button", name="Both pages").click()
        is_ready(page, 1)
        assert sent == [["kept_page"], ["image"]]
        assert [one for one in visit.complaints if "status of 404" not in one] == []


def test_a_second_tab_says_so_and_takes_the_pages_over(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        first = visit.page
        choose(first, "a.jpg")
        is_ready(first, 1)
        second = first.context.new_page()
        second.goto(scripted)
        elsewhere = "Your pages are open in another tab."
        expect(second.get_by_text(elsewhere)).to_be_visible()
        expect(second.get_by_label("Photos")).to_be_hidden()
        assert violations(second) == []
        second.get_by_role("button", name="Use them here").click()
        is_ready(second, 1)
        expect(second.get_by_role("button", name="Camera")).to_be_focused()
        expect(first.get_by_text(elsewhere)).to_be_visible()
        choose(second, "b.jpg")
        is_ready(second, 2)
        second.close()
        is_ready(first, 2)
        assert names_of(first) == ["a.jpg", "b.jpg"]
        expect(first.get_by_text(elsewhere)).to_be_hidden()
        visit.check()


def test_markup_in_names_and_texts_is_text(browser: Browser, scripted: str, tmp_path: Path) -> None:
    """The service reads `MARKUP_READ` on each page: in answers, in the text that is saved, and in the PDF."""
    with visiting(browser, scripted) as visit:
        page = visit.page
        with page.expect_response("**/render") as read:
            choose(page, f"{MARKUP}.jpg")
        assert [word["text"] for word in read.value.json()["text"]["words"]] == [MARKUP_READ]
        is_ready(page, 1)
        page.get_by_label("Name").fill(MARKUP)
        with page.expect_download() as saved:
            page.get_by_role("button", name="Text", exact=True).click()
        text = tmp_path / saved.value.suggested_filename
        saved.value.save_as(text)
        assert text.read_text(encoding="utf-8").strip() == MARKUP_READ
        shown = page.context.new_page()
        shown.goto(text.as_uri())
        expect(shown.get_by_text(MARKUP_READ)).to_be_visible()
        assert shown.locator("img").count() == 0
        shown.close()
        with page.expect_download():
            page.get_by_role("button", name="Download PDF").click()
        problem = {"code": "of-a-test", "detail": MARKUP, "status": 422}
        page.route("**/pages/bind", lambda route: route.fulfill(status=422, json=problem))
        page.get_by_role("button", name="Text", exact=True).click()
        expect(page.get_by_role("alert")).to_have_text(MARKUP)
        assert names_of(page) == [f"{MARKUP}.jpg"]
        page.reload()
        is_ready(page, 1)
        assert names_of(page) == [f"{MARKUP}.jpg"]
        assert page.locator("img[src=x]").count() == 0
        assert page.title() != "ran"
        assert [one for one in visit.complaints if "status of 422" not in one] == []
