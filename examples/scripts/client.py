"""A small client of /rectify with retries and progress; it needs httpx only.

python client.py PHOTO... -o pages.pdf [--url http://127.0.0.1:8000]
"""

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import httpx

RETRIED = {429, 502, 503, 504}


class ProblemError(Exception):
    """The service refused the request; the text is its problem's detail."""


class Client:
    """Sends photos to the service at `url`. `key` is an API key, if the service wants one."""

    def __init__(self, url: str, key: str | None = None, tries: int = 5) -> None:
        headers = {} if key is None else {"X-API-Key": key}
        self._http = httpx.Client(base_url=url, headers=headers, timeout=httpx.Timeout(60.0, read=600.0))
        self._tries = tries

    def rectify(
        self,
        photos: Sequence[Path],
        progress: Callable[[str, float], None] | None = None,
        **options: str,
    ) -> bytes:
        """The answer to the photos as pages of one document. With `progress` the work is a job that is asked about.

        Raises
        ------
        ProblemError
        """
        headers = {} if progress is None else {"Prefer": "respond-async"}
        response = self._post(photos, options, headers)
        if response.status_code == 202 and progress is not None:
            response = self._await(response.headers["Location"], progress)
        return response.content

    def _post(
        self, photos: Sequence[Path], options: dict[str, str], headers: dict[str, str]
    ) -> httpx.Response:
        for attempt in range(self._tries):
            with ExitStack() as stack:
                files = [("image", (photo.name, stack.enter_context(photo.open("rb")))) for photo in photos]
                try:
                    response = self._http.post("/rectify", files=files, data=options, headers=headers)
                except httpx.TransportError as error:
                    if attempt + 1 == self._tries:
                        raise ProblemError(f"the service cannot be reached: {error}") from error
                    time.sleep(2.0**attempt)
                    continue
            if response.status_code not in RETRIED or attempt + 1 == self._tries:
                return _checked(response)
            time.sleep(float(response.headers.get("Retry-After", 2.0**attempt)))
        raise ProblemError("no try was allowed")

    def _await(self, job: str, progress: Callable[[str, float], None]) -> httpx.Response:
        while True:
            state = _checked(self._http.get(job)).json()
            progress(state.get("stage") or state["state"], state.get("progress") or 0.0)
            if state["state"] not in ("queued", "running"):
                return _checked(self._http.get(f"{job}/result"))
            time.sleep(0.5)


def _checked(response: httpx.Response) -> httpx.Response:
    if response.is_error:
        is_problem = response.headers.get("content-type", "").startswith("application/problem+json")
        raise ProblemError(response.json()["detail"] if is_problem else f"status {response.status_code}")
    return response


def main(arguments: list[str]) -> int:
    """Photos to one searchable PDF, with the progress on the terminal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("photos", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    asked = parser.parse_args(arguments)

    def show(stage: str, share: float) -> None:
        print(f"\r{share:4.0%} {stage:<20}", end="", file=sys.stderr, flush=True)

    try:
        asked.output.write_bytes(Client(asked.url).rectify(asked.photos, show, format="pdf", text="true"))
    except ProblemError as problem:
        print(f"\n{problem}", file=sys.stderr)
        return 1
    print(file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
