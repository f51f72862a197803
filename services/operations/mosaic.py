"""The page that several photos show: check, decode, run the pipeline, encode."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from services.contract.answers import mosaic as answers
from services.contract.cameras import find_camera
from services.contract.images import Encoding, PageReply
from services.contract.kept_pages import KeptPage
from services.contract.mosaic import MosaicLimits, MosaicParameters
from services.contract.rectify import RectifyParameters
from services.errors import NoText, TooLarge
from services.imaging.codec import DecodedImage, count_pixels, decode_image, encode_image
from services.imaging.looks import scanner_look
from services.imaging.page_images import PagePicture, naming_page
from services.mosaic.pipeline import mosaic
from services.mosaic.results import MosaicResult, Patch
from services.operations.page_bundle import keep_page
from services.operations.page_reading import READING_CUT, read_flat_page, reading_engine
from services.operations.pages_reply import DescribedPage, make_page_reply
from services.operations.reader import ocr_engine
from services.operations.rectify import describe_page
from services.operations.reduced_views import reduce_mosaic
from services.operations.replies import (
    ENCODING_BEGINS,
    SourceFacts,
    describe_orientation,
    describe_warnings,
    rounded,
    timed,
)
from services.progress import progress_within
from services.rectify.kept_photo import keep_photo
from services.text.page_text import PageText

KEPT_QUALITY = 95
"""Of the JPEG file that stands for the photo of a kept mosaic: other looks are drawn from it."""
MOSAIC_READING_BEGINS = 0.85
"""Typical progress before a mosaic is read, if it is."""


def mosaic_uploads(
    uploads: Sequence[bytes],
    parameters: MosaicParameters,
    encoding: Encoding,
    limits: MosaicLimits,
) -> PageReply:
    """The page whose parts the uploaded photos show.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When an upload is not accepted (the error names it), or all uploads together are too large. All headers are
        checked before the first picture is decoded.
    NoText
        When fewer than two of the photos show enough printed text.
    NotOverlapping
        When no two photos show the same part of a page.
    InvalidOption
        When `parameters` or `encoding` are not possible.
    """
    if parameters.text or parameters.language is not None:
        reading_engine(parameters.language)  # an error must come before the work
    timings_ms: dict[str, float] = {}
    with timed("decode", timings_ms, 0.0):
        photos = _decode_photos(uploads, limits)
    focal_lengths_px = [photo.focal_length_px for photo in photos]
    cameras = [find_camera(parameters.cameras, parameters.camera or photo.camera) for photo in photos]
    with progress_within(0.03, MOSAIC_READING_BEGINS if parameters.text else ENCODING_BEGINS):
        engine = ocr_engine(parameters.language)
        result = mosaic([photo.pixels for photo in photos], parameters, focal_lengths_px, engine, cameras)
    timings_ms |= result.timings_ms
    text = None
    if parameters.text:
        reader, language = reading_engine(parameters.language)
        with timed("reading", timings_ms, MOSAIC_READING_BEGINS):
            text = read_flat_page(result.image, reader, language)
        if text.cut:
            result = replace(result, warnings=(*result.warnings, READING_CUT))
    source = SourceFacts(photos[0].format, _resolution(photos, result), _colour_profile(photos))
    kept = _keep_mosaic(result, text, parameters, source) if parameters.keep_photo else None
    result = reduce_mosaic(result, encoding)
    if text is not None:
        text = text.resized(result.image.shape[1], result.image.shape[0])
    dpi = _resolution(photos, result)
    picture = scanner_look(result.image, parameters.illumination)
    page = DescribedPage(picture, describe_mosaic(result), text, dpi, kept)
    return make_page_reply(page, replace(source, dpi=dpi), encoding, timings_ms)


def _keep_mosaic(
    result: MosaicResult, text: PageText | None, parameters: MosaicParameters, source: SourceFacts
) -> KeptPage | None:
    """What is kept of the joined page: its picture counts as a photo that is the flat page already."""
    own = encode_image(result.image, "jpeg", KEPT_QUALITY, icc_profile=source.icc_profile)
    photo = PagePicture(result.image, None, source.format, source.dpi, source.icc_profile, original=own)
    flat = keep_photo(result.image, NoText("it is a mosaic."))
    flat = replace(flat, evidence=replace(flat.evidence, source=("photo",)), warnings=())
    asked = RectifyParameters(illumination=parameters.illumination, language=parameters.language)
    return keep_page(flat, describe_page(flat, asked, Encoding("json"), photo), asked, photo, text)


def _decode_photos(uploads: Sequence[bytes], limits: MosaicLimits) -> list[DecodedImage]:
    pixels = 0
    for index, upload in enumerate(uploads):
        with naming_page(f"images[{index}]", f"images[{index}]"):
            pixels += count_pixels(upload, limits.photo)
    if pixels > limits.max_megapixels * 1e6:
        raise TooLarge(
            f"images: the photos have {pixels / 1e6:.1f} megapixels together; "
            f"the limit of a mosaic is {limits.max_megapixels:g}.",
            "images",
        )
    photos = []
    for index, upload in enumerate(uploads):
        with naming_page(f"images[{index}]", f"images[{index}]"):
            photos.append(decode_image(upload, limits.photo))
    return photos


def _colour_profile(photos: Sequence[DecodedImage]) -> bytes | None:
    """The colour profile that all photos share; None when they differ.

    The mosaic mixes pixels of different photos and matches their tones without colour conversion. So a profile is
    correct for the mosaic only if all photos have it. Without a profile the mosaic counts as sRGB.
    """
    profiles = {photo.icc_profile for photo in photos}
    return profiles.pop() if len(profiles) == 1 else None


def _resolution(photos: Sequence[DecodedImage], result: MosaicResult) -> float | None:
    """Pixels per inch of the mosaic, if all inputs have one resolution; it follows from the scale of the base photo."""
    resolutions = {photo.dpi if photo.pixel_aspect == 1.0 else None for photo in photos}
    dpi, scale = resolutions.pop(), result.patches[result.base].scale
    return None if resolutions or dpi is None or scale is None else float(round(dpi * scale))


def describe_mosaic(result: MosaicResult) -> answers.MosaicResult:
    """The answer about a mosaic, without timings and image."""
    height, width = result.image.shape[:2]
    return answers.MosaicResult(
        width=width,
        height=height,
        base=result.base,
        orientation=describe_orientation(result.orientation, None),
        patches=[_describe_patch(patch) for patch in result.patches],
        pairs=list(result.pairs),
        surface=result.surface,
        unplaced=list(result.unplaced),
        warnings=describe_warnings(result.warnings),
        timings_ms={},
    )


def _describe_patch(patch: Patch) -> answers.Patch:
    mesh = None
    if patch.mesh is not None:
        rows, columns = patch.mesh.shape[:2]
        mesh = answers.PatchMesh(rows=rows, columns=columns, target=np.round(patch.mesh, 3).tolist())
    return answers.Patch(
        placed=patch.placed,
        mesh=mesh,
        scale=rounded(patch.scale),
        sharpness=rounded(patch.sharpness),
        covered_fraction=rounded(patch.covered_fraction),
        camera=patch.camera,
    )
