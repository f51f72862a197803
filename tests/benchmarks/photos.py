"""Simulated pages as benchmarks see them by their images."""

import numpy as np

from benchmarks.layout.marks import ink_marks, word_marks
from benchmarks.layout.word_labels import Photo
from services.layout.learning.label_transfer import transfer_labels
from services.layout.pipeline import content_features
from services.layout.segmentation import compose_page, measure_zones, segment_finely
from simulation.labelled_pages import memo_page
from tests.services.layout.samples import page_from
from tests.services.layout.test_pipeline import TruthfulEngine


def simulated_photos(count: int) -> list[Photo]:
    """Memos, read without an error."""
    photos = []
    for seed in range(count):
        page = memo_page(np.random.default_rng(seed))
        assert page.image is not None
        words = TruthfulEngine(page).read_page(page.image)
        true = content_features().measure_page(measure_zones(page.image, page_from(page)))
        fine = segment_finely(page.image, words)
        own = content_features().measure_page(transfer_labels(true, compose_page(fine)))
        marks = word_marks(words, true), ink_marks(page.image, true)
        photos.append(Photo(f"memo {seed}", true, fine, own, *marks))
    return photos
