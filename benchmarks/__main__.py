"""One command for all benchmarks: `python -m benchmarks NAME [options]`; `NAME --help` tells its options."""

import sys
from collections.abc import Sequence
from importlib import import_module

MODULES = {
    "rectify_simulated": "rectify.simulated",
    "rectify_photos": "rectify.photos",
    "rectify_speed": "rectify.speed",
    "speed": "speed",
    "same_answers": "rectify.same_answers",
    "rectify_load": "rectify.load",
    "advice": "rectify.advice",
    "preview": "rectify.preview",
    "text_confidence": "rectify.text_confidence",
    "searchable": "rectify.searchable",
    "documents": "rectify.documents",
    "camera_memory": "rectify.camera_memory",
    "languages": "rectify.languages",
    "paper": "rectify.paper",
    "app_scans": "rectify.app_scans",
    "whole_sheets": "rectify.whole_sheets",
    "house": "house",
    "scan_screen": "scan_screen",
    "print_kept": "rectify.print_kept",
    "flatness": "rectify.flatness",
    "reading": "reading.study",
    "expected_error": "reading.expected_error",
    "reading_busy": "reading.busy",
    "mosaic_simulated": "mosaic.simulated",
    "mosaic_checks": "mosaic.checks",
    "mosaic_whole_views": "mosaic.whole_views",
    "mosaic_glare": "mosaic.glare",
    "layout_recognition": "layout.recognition",
    "layout_words": "layout.word_labels",
    "layout_values": "layout.values",
    "layout_receipts": "layout.receipts",
    "layout_forms": "layout.forms",
    "layout_calibration": "layout.label_trust",
    "layout_evidence": "layout.evidence_learning",
    "layout_joins": "layout.join_learning",
    "layout_segmentation": "layout.segmentation",
    "layout_hard_pages": "layout.hard_pages",
    "layout_matching": "layout.matching",
    "layout_documents": "layout.documents",
    "layout_hierarchy": "layout.hierarchy",
    "layout_discovery": "layout.discovery",
    "layout_schemas": "layout.schemas",
    "learning": "learning.adaptation",
    "learning_store": "learning.store",
    "review": "review.report",
    "attack": "attack.service",
    "jobs": "jobs.parts",
    "upgrade": "upgrade",
    "soak": "soak",
    "readme_pictures": "readme_pictures",
}
"""Module of each benchmark by its name, which is also the name of its figures and of its baseline."""


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark that the first argument names with the others; its exit status."""
    if not arguments or arguments[0] not in MODULES:
        asked = arguments and arguments[0] in {"-h", "--help"}
        print(f"{__doc__}\n\nNames: {', '.join(MODULES)}.", file=sys.stdout if asked else sys.stderr)
        return 0 if asked else 2
    status: int = import_module(f"benchmarks.{MODULES[arguments[0]]}").main(arguments[1:])
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
