"""What tests do with the strip of the view "Flatten", of a service that answers by script."""

import re

import pytest
from playwright.sync_api import FileChooser, Page, Route, TimeoutError, expect

from tests.app.scripts import upload

FOCUSED = "document.activeElement.getAttribute('aria-label') || document.activeElement.textContent.trim()"


def photo(name: str, script: str = "") -> dict[str, object]:
    """What the scripted service takes for a photo."""
    return {"name": name, "mimeType": "image/jpeg", "buffer": upload(script)}


def choose(page: Page, *names: str) -> None:
    page.get_by_label("Photos").set_input_files([photo(name) for name in names])  # type: ignore[arg-type]


def is_ready(page: Page, count: int) -> None:
    expect(page.get_by_text(f"{count} of {count} page")).to_be_visible()


def names_of(page: Page) -> list[str]:
    return page.locator(".file-name").all_text_contents()


def names_of_parts(body: str, *names: str) -> list[str]:
    """Names of the parts of a form in their order, of those that are asked for."""
    return [name for name in re.findall(r'form-data; name="(\w+)"', body) if name in names]


def refuse_the_first(page: Page, path: str, problem: dict[str, object], *parts: str) -> list[list[str]]:
    """What the page sends to `path` from now on, as `names_of_parts`; the list grows. The first one is refused."""
    sent: list[list[str]] = []

    def note(route: Route) -> None:
        body = (route.request.post_data_buffer or b"").decode("latin1")
        sent.append(names_of_parts(body, *parts))
        if len(sent) == 1:
            route.fulfill(status=int(str(problem["status"])), json=problem)
        else:
            route.continue_()

    page.route(path, note)
    return sent


def read_nothing(page: Page) -> None:
    """As with pages that cannot be read: the service is asked for nothing about ids that a test has made."""
    problem = {"code": "timed-out", "detail": "It took too long.", "status": 504}
    page.route("**/render", lambda route: route.fulfill(status=504, json=problem))


def tab_to(page: Page, name: str, *, back: bool = False) -> None:
    """Go by the key Tab to the next control of this name; focus is on an element all the way."""
    for _ in range(40):
        page.keyboard.press("Shift+Tab" if back else "Tab")
        if page.evaluate(FOCUSED) == name:
            return
    pytest.fail(f"Tab does not come to {name}, but to {page.evaluate(FOCUSED)}")


def choose_by_keys(page: Page, *names: str) -> None:
    """Choose photos with the keyboard alone."""
    # Chromium is told to hand dialogs over while somebody listens, and a busy machine is told later than the key comes.
    page.on("filechooser", lambda chooser: None)
    expect(page.get_by_role("button", name="Try an example")).to_be_visible()
    tab_to(page, "Camera")
    page.keyboard.press("Tab")
    expect(page.locator("input[type=file]:focus")).to_have_count(1)
    open_by_space(page).set_files([photo(name) for name in names])  # type: ignore[arg-type]


def open_by_space(page: Page) -> FileChooser:
    """The file dialog of the focused control; asked twice at most: a busy machine's Chromium once left out a key."""
    try:
        with page.expect_file_chooser(timeout=30_000) as chooser:
            page.keyboard.press("Space")
    except TimeoutError:
        with page.expect_file_chooser() as chooser:
            page.keyboard.press("Space")
    return chooser.value


def is_lost(page: Page) -> bool:
    """Whether the focus is nowhere."""
    return bool(page.evaluate("document.activeElement === document.body"))
