"""A real browser: the documentation without a network, and an app on another origin."""

import base64
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import Queue
from typing import Any
from urllib.parse import urlsplit

import httpx
from playwright.sync_api import expect

from tests.app.scripts import upload
from tests.end_to_end.browser import NEEDS_CHROMIUM, SECONDS, browsing
from tests.end_to_end.forked import ROOT
from tests.end_to_end.page_visit import DESKTOP, chromium
from tests.end_to_end.processes import running

pytestmark = NEEDS_CHROMIUM

APP = """<!doctype html><title>app</title><script type="module">
const service = "{service}", key = "{key}", told = {{}};
try {{
  const form = new FormData();
  form.append("image", new Blob([Uint8Array.from(atob("{photo}"), (c) => c.charCodeAt(0))]), "photo.jpg");
  const headers = {{ Authorization: `Bearer ${{key}}`, "X-Request-ID": "from-the-app" }};
  const page = await fetch(service + "/rectify", {{ method: "POST", body: form, headers }});
  told.status = page.status;
  told.body = await page.text();
  for (const name of ["Document-Kind", "X-Request-ID", "Content-Disposition"]) told[name] = page.headers.get(name);

  headers.Prefer = "respond-async";
  const accepted = await fetch(service + "/rectify", {{ method: "POST", body: form, headers }});
  told.Location = accepted.headers.get("Location");
  const {{ links }} = await accepted.json();
  const made = await fetch(service + "/tokens", {{ method: "POST", headers: {{ "X-API-Key": key }} }});
  const {{ token }} = await made.json();
  const events = new EventSource(`${{service}}${{links.events}}?token=${{token}}`);
  told.state = await new Promise((resolve, reject) => {{
    events.onerror = reject;
    events.onmessage = (event) => {{
      const status = JSON.parse(event.data);
      if (status.ended) {{ events.close(); resolve(status.state); }}
    }};
  }});
  const bad = await fetch(service + "/rectify?format=gif", {{ method: "POST", body: form, headers }});
  told.code = (await bad.json()).code;
}} catch (error) {{
  told.error = String(error);
}}
await fetch("/report", {{ method: "POST", body: JSON.stringify(told) }});
</script>"""


class AppServer:
    """A server of a browser app, on an origin of its own."""

    def __init__(self) -> None:
        self.html = ""
        self.reports: Queue[dict[str, Any]] = Queue()
        app = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self._answer(app.html.encode())

            def do_POST(self) -> None:
                app.reports.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
                self._answer(b"")

            def _answer(self, body: bytes) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *arguments: object) -> None:
                """No log."""

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.origin = f"http://127.0.0.1:{self.server.server_port}"


@contextmanager
def app_server() -> Iterator[AppServer]:
    """The server of the app; it serves inside of the block."""
    app = AppServer()
    thread = threading.Thread(target=app.server.serve_forever)
    thread.start()
    try:
        yield app
    finally:
        app.server.shutdown()
        thread.join()
        app.server.server_close()


def report_of(*, is_allowed: bool) -> dict[str, Any]:
    """What the app finds at a service that allows its origin, or another one only."""
    with app_server() as app:
        allowed = app.origin if is_allowed else "https://app.example.org"
        with running(workers=1, api_keys="secret", cors_origins=allowed) as process:
            photo = base64.b64encode(upload("")).decode()
            app.html = APP.format(service=process.url, key="secret", photo=photo)
            with browsing(app.origin):
                return app.reports.get(timeout=SECONDS)


def test_an_app_on_another_origin_uploads_reads_headers_and_hears_events() -> None:
    found = report_of(is_allowed=True)
    assert "error" not in found
    assert (found["status"], found["body"], found["Document-Kind"]) == (200, "flat as jpeg", "planar")
    assert found["X-Request-ID"] == "from-the-app"
    assert found["Content-Disposition"] == 'inline; filename="photo-flat.jpg"'
    assert found["Location"].startswith("/jobs/")
    assert (found["state"], found["code"]) == ("succeeded", "invalid-option")


def test_an_app_on_an_origin_that_is_not_named_gets_nothing() -> None:
    found = report_of(is_allowed=False)
    assert "Failed to fetch" in found["error"]
    assert "status" not in found


def test_the_documentation_works_with_a_file_alone(service: httpx.Client) -> None:
    """Fields hold their defaults or nothing, only the photo is a file, nothing comes from another host."""
    complaints: list[str] = []
    asked: set[str] = set()
    with chromium() as browser:
        tab = browser.new_page(viewport=DESKTOP)
        tab.on("request", lambda request: asked.add(urlsplit(request.url).netloc))
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.goto(f"{service.base_url}".rstrip("/") + "/docs")
        operation = tab.locator(".opblock", has=tab.locator('[data-path="/rectify"]')).first
        operation.locator(".opblock-summary").click()
        operation.locator("input[type=file]").set_input_files(ROOT / "examples" / "page.png")
        typed = operation.locator("[data-property-name] input[type=text]")
        assert {typed.nth(k).input_value() for k in range(typed.count())} == {"", "auto", "0"}
        operation.locator("button.execute").click()
        status = operation.locator(".live-responses-table .response .response-col_status")
        expect(status).to_contain_text("200")
    assert complaints == []
    assert {host for host in asked if host} == {service.base_url.netloc.decode()}
