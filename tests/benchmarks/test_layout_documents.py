"""The benchmark of documents: it runs, and its figures are counts of what it says."""

from benchmarks.layout.documents import (
    make_documents,
    make_models,
    measure_documents,
    measure_pages,
    report,
    spoiled,
)


def test_counts_are_of_all_pages_and_zones() -> None:
    documents, models = make_documents(2), make_models(1)
    assert [len(pages) for _, pages in documents] == [1, 2] * 4
    first = sum(len(pages[0].zones) for _, pages in documents)
    for measure in (measure_documents, measure_pages):
        counts = measure(documents, models)
        assert counts["documents"] == 8
        assert counts["first zones"] == first
        assert counts["right"] <= counts["nearest right"] <= 8
        assert counts["later wrong"] < 0.3 * counts["later zones"]
    assert measure_documents(documents, models)["nearest right"] >= 7
    few = spoiled(documents)
    assert sum(len(pages[0].zones) for _, pages in few) < 0.5 * first
    assert [pages[1:] for _, pages in few] == [pages[1:] for _, pages in documents]


def test_the_report_has_a_row_for_every_way() -> None:
    lines = report(make_documents(1), [1]).splitlines()
    assert len(lines) == 2 + 8
