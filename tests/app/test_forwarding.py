"""A service without workers answers by the workers of other services, and says why where it cannot."""

import asyncio
import shutil
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from unittest.mock import Mock

import httpx
import pytest

from app.engine.base import Busy
from app.jobs.forwarding import JobAdmission
from app.storage.blobs import FOLDER
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_jobs import LATER, start, until
from tests.app.test_problems import assert_problem

PATHS = ("/rectify", "/layout")


@pytest.fixture(scope="module")
def lonely() -> Iterator[httpx.Client]:
    """A service without workers, and nobody else has any."""
    with serving(workers=0, queue_timeout_s=0.2) as client:
        yield client


@pytest.mark.parametrize("path", PATHS)
def test_without_any_worker_a_request_is_told_to_come_again(lonely: httpx.Client, path: str) -> None:
    refused = lonely.post(path, files={"image": upload("")})
    assert_problem(refused, 503, "busy")
    assert "QUEUE_TIMEOUT_S" in refused.json()["detail"]
    assert int(refused.headers["retry-after"]) > 0
    assert "job_queue_depth 0.0" in lonely.get("/metrics").text  # nothing of it is left


@pytest.mark.parametrize("path", PATHS)
def test_an_upload_that_the_worker_cannot_see_is_no_fault_of_the_client(path: str, tmp_path: Path) -> None:
    """As where the worker has another folder of blobs."""
    with serving(data_dir=tmp_path) as client:
        first = start(client, f"wait {tmp_path}")
        until(client, first, "running")
        job = client.post(path, files={"image": upload("")}, headers=LATER).headers["location"]
        shutil.rmtree(tmp_path / FOLDER / job.removeprefix("/"))
        (tmp_path / "go").touch()
        assert until(client, job)["state"] == "failed"
        result = client.get(f"{job}/result")
        assert (result.status_code, result.json()["code"]) == (503, "store-unavailable")
        assert "upload" in result.json()["detail"]


def test_a_request_that_a_worker_hands_back_does_not_wait_without_end() -> None:
    """As when the only worker is killed in the middle."""
    states = ["queued", "running", "queued"]

    async def follow(job: Mock) -> AsyncIterator[Mock | None]:
        for state in states:
            yield Mock(state=state, is_over=False)
            yield None
        await asyncio.Event().wait()

    admission = JobAdmission(
        Mock(), Mock(followers=Mock(follow=follow)), (), (), Mock(), queue_timeout_s=0.05, forwards=True
    )
    with pytest.raises(Busy, match="QUEUE_TIMEOUT_S"):
        asyncio.run(asyncio.wait_for(admission._wait(Mock(state="queued")), 20))
