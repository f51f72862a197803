"""Which photos overlap: all that do, none that do not, in any order."""

import functools
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from services.geometry.homographies import translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.registration import pair_verification, photo_pairs
from services.mosaic.registration.features import Features, detect_features
from services.mosaic.registration.pair_registration import PairRegistration
from services.mosaic.registration.pair_verification import (
    Overlap,
    PreparedPhoto,
    shows_otherwise,
    verify_overlap,
)
from services.mosaic.registration.photo_pairs import (
    COARSER,
    PAIRS_PER_PHOTO,
    register_photos,
)
from tests.services.mosaic.warped_views import Flaws, draw_view, page, part, registration_error

pytestmark = pytest.mark.pipeline


@functools.cache
def quarters() -> tuple[FlatPhoto, ...]:
    """Four views of one page, of other scales and light; the last is upside down."""
    return (
        draw_view(page(), part(0, 0), (760, 1080), 0),
        draw_view(page(), part(470.4, 30.2, 1.0, (0.004, -0.003, 0.3, 0.5)), (730, 1080), 1, Flaws(seed=1)),
        draw_view(
            page(), part(20, 850.3, 1.3, (0.003, 0.004, 0.3, 0)), (600, 780), 2, Flaws(gain=0.8, seed=2)
        ),
        draw_view(page(), part(440, 830, 0.9), (840, 1160), 3, Flaws(blur_px=1.1, seed=3), turns=2),
    )


@functools.cache
def registered_quarters() -> dict[tuple[int, int], PairRegistration]:
    return {(pair.a, pair.b): pair for pair in register_photos(quarters())}


def test_quarters_of_a_page_register_whatever_way_up() -> None:
    photos, pairs = quarters(), registered_quarters()
    assert {(0, 1), (0, 2), (1, 3), (2, 3)} <= set(pairs)
    for (a, b), pair in pairs.items():
        assert registration_error(photos[a], photos[b], pair.H_a_b) < 0.4
        assert pair.agreement > 0.6


def test_order_of_the_upload_plays_no_part() -> None:
    photos = quarters()
    new_index = [2, 0, 3, 1]
    shuffled = sorted(
        (replace(photo, index=new_index[photo.index]) for photo in photos), key=lambda p: p.index
    )
    first = registered_quarters()
    second = {(pair.a, pair.b): pair for pair in register_photos(shuffled)}
    assert {tuple(sorted((new_index[a], new_index[b]))) for a, b in first} == set(second)
    for (a, b), pair in first.items():
        i, j = new_index[a], new_index[b]
        other = second[min(i, j), max(i, j)]
        H = other.H_a_b if i < j else np.linalg.inv(other.H_a_b)
        np.testing.assert_allclose(H / H[2, 2], pair.H_a_b, rtol=1e-6, atol=1e-6)
        own, theirs = (pair.points_a, other.points_a if i < j else other.points_b)
        np.testing.assert_allclose(own, theirs, atol=1e-9)
        assert (pair.votes, pair.matches) == (other.votes, other.matches)


def test_views_that_share_much_are_matched_at_half_the_word_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[float] = []
    detect = detect_features

    def noted(photo: FlatPhoto, fineness: float = 1.0) -> Features:
        looks.append(fineness)
        return detect(photo, fineness)

    monkeypatch.setattr(pair_verification, "detect_features", noted)
    a = draw_view(page(), part(0, 0), (1000, 1100), 0)
    b = draw_view(page(), part(30.5, 300.2, 1.0, (0.002, -0.002, 0.2, 0.2)), (1000, 1100), 1, Flaws(seed=1))
    (pair,) = register_photos([a, b])
    assert registration_error(a, b, pair.H_a_b) < 0.5
    assert set(looks) == {COARSER}


def test_a_twentieth_of_the_view_is_enough() -> None:
    a = draw_view(page(), part(0, 0), (1200, 900), 0)
    b = draw_view(page(), part(0.5, 845.2, 1.0, (0.002, -0.002, 0.2, 0.2)), (1200, 900), 1, Flaws(seed=1))
    (pair,) = register_photos([a, b])
    assert registration_error(a, b, pair.H_a_b) < 0.5


def test_different_pages_in_the_same_type_are_refused() -> None:
    a = draw_view(page(0), part(0, 0), (800, 900), 0)
    b = draw_view(page(3), part(0, 300), (800, 900), 1, Flaws(seed=1))
    assert register_photos([a, b]) == ()


def test_photo_of_another_page_stays_alone() -> None:
    photos = [*quarters()[:2], draw_view(page(3), part(0, 0), (760, 1080), 2, Flaws(seed=5))]
    assert [(pair.a, pair.b) for pair in register_photos(photos)] == [(0, 1)]


def test_views_that_do_not_overlap_by_the_others_are_not_verified(monkeypatch: pytest.MonkeyPatch) -> None:
    tops = (0, 400, 800)
    views = [draw_view(page(), part(0, top), (760, 560), n, Flaws(seed=n + 1)) for n, top in enumerate(tops)]
    verified: list[tuple[int, ...]] = []

    def count(a: PreparedPhoto, b: PreparedPhoto, *rest: Any) -> Overlap | None:
        verified.append(tuple(sorted((a.photo.index, b.photo.index))))
        return verify_overlap(a, b, *rest)

    assert register_photos([views[0], views[2]]) == ()
    monkeypatch.setattr(photo_pairs, "verify_overlap", count)
    assert [(pair.a, pair.b) for pair in register_photos(views)] == [(0, 1), (1, 2)]
    assert sorted(verified) == [(0, 1), (1, 2)]


