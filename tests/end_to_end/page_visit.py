"""The page at `/` in headless Chromium, driven by Playwright; what the browser complains about is collected."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import httpx
from playwright.sync_api import Browser, Page, Route, expect, sync_playwright

from tests.end_to_end.browser import CHROMIUM, SECONDS

DESKTOP = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844}

WORKER_IS_OFF = "Service Worker registration blocked"
"""What Playwright says where a test has switched the service worker off."""


@dataclass(slots=True)
class Visit:
    """A tab with the page, and what went wrong in it so far."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    other_hosts: list[str] = field(default_factory=list)
    addresses: list[str] = field(default_factory=list)
    sent: list[str] = field(default_factory=list)
    """Method and path of each request to the service."""

    def open(self, view: str) -> None:
        """Go to a view by its link."""
        self.page.get_by_role("navigation", name="Views").get_by_role("link", name=view).click()
        expect(self.page.get_by_role("heading", name=view, level=1)).to_be_visible()

    def count(self, request: str) -> int:
        """How often a request was sent, as `POST /rectify`."""
        return self.sent.count(request)

    def check(self) -> None:
        """No error in the console, no violation of the policy, no request to another host."""
        assert self.complaints == [], self.complaints
        assert self.other_hosts == []


class HeldRequests:
    """Requests to `path` whose body has `part`, held until a test answers them; all others go on.

    A request reaches the test a moment after what the page shows of it, so `take` waits.
    """

    def __init__(self, page: Page, path: str, part: str) -> None:
        self._page = page
        self._part = part
        self._held: list[Route] = []
        page.route(path, self._hold)

    def _hold(self, route: Route) -> None:
        if self._part in (route.request.post_data or ""):
            self._held.append(route)
        else:
            route.continue_()

    def take(self) -> Route:
        """The oldest request that is held."""
        waited = 0
        while not self._held:
            assert waited < SECONDS * 1000, f"no request with {self._part} came"
            self._page.wait_for_timeout(20)
            waited += 20
        return self._held.pop(0)


def address(service: httpx.Client) -> str:
    """Where the page is. A tab that was closed while its page was read has cost the service its only worker."""
    while service.get("/health/ready").status_code != 200:
        time.sleep(0.1)
    return str(service.base_url).rstrip("/")


@contextmanager
def chromium(*options: str) -> Iterator[Browser]:
    """A headless Chromium."""
    expect.set_options(timeout=SECONDS * 1000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=[
                "--no-sandbox",
                "--disable-dev-shm-usage",
                "--disable-gpu",
                "--disable-background-networking",
                *options,
            ],
        )
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def visiting(browser: Browser, url: str, **options: object) -> Iterator[Visit]:
    """A new tab with storage of its own that shows the page of the service at `url`.

    The page's service worker is off unless `options` allow it: it would answer before a test does.
    """
    usual = {"viewport": DESKTOP, "accept_downloads": True, "service_workers": "block"}
    context = browser.new_context(**{**usual, **options})
    context.set_default_timeout(SECONDS * 1000)
    page = context.new_page()
    visit = Visit(page)
    host = urlsplit(url).netloc

    def note_request(method: str, address: str) -> None:
        visit.addresses.append(address)
        visit.sent.append(f"{method} {urlsplit(address).path}")
        parts = urlsplit(address)
        if parts.scheme in ("http", "https") and parts.netloc != host:
            visit.other_hosts.append(address)

    page.on("request", lambda request: note_request(request.method, request.url))
    page.on("pageerror", lambda error: visit.complaints.append(str(error)))
    page.on(
        "console",
        lambda message: (
            visit.complaints.append(message.text)
            if message.type in ("error", "warning") and WORKER_IS_OFF not in message.text
            else None
        ),
    )
    try:
        page.goto(url + "/")
        yield visit
    finally:
        context.close()
