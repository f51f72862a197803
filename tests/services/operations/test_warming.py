"""What a worker makes ready once."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from services.contract.worker_facts import WorkerFacts
from services.errors import NoText
from services.operations import rectify, warming
from services.operations.reader import ocr_engine
from services.operations.warming import warm_up
from services.rectify.results import RectifyResult
from tests.services.operations.pipelines import RectifyPipeline

pytestmark = pytest.mark.pipeline


def test_an_engine_is_opened_once_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = ocr_engine(), ocr_engine()
    assert first is second
    assert warm_up().ocr == (None if first is None else first.name)


@pytest.mark.parametrize("refusal", [NoText("Nothing to read."), None])
def test_warming_up_runs_the_whole_road(
    monkeypatch: pytest.MonkeyPatch, pipeline: RectifyPipeline, refusal: Exception | None
) -> None:
    def refuse(*arguments: Any) -> RectifyResult:
        result = pipeline(*arguments)
        if refusal is not None:
            raise refusal
        return result

    monkeypatch.setattr(rectify, "rectify", refuse)
    monkeypatch.setattr(warming, "ocr_engine", lambda: None)
    assert warm_up() == WorkerFacts(None, ())
    assert len(pipeline.calls) == 1


def test_warming_up_does_not_hide_defects(monkeypatch: pytest.MonkeyPatch, pipeline: RectifyPipeline) -> None:
    def crash(*_: Any) -> RectifyResult:
        raise ZeroDivisionError

    broken: Callable[..., RectifyResult] = crash
    monkeypatch.setattr(rectify, "rectify", broken)
    with pytest.raises(ZeroDivisionError):
        warm_up()


def test_a_bad_settings_file_is_found_before_any_request(tmp_path: Path, pipeline: RectifyPipeline) -> None:
    (tmp_path / "features.toml").write_text("this is no TOML")
    with pytest.raises(ValueError, match=r"features\.toml"):
        warm_up(tmp_path / "features.toml")