def test_only_sure_pairs_say_that_others_lie_apart() -> None:
    """A phrase that is printed twice once laid two photos wrongly, and by it a true pair seemed to lie apart."""
    heights = {0: 20.0, 1: 20.0}
    block = np.array([[0.0, 0.0], [300.0, 0.0], [0.0, 90.0], [300.0, 90.0]])
    pair = PairRegistration(0, 1, np.eye(3), block, block, np.ones(4), 40, 20, 4, 0.95)
    assert photo_pairs._is_sure(pair, heights)
    assert not photo_pairs._is_sure(replace(pair, agreement=0.73), heights)
    line = block * [1.0, 0.2]
    assert not photo_pairs._is_sure(replace(pair, points_a=line, points_b=line), heights)


def test_identical_photos_lie_on_each_other() -> None:
    view = quarters()[0]
    (pair,) = register_photos([view, replace(view, index=1)])
    np.testing.assert_allclose(pair.H_a_b, np.eye(3), atol=0.02)
    assert pair.agreement == pytest.approx(1.0)


def test_blank_view_registers_with_nothing() -> None:
    blank = draw_view(np.full_like(page(), 255), part(0, 0), (760, 1080), 1, Flaws(noise=0))
    assert register_photos([quarters()[0], blank]) == ()


def test_rows_that_repeat_are_not_taken_for_each_other() -> None:
    # A form: the same line over and over, seen from below its head.
    form = np.full_like(page(), 255)
    line = page()[700:755]
    for top in range(60, form.shape[0] - 60, 55):
        form[top : top + 55] = line
    a = draw_view(form, part(0, 0), (1200, 900), 0)
    b = draw_view(form, part(0, 420), (1200, 900), 1, Flaws(seed=1))
    assert register_photos([a, b]) == ()


def test_pair_is_the_same_from_both_sides() -> None:
    a, b = quarters()[0], quarters()[1]
    (one,), (two,) = register_photos([a, b]), register_photos([b, a])
    assert (one.a, one.b) == (two.a, two.b) == (0, 1)
    np.testing.assert_array_equal(one.points_a, two.points_a)


def test_cells_of_a_table_are_not_taken_for_each_other() -> None:
    # Ruled cells of numbers that differ: the rules fit on each other at every row.
    rng = np.random.default_rng(4)
    table = np.full_like(page(), 255)
    for y in range(40, table.shape[0], 50):
        table[y : y + 3, 40:1160] = 0
        for x in range(40, 1000, 160):
            text = f"{rng.integers(0, 99999) / 100:.2f}"
            cv2.putText(table, text, (x + 12, y + 38), cv2.FONT_HERSHEY_SIMPLEX, 0.95, (0,), 2, cv2.LINE_AA)
    table[40:, 40:1160:160] = 0
    table[40:, 41:1160:160] = 0
    a = draw_view(table, part(0, 0), (1200, 800), 0)
    below = draw_view(table, part(0, 1000.5), (1200, 800), 1, Flaws(seed=1))
    assert register_photos([a, below]) == ()
    beside = draw_view(table, part(0.4, 450.5), (1200, 800), 1, Flaws(seed=1))
    (pair,) = register_photos([a, beside])
    assert registration_error(a, beside, pair.H_a_b) < 0.4


def test_photo_from_three_times_as_far_registers() -> None:
    near = draw_view(page(), part(100, 300), (900, 900), 0)
    far = draw_view(page(), part(-20, 10, 3.0), (400, 620), 1, Flaws(seed=1))
    (pair,) = register_photos([near, far])
    assert registration_error(near, far, pair.H_a_b) < 1.0


def test_print_that_differs_where_views_would_overlap_speaks_against_it() -> None:
    a, same = draw_view(page(), part(0, 0), (800, 700), 0), draw_view(page(), part(0, 300), (800, 700), 1)
    other = draw_view(page(3), part(0, 300), (800, 700), 1)
    blank = replace(other, gray=np.full_like(other.gray, 255))
    shift = translation(0.0, 300.0)
    one = PreparedPhoto(a)
    assert shows_otherwise(one, PreparedPhoto(other), shift, 0, 2.0)
    assert not shows_otherwise(one, PreparedPhoto(same), shift, 0, 2.0)
    assert not shows_otherwise(one, PreparedPhoto(blank), translation(0.0, 690.0), 0, 2.0)


def test_photo_that_could_not_be_rectified_registers() -> None:
    flat = draw_view(page(), part(0, 0), (1200, 900), 0)
    tilted = draw_view(page(), part(150, 250, 0.9, (0.05, -0.04, 25, 18)), (900, 800), 1, Flaws(seed=1))
    (pair,) = register_photos([flat, tilted])
    assert registration_error(flat, tilted, pair.H_a_b) < 0.5


def test_work_on_photos_of_other_pages_grows_with_their_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """A dozen photos that have nothing in common: no more pairs are verified than a few for each."""
    chance = np.random.default_rng(0)
    noise = [
        draw_view(chance.integers(0, 255, (400, 400)).astype(np.uint8), part(0, 0), (300, 300), index)
        for index in range(12)
    ]
    looked_at: list[tuple[int, int, float]] = []
    vote = photo_pairs._vote

    def count(a: PreparedPhoto, b: PreparedPhoto, turns: int, fineness: float) -> Any:
        looked_at.append((a.photo.index, b.photo.index, fineness))
        return vote(a, b, turns, fineness)

    monkeypatch.setattr(photo_pairs, "_vote", count)
    assert register_photos(noise) == ()
    fine = [each for each in looked_at if each[2] >= 1.0]
    assert len(fine) == 2 * PAIRS_PER_PHOTO * len(noise)
    assert len(looked_at) - len(fine) == 2 * 66
