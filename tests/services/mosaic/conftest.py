"""Mosaics of tests share the features of views that they share."""

import hashlib
from collections.abc import Iterator

import pytest

from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.registration import pair_verification
from services.mosaic.registration.features import Features, detect_features


@pytest.fixture(scope="module", autouse=True)
def _detect_features_of_each_view_once() -> Iterator[None]:
    """Features depend on the view alone, as `registration/test_features.py` shows, and take a sixth of these tests."""
    known: dict[bytes, Features] = {}

    def detect(photo: FlatPhoto, fineness: float = 1.0) -> Features:
        told = repr((photo.gray.shape, photo.text_height_px, fineness)).encode()
        key = hashlib.blake2b(photo.gray.tobytes() + photo.shown.tobytes() + told).digest()
        if key not in known:
            known[key] = detect_features(photo, fineness)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pair_verification, "detect_features", detect)
        yield
