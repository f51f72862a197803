"""Features at word scale: upright, inside the page, and turned at no cost."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from services.geometry.homographies import transform_points
from services.mosaic.registration.features import detect_features, match_features, turn_features
from services.mosaic.registration.reduced_view import quarter_turn
from tests.services.mosaic.warped_views import draw_view, page, part, true_homography

VIEW = draw_view(page(), part(0, 100), (900, 700))


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_turned_features_are_those_of_the_turned_view(turns: int) -> None:
    turned = draw_view(page(), part(0, 100), (900, 700), turns=turns)
    computed, detected = turn_features(detect_features(VIEW), turns), detect_features(turned)
    distances, nearest = cKDTree(detected.points).query(computed.points)
    same = (distances < 0.3) & (np.abs(detected.sizes[nearest] / computed.sizes - 1) < 0.02)
    assert same.mean() > 0.8
    likeness = np.sum(computed.descriptors[same] * detected.descriptors[nearest[same]], axis=1)
    assert np.median(likeness) > 0.99
    assert (computed.width, computed.height) == turned.size
    unturned = np.sum(detect_features(VIEW).descriptors[same] * detected.descriptors[nearest[same]], axis=1)
    assert np.median(unturned) < 0.9


@pytest.mark.parametrize("turns", range(4))
def test_quarter_turn_maps_pixels_as_rot90_does(turns: int) -> None:
    image = np.arange(12).reshape(3, 4)
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    there = np.rint(transform_points(quarter_turn(turns, 4, 3), points)).astype(int)
    assert (np.rot90(image, turns)[there[:, 1], there[:, 0]] == image.ravel()).all()


def test_features_lie_where_the_page_is_shown_in_flat_pixels() -> None:
    shown = VIEW.shown.copy()
    shown[:, 450:] = False
    points = detect_features(replace(VIEW, shown=shown)).points
    assert len(points) > 100
    assert points[:, 0].max() < 455
    assert points[:, 0].max() > 350


def test_descriptors_are_unit_vectors_and_a_view_matches_itself() -> None:
    features = detect_features(VIEW)
    np.testing.assert_allclose(np.linalg.norm(features.descriptors, axis=1), 1, atol=1e-4)
    matches = match_features(features, features)
    assert len(matches.points_a) > 0.9 * len(features.points)
    np.testing.assert_array_equal(matches.points_a, matches.points_b)


def test_true_matches_are_true_to_two_pixels() -> None:
    other = draw_view(page(), part(300, 100, 1.3), (650, 700))
    matches = match_features(detect_features(VIEW), detect_features(other))
    apart = transform_points(true_homography(VIEW, other), matches.points_b) - matches.points_a
    near = np.linalg.norm(apart, axis=1) < 12
    assert near.sum() > 60
    assert np.abs(np.median(apart[near], axis=0)).max() < 0.5


def test_blank_view_has_no_features_and_no_matches() -> None:
    blank = detect_features(replace(VIEW, gray=np.full_like(VIEW.gray, 255)))
    assert len(blank.points) == 0
    assert blank.descriptors.shape == (0, 128)
    assert len(match_features(blank, detect_features(VIEW)).points_a) == 0
    assert len(match_features(detect_features(VIEW), blank).points_a) == 0
    assert len(turn_features(blank, 1).points) == 0
