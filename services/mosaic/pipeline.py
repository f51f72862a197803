"""The steps of a mosaic, in order."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from services.arrays import GrayImage, RgbImage
from services.contract.cameras import CameraMemory
from services.contract.mosaic import FEWEST_PHOTOS, MOST_PHOTOS, MosaicParameters
from services.contract.rectify import Illumination
from services.errors import DocumentError, InvalidOption, NoText, NotOverlapping
from services.geometry.homographies import translation
from services.geometry.page_frame import turning
from services.heap import keeping_freed_memory
from services.imaging.channels import luminance
from services.imaging.illumination import flatten_illumination
from services.imaging.reduction import reduce_image
from services.mosaic.composition.composed_page import compose_page
from services.mosaic.disagreement import (
    disagreement_notices,
    find_disagreements,
    let_lead,
    straighten_leaders,
)
from services.mosaic.duplicates import find_duplicates
from services.mosaic.evidence import (
    describe_covers,
    describe_pairs,
    describe_patches,
    describe_sheet,
    duplicate_notices,
    notices_of,
    unplaced_notices,
)
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.flattening import flatten_photo, take_as_flat
from services.mosaic.joined_page import AS_JOINED, flatten_joined
from services.mosaic.light.hidden_parts import HiddenPart
from services.mosaic.light.tone_matching import match_tones
from services.mosaic.page_cropping import crop_page, find_page_crop, see_sheet
from services.mosaic.patch_mesh import turn_as_in_patch
from services.mosaic.placed_photo import PlacedPhoto
from services.mosaic.placing.placed_part import PlacedPart, place_parts, place_photos
from services.mosaic.placing.whole_photo import find_whole_photo
from services.mosaic.registration.pair_registration import PairRegistration
from services.mosaic.registration.photo_pairs import register_photos
from services.mosaic.results import MosaicResult
from services.mosaic.whole_pixels import JoinedPhotos, join_whole_pixels
from services.ocr.engine import OcrEngine
from services.progress import report_progress
from services.rectify.analysis.found_text import STROKE_TEXT_HEIGHT_PX
from services.rectify.results import Orientation
from services.rectify.stage_clock import StageClock
from services.rectify.view.orientation import tell_orientation
from services.rectify.view.turned_image import apply_orientation

FLATTENED = 0.4
STAGE_BEGINS = {
    "registration": FLATTENED,
    "adjustment": 0.65,
    "illumination": 0.67,
    "composition": 0.75,
    "orientation": 0.95,
}
"""Start of each stage as a share of the time, measured on sets of three photos. Flattening ends at `FLATTENED`."""


@keeping_freed_memory()
def mosaic(
    photos: Sequence[RgbImage],
    parameters: MosaicParameters,
    exif_focal_lengths_px: Sequence[float | None] | None = None,
    ocr: OcrEngine | None = None,
    cameras: Sequence[CameraMemory | None] | None = None,
) -> MosaicResult:
    """The page of which `photos`, each (H, W, 3), show parts; `cameras` is what is remembered of each photo's camera.

    Raises
    ------
    InvalidOption
        When there are too few or too many photos, or `base` is not the index of a photo.
    NoText
        When no two photos overlap, and at most one shows enough printed text; the detail names the others.
    NotOverlapping
        When no two photos show the same part of a page, or no photo overlaps the base.
    """
    check_parameters(len(photos), parameters)
    clock = StageClock(STAGE_BEGINS)
    with clock.stage("duplicates"):
        repeats = find_duplicates(photos, parameters.base)
    # Where all are one photo, it is joined with its first copy: the answer is its flat page, with the warnings.
    alone = len(photos) - len(repeats) < FEWEST_PHOTOS
    kept = {i: photo for i, photo in enumerate(photos) if i not in repeats or (alone and i == min(repeats))}
    flats, textless = flatten_photos(kept, parameters.rectify, exif_focal_lengths_px, cameras, clock)
    with clock.stage("registration"):
        pairs = register_photos(list(flats.values()))
    try:
        part, joined = find_places(flats, pairs, parameters, clock)
    except NotOverlapping as refusal:
        raise explain_refusal(refusal, textless, len(kept)) from None
    flats |= part.photos  # those of one bent sheet, or of one photo, have views of it
    if joined is None:
        disagreements = find_disagreements(part, typical_text_height_px(part), parameters.base)
        part = straighten_leaders(part, disagreements)
        with clock.stage("illumination"):
            placed, glare = match_light(flats, part, parameters.illumination)
            placed = let_lead(placed, disagreements)
        with clock.stage("composition"):
            text_height_px = typical_text_height_px(part)
            composed = compose_page(placed, part.width, part.height, parameters.composition, text_height_px)
        # Where no photo shows the page's shape, all of them together may.
        alone_shapeless = parameters.rectify and all(photo.flat.page is None for photo in placed)
        whole = flatten_joined(composed.image, clock) if alone_shapeless else None
        with clock.stage("framing"):
            crop = find_page_crop(composed.image, see_sheet(placed, part.width, part.height))
            page = crop_page(composed.image, crop) if whole is None else whole.image
        H_page_mosaic = (
            translation(-crop.left, -crop.top) if whole is None else np.linalg.inv(whole.H_joined_page)
        )
        sharpness = composed.sharpness
        covered, notices = describe_covers(placed, glare, crop)
        if alone_shapeless:
            notices += [AS_JOINED] if whole is None else whole.notices
    else:
        page, placed = joined.image, joined.placed
        text_height_px, disagreements = typical_text_height_px(part), []
        sharpness, H_page_mosaic = (1.0,) * len(placed), np.eye(3)
        covered, notices = (0.0,) * len(placed), []
    orientation, notice = Orientation(parameters.rotate or 0, False, None), None
    if parameters.upright and parameters.rotate is None:
        with clock.stage("orientation"):
            base = placed[sorted(part.placements).index(part.base)]
            orientation, notice = tell_orientation(
                lambda: draw_reading_view(page, text_height_px),
                ocr,
                turn_as_in_patch(base.flat, base.placement, H_page_mosaic),
            )
    turn, _, _ = turning(page.shape[1], page.shape[0], orientation.rotation_deg, orientation.mirrored)
    H_final_mosaic = np.linalg.inv(turn) @ H_page_mosaic
    patches = describe_patches(len(photos), placed, sharpness, covered, H_final_mosaic, part.joint)
    unplaced = tuple(index for index, patch in enumerate(patches) if not patch.placed)
    notices = [
        *notices,
        *disagreement_notices(disagreements),
        *duplicate_notices(repeats),
        *part.notices,
        *notices_of(placed),
        *unplaced_notices([index for index in unplaced if index not in repeats], textless, pairs),
    ]
    return MosaicResult(
        apply_orientation(page, orientation),
        part.base,
        patches,
        describe_pairs(flats, part),
        unplaced,
        orientation,
        (*notices, notice) if notice else tuple(notices),
        clock.timings_ms,
        None if part.joint is None else describe_sheet(part.joint),
    )


def check_parameters(count: int, parameters: MosaicParameters) -> None:
    """Check the number of photos, and the index of the base photo."""
    if count < FEWEST_PHOTOS:
        raise InvalidOption(
            f"images: expected {FEWEST_PHOTOS} to {MOST_PHOTOS} photos, got {count}; a single photo is for "
            "/rectify.",
            "images",
        )
    if count > MOST_PHOTOS:
        raise InvalidOption(
            f"images: expected {FEWEST_PHOTOS} to {MOST_PHOTOS} photos, got {count}.", "images"
        )
    if parameters.base is not None and not 0 <= parameters.base < count:
        raise InvalidOption(
            f"base: there is no photo {parameters.base}; expected auto or an index from 0 to {count - 1}.",
            "base",
        )


def flatten_photos(
    photos: Mapping[int, RgbImage],
    rectify: bool,
    exif_focal_lengths_px: Sequence[float | None] | None,
    cameras: Sequence[CameraMemory | None] | None,
    clock: StageClock,
) -> tuple[dict[int, FlatPhoto], Mapping[int, DocumentError]]:
    """Flat views of photos, and the errors of those that could not be rectified because they lack text.

    Photos, views and errors are named by their indices in the upload.

    A photo without text is used without rectification: it may show a picture on the page, and overlap other photos.
    """
    flats, textless = {}, {}
    for number, (index, photo) in enumerate(photos.items()):
        report_progress("flattening", FLATTENED * number / len(photos))
        if rectify:
            focal_length_px = exif_focal_lengths_px[index] if exif_focal_lengths_px else None
            memory = cameras[index] if cameras else None
            try:
                flats[index] = flatten_photo(index, photo, focal_length_px, clock, memory)
                continue
            except NoText as refusal:
                textless[index] = refusal
        flats[index] = take_as_flat(index, photo, clock)
    known = [flat.text_height_px for index, flat in flats.items() if index not in textless]
    for index in textless if known else ():
        flats[index] = replace(flats[index], text_height_px=float(np.median(known)), weight=0.0)
    return flats, textless


def find_places(
    flats: Mapping[int, FlatPhoto],
    pairs: Sequence[PairRegistration],
    parameters: MosaicParameters,
    clock: StageClock,
) -> tuple[PlacedPart, JoinedPhotos | None]:
    """The photos of the page with their places, as parts of one photo where they are; beside it screenshots joined.

    Raises `NotOverlapping`.
    """
    whole = find_whole_photo(flats, pairs, parameters.base, clock) if parameters.rectify else None
    with clock.stage("adjustment"):
        if whole is not None:
            return place_parts(whole, parameters.base), None
        part = place_photos(flats, pairs, parameters.base)
        return part, None if parameters.rectify else join_whole_pixels(part.photos, part)


def explain_refusal(
    refusal: NotOverlapping, textless: Mapping[int, DocumentError], count: int
) -> DocumentError:
    """Error that says what a person can do about photos that do not connect."""
    if not textless:
        return refusal
    named = " ".join(f"images[{index}]: {reason.detail}" for index, reason in sorted(textless.items()))
    return (
        NoText(named)
        if count - len(textless) < FEWEST_PHOTOS
        else NotOverlapping(f"{refusal.detail} {named}")
    )


def match_light(
    flats: Mapping[int, FlatPhoto], part: PlacedPart, illumination: Illumination
) -> tuple[tuple[PlacedPhoto, ...], HiddenPart | None]:
    """The photos of the page with their placements and matched tones, in the order of the upload, and the page's part
    that glare hides in all of them.
    """
    order = sorted(part.placements)
    photos, placements = [flats[index] for index in order], [part.placements[index] for index in order]
    tones = match_tones(photos, placements, illumination)
    return tuple(map(PlacedPhoto, photos, placements, tones.maps, tones.hidden)), tones.glare


def typical_text_height_px(part: PlacedPart) -> float:
    """Text height in mosaic pixels, the median over the photos."""
    heights = []
    for index, placement in part.placements.items():
        flat = part.photos[index]
        width, height = flat.size
        middle = np.array([[(width - 1) / 2, (height - 1) / 2]])
        square = placement.to_mosaic(middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        heights.append(flat.text_height_px * float(np.sqrt(abs(np.linalg.det(square[1:] - square[0])))))
    return float(np.median(heights))


def draw_reading_view(page: RgbImage, text_height_px: float) -> GrayImage:
    """The page in gray, flat-fielded, at the size for text recognition."""
    factor = min(1.0, STROKE_TEXT_HEIGHT_PX / text_height_px)
    return flatten_illumination(reduce_image(luminance(page), factor), text_height_px * factor)
