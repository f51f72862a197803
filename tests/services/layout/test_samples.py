"""What a model is taught by one verified page with its image."""

import numpy as np
from numpy.typing import NDArray

from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_from_document
from services.layout.page import Page
from services.layout.pipeline import complete_sample, read_page
from simulation.labelled_pages import letter_page


def drawn_letter() -> tuple[Page, NDArray[np.uint8]]:
    letter = letter_page(np.random.default_rng(3))
    assert letter.image is not None
    page = page_from_document(letter.document(), ExchangeLimits())
    return page, np.repeat(letter.image[..., None], 3, axis=2)


def test_a_sample_with_an_image_is_seen_in_both_zones() -> None:
    page, image = drawn_letter()
    verified, found = complete_sample(page, image, None)
    assert [(zone.id, zone.box, zone.label) for zone in verified.zones] == [
        (zone.id, zone.box, zone.label) for zone in page.zones
    ]
    assert found is not None
    assert [zone.box for zone in found.zones] == [zone.box for zone in read_page(image, None).zones]
    labels = {zone.label for zone in found.zones if zone.label is not None}
    assert {"body", "salutation", "receiver"} <= labels <= {zone.label for zone in page.zones}


def test_a_sample_without_an_image_is_what_was_sent() -> None:
    page, _ = drawn_letter()
    verified, found = complete_sample(page, None, None)
    assert found is None
    assert [zone.label for zone in verified.zones] == [zone.label for zone in page.zones]
    assert all(zone.content for zone in verified.zones if zone.text)


def test_found_zones_that_a_person_verified_count_once() -> None:
    _, image = drawn_letter()
    found = read_page(image, None)
    first, *others = found.zones
    verified = Page(found.width, found.height, (type(first)(first.id, first.box, label="date"), *others))
    assert complete_sample(verified, image, None)[1] is None
