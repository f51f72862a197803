"""View "Flatten" where something is missing or late: keys, cameras, the network; and the camera itself."""

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import httpx
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, Route, expect

from tests.app.scripts import upload
from tests.end_to_end.accessibility import violations
from tests.end_to_end.browser import NEEDS_CHROMIUM
from tests.end_to_end.forked import ROOT
from tests.end_to_end.page_visit import PHONE, HeldRequests, address, chromium, visiting
from tests.end_to_end.processes import running

pytestmark = NEEDS_CHROMIUM
KEY = "the-right-key-of-a-test"
PHOTO = {"name": "photo.jpg", "mimeType": "image/jpeg", "buffer": upload("")}
"""What the scripted service takes for a photo."""
DESK_PX = (600, 760)


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a camera sees: a sheet that comes into view on a desk within 4 s, then lies still for 12 s."""
    photo = Image.open(ROOT / "examples" / "photo.jpg").convert("RGB")
    desk = photo.crop((0, 0, 60, photo.height)).resize(DESK_PX)
    sheet = photo.resize(DESK_PX)

    def frame(left: int) -> bytes:
        picture, buffer = desk.copy(), io.BytesIO()
        picture.paste(sheet, (left, 0))
        picture.save(buffer, "JPEG", quality=75)
        return buffer.getvalue()

    moving, still = [frame(-240 + 4 * (step // 2)) for step in range(120)], [frame(0), frame(1)]
    path = tmp_path_factory.mktemp("film") / "desk.mjpeg"
    path.write_bytes(b"".join(moving) + b"".join(still[number // 2 % 2] for number in range(360)))
    return path


@pytest.fixture(scope="module")
def browser(film: Path) -> Iterator[Browser]:
    """A browser whose camera shows the film."""
    camera = ("--use-fake-device-for-media-stream", f"--use-file-for-fake-video-capture={film}")
    with chromium(*camera) as started:
        yield started


@pytest.fixture(scope="module")
def scripted() -> Iterator[str]:
    """The address of a service that answers about a page of 80 x 60 pixels at once."""
    with running(workers=1) as service:
        yield service.url


def choose(page: Page) -> None:
    page.get_by_label("Photos").set_input_files(PHOTO)


def is_ready(page: Page, count: int = 1) -> None:
    expect(page.get_by_text(f"{count} of {count} page")).to_be_visible()


def test_the_camera_shows_the_outline_and_takes_one_photo_of_a_still_sheet(
    browser: Browser, service: httpx.Client
) -> None:
    with visiting(browser, address(service), viewport=PHONE, permissions=["camera"]) as visit:
        page = visit.page
        page.get_by_role("button", name="Camera").click()
        outline = page.locator(".camera-stage .outline")
        expect(outline).to_be_visible()
        first = outline.get_attribute("d")
        expect(page.get_by_text("1 photo", exact=True)).to_be_visible()
        assert outline.get_attribute("d") != first, "it follows the sheet"
        assert violations(page) == []
        for _ in range(3):
            page.wait_for_event("response", lambda one: one.url.endswith("/rectify") and one.status == 200)
        expect(page.locator(".camera-count")).to_have_text("1 photo")
        page.get_by_role("button", name="Close").click()
        is_ready(page)
        expect(page.get_by_alt_text("Flat page")).to_be_visible()
        visit.check()


SHUTTER = """async (views) => {
  const { Shutter } = await import("/static/scan/shutter.js");
  const shutter = new Shutter();
  const size = { width: 400, height: 400 };
  return views.map(([left, side, advice]) => {
    const right = left + side;
    const corners = side && [[left, 50], [right, 50], [right, 50 + side], [left, 50 + side]];
    const fires = shutter.see(corners || null, advice ?? [], size);
    if (fires) shutter.fired();
    return fires;
  });
}"""


def test_the_shutter_fires_once_for_a_page_that_is_still_and_sharp(browser: Browser, scripted: str) -> None:
    seen: dict[str, tuple[Sequence[Sequence[object]], list[int]]] = {
        "moving": ([[0, 300], [40, 300], [80, 300], [40, 300]], []),
        "still": ([[50, 300], [51, 300], [50, 300], [51, 300], [50, 300]], [2]),
        "another page": ([[50, 300]] * 4 + [[90, 300]] * 4, [2, 6]),
        "gone and back": ([[50, 300]] * 4 + [[0, 0]] + [[50, 300]] * 3, [2, 7]),
        "blurred": ([[50, 300, ["hold-still"]]] * 4 + [[50, 300, ["more-light"]]], [4]),
        "far away": ([[50, 80]] * 5, []),
    }
    with visiting(browser, scripted) as visit:
        for name, (views, fires) in seen.items():
            fired = visit.page.evaluate(SHUTTER, views)
            assert [number for number, one in enumerate(fired) if one] == fires, name


def test_without_a_camera_in_the_page_the_phones_own_takes_the_photo(browser: Browser, scripted: str) -> None:
    """As over plain HTTP, where a browser lets no page use a camera."""
    with visiting(browser, scripted, viewport=PHONE) as visit:
        page = visit.page
        page.add_init_script("delete Navigator.prototype.mediaDevices; delete Crypto.prototype.randomUUID")
        page.reload()
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Camera").click()
        assert chooser.value.element.get_attribute("capture") == "environment"
        chooser.value.set_files(PHOTO)
        is_ready(page)
        visit.check()


def test_a_camera_that_is_not_allowed_leaves_the_other_ways(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        page = visit.page
        page.add_init_script(
            "MediaDevices.prototype.getUserMedia = () => Promise.reject(new DOMException('', 'NotAllowedError'))"
        )
        page.reload()
        page.get_by_role("button", name="Camera").click()
        expect(page.get_by_text("Choose photos, or take them with the phone's own camera.")).to_be_visible()
        assert violations(page) == []
        page.get_by_label("Phone's own").set_input_files(PHOTO)
        is_ready(page)
        visit.check()


def test_a_wrong_key_says_so_and_the_photos_wait(browser: Browser) -> None:
    with running(workers=1, api_keys=KEY) as service, visiting(browser, service.url) as visit:
        page = visit.page
        choose(page)
        dialog = page.get_by_role("dialog", name="API key")
        expect(dialog).to_contain_text("The service needs a key.")
        assert violations(page) == []
        dialog.get_by_label("Key").fill("a-wrong-key-of-a-test")
        dialog.get_by_role("button", name="Use this key").click()
        expect(dialog).to_contain_text("does not know this key")
        expect(page.locator(".file-name")).to_have_text("photo.jpg")
        dialog.get_by_label("Key").fill(KEY)
        dialog.get_by_role("button", name="Use this key").click()
        is_ready(page)
        expect(page.get_by_text("The key is in use.")).to_be_visible()
        assert [one for one in visit.complaints if not re.search("status of 40[13]", one)] == []


@pytest.mark.parametrize("width", [320, 2560])
def test_all_is_in_the_window_and_uses_its_width(browser: Browser, scripted: str, width: int) -> None:
    with visiting(browser, scripted, viewport={"width": width, "height": 700}) as visit:
        page = visit.page
        choose(page)
        is_ready(page)
        page.get_by_label("Look").select_option("bw")
        expect(page.get_by_alt_text("Flat page")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        strip = page.get_by_role("list", name="Pages").bounding_box()
        assert strip is not None
        assert strip["width"] > 0.85 * width
        large = ROOT / "examples" / "photo.jpg"
        pixels = Image.open(large).width
        page.route("**/render", lambda route: route.fulfill(path=large))
        for name in ("View", "Corners", "Clear"):
            page.get_by_role("button", name=name).click()
            dialog = page.get_by_role("dialog")
            expect(dialog).to_be_visible()
            if name == "View":
                expect(page.locator(".whole-view img")).to_have_js_property("naturalWidth", pixels)
            box = dialog.bounding_box()
            assert box is not None
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
            assert dialog.evaluate("shown => shown.scrollWidth <= shown.clientWidth"), name
            if name == "Clear":
                expect(page.get_by_role("button", name="Cancel")).to_be_focused()
            page.keyboard.press("Escape")
        visit.check()


def test_a_change_is_shown_at_once_and_counts_when_it_is_done(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        page = visit.page
        choose(page)
        is_ready(page)
        held = HeldRequests(page, "**/render", "illumination")
        look = page.get_by_label("Look")
        look.select_option("bw")
        expect(page.get_by_text("0 of 1 page is ready.")).to_be_visible()
        expect(page.get_by_text("Changing ...")).to_be_visible()
        expect(look).to_have_value("bw")
        held.take().continue_()
        is_ready(page)
        expect(look).to_have_value("bw")
        look.select_option("gray")
        expect(page.get_by_text("0 of 1 page is ready.")).to_be_visible()
        held.take().fulfill(status=504, json={"code": "timed-out", "detail": "It took too long."})
        expect(page.get_by_text("This took too long. Try again.")).to_be_visible()
        expect(look).to_have_value("bw")
        is_ready(page)


def test_corners_of_no_page_are_refused_in_plain_words(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        page = visit.page
        choose(page)
        is_ready(page)
        page.get_by_label("Look").select_option("bw")
        expect(page.get_by_alt_text("Flat page")).to_be_visible()
        page.get_by_role("button", name="Corners").click()
        boxes = [page.get_by_role("button", name=f"Corner {number}").bounding_box() for number in (1, 3)]
        (x, y), (to_x, to_y) = [(box["x"] + 22, box["y"] + 22) for box in boxes if box is not None]
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 0.8 * (to_x - x), y + 0.8 * (to_y - y))
        page.mouse.up()
        said = "go round the page, clockwise from its top left."
        expect(page.get_by_role("dialog").get_by_role("status")).to_contain_text(said)
        page.get_by_role("button", name="Done").click()
        expect(page.get_by_role("alert")).to_contain_text(said)


def test_parts_of_a_file_have_their_names(browser: Browser, scripted: str) -> None:
    def double(route: Route) -> None:
        response = route.fetch()
        answer = response.json()
        route.fulfill(response=response, json={"pages": 2 * answer.get("pages", [answer])})

    shown: list[str] = []
    with visiting(browser, scripted) as visit:
        page = visit.page
        page.route("**/jobs/*/result", double)
        for kind, file, parts in (
            ("page", "letter.pdf", ["page 1", "page 2"]),
            ("spread", "letter.pdf", ["page 1", "page 2"]),
            ("spread", "book.jpg", ["left", "right"]),
        ):
            page.get_by_label("Each photo shows").select_option(kind)
            page.get_by_label("Photos").set_input_files({**PHOTO, "name": file})  # type: ignore[typeddict-item]
            shown += [f"{file}, {part}" for part in parts]
            expect(page.locator(".file-name")).to_have_text(shown)


def test_a_file_of_another_kind_says_which_can_be_read(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        page = visit.page
        photos = page.get_by_label("Photos")
        expect(photos).to_have_attribute("accept", re.compile(r"\.pdf"))
        photos.set_input_files({**PHOTO, "buffer": upload("unsupported-media-type")})  # type: ignore[typeddict-item]
        expect(page.get_by_role("alert")).to_contain_text("JPEG, PNG, WebP, TIFF, HEIC and PDF can.")
        again = page.get_by_role("button", name="Flatten")
        expect(again).to_have_accessible_description("Flatten tries again what is not flat yet.")
        assert violations(page) == []


def test_a_busy_service_is_asked_again(browser: Browser, scripted: str) -> None:
    busy = {"code": "busy", "detail": "The queue is full.", "status": 503}
    with visiting(browser, scripted) as visit:
        page = visit.page
        page.route(
            "**/rectify",
            lambda route: route.fulfill(status=503, headers={"Retry-After": "1"}, json=busy),
            times=1,
        )
        choose(page)
        expect(page.get_by_text("The service is busy. It goes on by itself.")).to_be_visible()
        is_ready(page)
        assert visit.count("POST /rectify") == 2
        assert [one for one in visit.complaints if "status of 503" not in one] == []


def test_without_a_network_the_page_shows_what_there_is(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted, service_workers="allow") as visit:
        page = visit.page
        page.evaluate("navigator.serviceWorker.ready")
        choose(page)
        is_ready(page)
        page.context.set_offline(True)
        page.reload()
        is_ready(page)
        expect(page.locator(".file-name")).to_have_text("photo.jpg")
        page.get_by_role("button", name="Download PDF").click()
        expect(page.get_by_text("There is no connection to the service.")).to_be_visible()
        assert visit.other_hosts == []


def test_the_pdf_is_shared_where_the_browser_can(browser: Browser, scripted: str) -> None:
    with visiting(browser, scripted) as visit:
        page = visit.page
        page.add_init_script(
            """let tries = 0;
            navigator.share = async ({ files: [file] }) => {
              if (!tries++) throw new DOMException("too late", "NotAllowedError");
              window.shared = `${file.name} ${file.type}`;
            }"""
        )
        page.reload()
        choose(page)
        is_ready(page)
        page.get_by_label("Name").fill("Letter")
        page.get_by_role("button", name="Share").click()
        expect(page.get_by_text("Press Share again.")).to_be_visible()
        page.get_by_role("button", name="Share").click()
        page.wait_for_function("window.shared")
        assert page.evaluate("window.shared") == "Letter.pdf application/pdf"
        assert visit.count("POST /pages/bind") == 1
        visit.check()
