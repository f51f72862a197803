"""What the analysis of a photo sees: characters, samples in photo pixels, and photos without text."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from services.errors import NoText
from services.imaging.channels import luminance
from services.imaging.illumination import flatten_illumination
from services.imaging.reduction import Halves, reduce_image
from services.rectify.analysis import page_analysis
from services.rectify.analysis.found_text import AnalysisParameters, characters_in_photo, region_mask
from services.rectify.analysis.page_analysis import PageAnalysis, analyse_photo
from services.texture_flow.text_identification import identify_text
from simulation.flat_page import Page
from tests.services.scenes import CURVED_SCENES, FLAT_SCENES, Album, errors_deg


@pytest.mark.parametrize("name", [*FLAT_SCENES, *CURVED_SCENES])
def test_characters_lie_on_the_pages_words(album: Album, name: str) -> None:
    shot = album[name]
    at = np.round(shot.analysis.characters).astype(int)
    words = cv2.dilate(shot.truth.text_mask().astype(np.uint8), np.ones((5, 5)))
    # Only words that are whole count as words; skewed pages have parts of others at their rims.
    assert words[at[:, 1], at[:, 0]].mean() > 0.96
    assert shot.truth.on_page(shot.analysis.characters).mean() > 0.985
    letters = sum(len(word.text) for line in shot.truth.visible_lines() for word in line)
    # In a blurred photo letters touch.
    assert (0.7 if name == "dirty" else 0.85) * letters < len(at) < 1.05 * letters


@pytest.mark.parametrize("name", ["plain", "large", "ragged"])
def test_text_height_is_in_photo_pixels(album: Album, name: str) -> None:
    shot = album[name]
    boxes = np.array([word.box for line in shot.truth.visible_lines() for word in line])
    middle = boxes[:, :2] + 0.5 * (boxes[:, 2:] - boxes[:, :2])
    # The x-height of Pillow's typeface, a little over half of the em, which is a 38th of the page.
    half = np.array([0.0, 0.53 * shot.truth.page.width / 38 / 2])
    tall = shot.truth.page_to_photo(middle + half) - shot.truth.page_to_photo(middle - half)
    assert shot.analysis.text_height_px == pytest.approx(np.median(np.linalg.norm(tall, axis=1)), rel=0.25)


@pytest.mark.parametrize("name", ["plain", "large", "dirty"])
def test_the_part_with_text_shows_what_the_photo_shows(album: Album, name: str) -> None:
    shot = album[name]
    strokes = shot.analysis.strokes
    gray = luminance(shot.photo.image)
    height, width = strokes.image.shape
    assert height * width < 0.95 * gray.size * strokes.factor**2
    whole = flatten_illumination(reduce_image(gray, strokes.factor))
    left, top = (round(v * strokes.factor) for v in strokes.origin)
    seen = whole[top : top + height, left : left + width].astype(int)
    # At most a pixel's rounding apart, in place and in light.
    assert np.abs(seen - strokes.image[: seen.shape[0], : seen.shape[1]]).mean() < (
        0.5 if strokes.factor == 1 else 6
    )
    inside = (shot.analysis.characters - strokes.origin) * strokes.factor
    assert ((inside > 0) & (inside < (width, height))).all()


@pytest.mark.parametrize("name", ["large", "dirty"])
def test_a_smaller_analysis_answers_in_photo_pixels_too(album: Album, name: str) -> None:
    shot = album[name]
    small = analyse_photo(shot.photo.image, parameters=AnalysisParameters(long_side_px=1100))
    assert small.factor == pytest.approx(1100 / shot.photo.image.shape[0])
    assert max(small.reduced.shape) == 1100
    assert small.text_height_px == pytest.approx(shot.analysis.text_height_px, rel=0.1)
    for samples, truth in ((small.major, shot.truth.major_flow), (small.minor, shot.truth.minor_flow)):
        assert samples is not None
        assert shot.truth.on_page(samples.points).mean() > 0.99
        assert np.median(errors_deg(samples.angles, truth(samples.points))) < 0.5
    # Both analyses say the same of the same places of the photo.
    points = shot.text_points
    assert np.median(errors_deg(small.major_field.at(points), shot.analysis.major_field.at(points))) < 0.2
    assert small.minor_field is not None
    assert np.median(errors_deg(small.minor_field.at(points), shot.truth.minor_flow(points))) < 0.8
    extents = [np.percentile(a.characters, [5, 95], axis=0) for a in (small, shot.analysis)]
    assert np.abs(extents[0] - extents[1]).max() < 25


def test_samples_of_a_photo_with_four_pixels_for_each_are_at_the_same_places(album: Album) -> None:
    # Reduced by half, the enlarged photo is the photo again; so every place must be the same, to the pixel.
    shot = album["plain"]
    large = np.repeat(np.repeat(shot.photo.image, 2, axis=0), 2, axis=1)
    there = analyse_photo(large, parameters=AnalysisParameters(long_side_px=max(shot.photo.image.shape)))
    here = shot.analysis
    assert there.factor == 0.5
    assert np.array_equal(there.reduced, here.reduced)
    assert np.allclose((there.major.points + 0.5) / 2 - 0.5, here.major.points)
    assert np.allclose(there.major.angles, here.major.angles)
    assert np.allclose((there.characters + 0.5) / 2 - 0.5, here.characters)
    assert there.text_height_px == pytest.approx(2 * here.text_height_px)
    points = shot.text_points
    assert errors_deg(there.major_field.at(2 * points + 0.5), here.major_field.at(points)).max() < 0.02


def test_light_print_on_dark_paper_is_seen_as_its_negative(album: Album) -> None:
    shot = album["frontal"]
    negative = analyse_photo(255 - shot.photo.image)
    points = shot.text_points
    assert len(negative.characters) > 0.95 * len(shot.analysis.characters)
    # Print of the other sign is seen in the photo itself.
    assert shot.analysis.positive is None
    assert negative.positive is not None
    assert negative.positive.shape == negative.reduced.shape
    assert errors_deg(negative.major_field.at(points), shot.truth.major_flow(points)).mean() < 0.2


@pytest.mark.parametrize("name", ["frontal", "dirty"])
def test_where_most_ink_is_no_text_the_ground_tells_dark_from_light_print(
    album: Album, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_analysis, "PICTURE_SHARE", -1.0)  # as if: both signs are analysed
    photo = album[name].photo.image
    assert analyse_photo(photo).positive is None
    assert analyse_photo(255 - photo).positive is not None
    # As if a textured desk were more of the ink than all print, and gaps between letters were characters.
    analyse = page_analysis._analyse_dark_print

    def with_desk(seen: Halves, *args: Any, **options: Any) -> tuple[PageAnalysis, ...]:
        page = analyse(Halves(photo), *args, **options)[0]
        if np.array_equal(seen.image, photo):
            return (replace(page, text=replace(page.text, rejected_fraction=0.9)),)
        return (replace(page, reduced=255 - page.reduced, text=replace(page.text, rejected_fraction=0.85)),)

    monkeypatch.setattr(page_analysis, "_analyse_dark_print", with_desk)
    assert analyse_photo(photo).positive is None


def test_only_the_region_is_looked_at(album: Album) -> None:
    shot = album["plain"]
    region = ((150.0, 300.0), (800.0, 300.0), (800.0, 800.0), (150.0, 800.0))
    part = analyse_photo(shot.photo.image, region)
    assert (part.characters > [148, 298]).all()
    assert (part.characters < [802, 802]).all()
    inside = ((shot.analysis.characters > [165, 315]) & (shot.analysis.characters < [785, 785])).all(axis=1)
    assert len(part.characters) > 0.97 * inside.sum()
    errors = errors_deg(part.major.angles, shot.truth.major_flow(part.major.points))
    assert errors.mean() < 0.4


def test_an_empty_region_is_told(album: Album) -> None:
    with pytest.raises(NoText, match="larger region"):
        analyse_photo(album["plain"].photo.image, ((0.0, 0.0), (60.0, 0.0), (0.0, 60.0)))


def photo_of(kind: str, shape: tuple[int, int]) -> np.ndarray:
    rng = np.random.default_rng(0)
    values = {
        "white": np.full((*shape, 3), 255),
        "black": np.zeros((*shape, 3)),
        "noise": rng.integers(0, 256, (*shape, 3)),
        "slope": np.tile(np.linspace(0, 255, shape[1])[None, :, None], (shape[0], 1, 3)),
    }
    return values[kind].astype(np.uint8)


@pytest.mark.parametrize("kind", ["white", "black", "noise", "slope"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (20, 20), (2, 900), (300, 400)])
def test_photos_without_text_are_refused(kind: str, shape: tuple[int, int]) -> None:
    with pytest.raises(NoText, match=r"printed characters|text lines"):
        analyse_photo(photo_of(kind, shape))


def test_a_few_words_are_too_few(pages: tuple[Page, ...]) -> None:
    word = pages[0].lines[3][2]
    x0, y0, x1, y1 = (round(v) for v in word.box)
    photo = np.full((1250, 800, 3), 255, np.uint8)
    photo[y0:y1, x0:x1] = pages[0].image[y0:y1, x0:x1, None]
    with pytest.raises(NoText, match="at least 30"):
        analyse_photo(photo)


@pytest.mark.parametrize("count", [2, 4])
def test_a_few_lines_are_enough(pages: tuple[Page, ...], count: int) -> None:
    rows = [round(pages[0].lines[k][0].box[1]) - 4 for k in (4, 4 + count)]
    photo = np.full((1250, 800, 3), 255, np.uint8)
    photo[rows[0] : rows[1]] = pages[0].image[rows[0] : rows[1], :, None]
    analysis = analyse_photo(photo)
    assert np.degrees(np.abs(analysis.major.angles)).mean() < 1.0


def test_region_mask_is_the_polygon_in_the_reduced_photo() -> None:
    mask = region_mask(((100.0, 50.0), (299.0, 50.0), (299.0, 249.0), (100.0, 249.0)), (200, 200), 0.5)
    assert mask.sum() == pytest.approx(100 * 100, rel=0.03)
    assert mask[26:124, 51:149].all()
    assert not mask[:24].any()
    assert not mask[:, 152:].any()
    whole = region_mask(((-1e12, -1e12), (1e12, -1e12), (1e12, 1e12), (-1e12, 1e12)), (200, 200), 0.5)
    assert whole.all()
    beside = region_mask(((1e6, 1e6), (2e6, 1e6), (2e6, 2e6)), (200, 200), 0.5)
    assert not beside.any()


def test_characters_are_where_the_reduced_photo_has_them(pages: tuple[Page, ...]) -> None:
    gray = pages[1].image
    large = np.asarray(cv2.resize(gray, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST), np.uint8)
    small, whole = identify_text(gray), identify_text(large)
    there = characters_in_photo(small, 0.5)
    nearest = np.linalg.norm(there[::20, None] - whole.components.centres[None], axis=2).min(axis=1)
    assert np.median(nearest) < 0.6
