"""Work says how far it is to whoever listens, and to nobody else."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from services.progress import progress_to, progress_within, report_progress

Reports = list[tuple[str, float]]


def test_without_a_sink_nothing_happens() -> None:
    report_progress("text", 0.5)
    with progress_to(None), progress_within(0.2, 0.4):
        report_progress("text", 0.5)


def test_a_sink_hears_its_block_only() -> None:
    heard: Reports = []
    with progress_to(lambda *report: heard.append(report)):
        report_progress("text", 0.25)
        with progress_to(None):
            report_progress("secret", 0.5)
    report_progress("later", 0.75)
    assert heard == [("text", 0.25)]


def test_a_sink_is_forgotten_after_an_error() -> None:
    heard: Reports = []
    with pytest.raises(ZeroDivisionError), progress_to(lambda *report: heard.append(report)):
        raise ZeroDivisionError
    report_progress("later", 0.75)
    assert heard == []


def test_parts_of_parts() -> None:
    heard: Reports = []
    with progress_to(lambda *report: heard.append(report)):
        with progress_within(0.5, 1.0), progress_within(0.0, 0.5):
            report_progress("text", 0.0)
            report_progress("text", 1.0)
        report_progress("encode", 7.0)
        report_progress("encode", -1.0)
    assert heard == [("text", 0.5), ("text", 0.75), ("encode", 1.0), ("encode", 0.0)]


def test_threads_of_the_work_stay_silent() -> None:
    heard: Reports = []
    with progress_to(lambda *report: heard.append(report)), ThreadPoolExecutor(1) as threads:
        threads.submit(report_progress, "text", 0.5).result()
    assert heard == []
