"""The flat view of one photo: decode, run the pipeline, encode."""

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, replace

import numpy as np

from services.arrays import Vector
from services.contract.answers import rectify as answers
from services.contract.answers.capture import Quality
from services.contract.answers.page import FlatPage, Mesh, Point, Size
from services.contract.images import Encoding, PageReply
from services.contract.rectify import RectifyParameters
from services.documents.paper_size import measure_size, size_of_photo
from services.errors import NoText
from services.geometry.page_frame import turn_against_photo
from services.geometry.photo_frame import PhotoFrame
from services.imaging.looks import scanner_look
from services.imaging.page_images import PagePicture
from services.imaging.square_pixels import square_pixels
from services.ocr.printed_words import PrintedWords
from services.operations.capture_reply import describe_quality
from services.operations.page_bundle import keep_page
from services.operations.page_reading import READING_BEGINS, READING_CUT, read_flat_page, reading_engine
from services.operations.pages_reply import DescribedPage, make_page_reply, make_pages_reply
from services.operations.reader import ocr_engine
from services.operations.reduced_views import reduce_view
from services.operations.replies import (
    ENCODING_BEGINS,
    SourceFacts,
    describe_orientation,
    describe_timings,
    describe_warnings,
    rounded,
    timed,
)
from services.progress import progress_within
from services.rectify.analysis.focal_length import seen_focal_length
from services.rectify.effort import BRIEF, PREVIEW_PX
from services.rectify.kept_photo import keep_photo
from services.rectify.parameter_checks import check_parameters
from services.rectify.pipeline import rectify
from services.rectify.preview_scale import (
    enlarge,
    in_pixels_of_file,
    in_square_pixels,
    reduce_parameters,
)
from services.rectify.results import RectifyResult
from services.rectify.spread import RectifiedPages, page_timings, rectify_spread
from services.sheet.surfaces import MeshSurface, PlaneSurface, StripsSurface, Surface
from services.side_by_side import SideStep
from services.text.printed_places import printed_in_view


def rectify_picture(
    decode: Callable[[int | None], PagePicture], parameters: RectifyParameters, encoding: Encoding
) -> PageReply:
    """Frontal flat view of the page in a photo, or of both pages of an open book.

    `decode` returns the photo, reduced to the given long side if that is not None.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When the upload is not accepted.
    NoText
        When the photo shows too little printed text to estimate the page's shape, and no edges of a sheet.
    InvalidOption
        When `parameters` or `encoding` are not possible, or the page shall be read and no OCR engine is there.
    NotAcceptable
        When there are two pages and the client accepts no format that can hold both.
    """
    if parameters.text or parameters.language is not None:
        reading_engine(parameters.language)  # an error must come before the work
    end = READING_BEGINS if parameters.text else ENCODING_BEGINS
    timings_ms: dict[str, float] = {}
    with timed("decode", timings_ms, 0.0):
        photo = square_pixels(decode(PREVIEW_PX if parameters.preview else None))
    parameters = name_camera(in_square_pixels(parameters, photo.stretch), photo)
    source = SourceFacts(photo.format, photo.dpi, photo.icc_profile)
    if parameters.pages == "both":
        with progress_within(0.03, end):
            found = _flatten_spread(photo, parameters)
        pages = [describe_page(result, parameters, encoding, photo) for result in found.pages]
        timings_ms |= page_timings(found)
        return make_pages_reply(pages, source, encoding, timings_ms, found.warnings)
    if parameters.preview:
        page, spent_ms = describe_preview(photo, parameters)
        return make_page_reply(page, source, encoding, timings_ms | spent_ms)
    with progress_within(0.03, end):
        result = _flatten(photo, parameters)
    page = describe_page(result, parameters, encoding, photo)
    return make_page_reply(page, source, encoding, timings_ms | result.timings_ms)


def flatten_picture(
    photo: PagePicture, parameters: RectifyParameters, encoding: Encoding
) -> list[DescribedPage]:
    """The flat page in a photo, or both pages of an open book, with their texts if they are wanted.

    Raises
    ------
    NoText, InvalidOption
    """
    photo = square_pixels(photo)
    parameters = name_camera(in_square_pixels(parameters, photo.stretch), photo)
    if parameters.preview:
        return [describe_preview(photo, parameters)[0]]
    if parameters.pages == "both":
        found = _flatten_spread(photo, parameters)
        # Notices about both pages have no place of their own in an answer of several photos.
        results = [replace(page, warnings=(*found.warnings, *page.warnings)) for page in found.pages]
    else:
        results = [_flatten(photo, parameters)]
    return [describe_page(result, parameters, encoding, photo) for result in results]


def name_camera(parameters: RectifyParameters, photo: PagePicture) -> RectifyParameters:
    """`parameters` with the name of the photo's camera, if it has one: that of the request, else that of EXIF."""
    if parameters.camera is not None or photo.camera is None:
        return parameters
    return replace(parameters, camera=photo.camera)


def _flatten(photo: PagePicture, parameters: RectifyParameters) -> RectifyResult:
    try:
        engine = ocr_engine(parameters.language)
        return rectify(photo.pixels, parameters, photo.focal_length_px, engine, photo.origin)
    except NoText as refusal:
        if parameters.on_no_text != "keep":
            raise
        return keep_photo(photo.pixels, refusal, parameters.page_turn or 0)


def _flatten_spread(photo: PagePicture, parameters: RectifyParameters) -> RectifiedPages:
    try:
        engine = ocr_engine(parameters.language)
        return rectify_spread(photo.pixels, parameters, photo.focal_length_px, engine, photo.origin)
    except NoText as refusal:
        if parameters.on_no_text != "keep":
            raise
        return RectifiedPages((keep_photo(photo.pixels, refusal, parameters.page_turn or 0),), (), {})


def describe_page(
    result: RectifyResult, parameters: RectifyParameters, encoding: Encoding, photo: PagePicture
) -> DescribedPage:
    """One page of an answer, with the timings of its own stages; adds `reading` to those of `result`."""
    text = None
    if parameters.text:
        engine, language = reading_engine(parameters.language)
        with timed("reading", result.timings_ms, READING_BEGINS):
            mesh = in_pixels_of_file(result, photo.stretch).mesh
            text = read_flat_page(result.image, engine, language, mesh, _printed_words(result, photo))
        if text.cut:
            result = replace(result, warnings=(*result.warnings, READING_CUT))
    words = None if text is None else text.words
    with timed("quality", result.timings_ms):
        # Beside the encoding, where a processor is spare; else the photo's pixels are let go before it.
        quality = SideStep(lambda: describe_quality(photo.pixels, result, words=words))
        known = quality.result() if parameters.keep_photo or not quality.is_beside else None
    view = reduce_view(result, encoding)
    page = whole = _document(result, view, parameters, photo, known)
    # The look comes last: gray levels are read, and reduced, better than black and white.
    page = replace(page, image=scanner_look(view.image, parameters.illumination))
    height, width = view.image.shape[:2]
    if parameters.keep_photo:
        with timed("keeping", result.timings_ms):
            if view is not result:
                whole = _document(result, result, parameters, photo, known)
            page = replace(page, kept=keep_page(result, whole, parameters, photo, text))
    page = replace(page, quality=quality)
    return page if text is None else replace(page, text=text.resized(width, height))


def _printed_words(result: RectifyResult, photo: PagePicture) -> PrintedWords:
    (height, width), (rows, columns) = photo.pixels.shape[:2], result.image.shape[:2]
    return printed_in_view(photo.origin, (width, height), result.mesh, (columns, rows))


def describe_preview(
    photo: PagePicture, parameters: RectifyParameters
) -> tuple[DescribedPage, dict[str, float]]:
    """The page in a reduced photo, in pixels of the photo that was sent, not drawn; and its timings."""
    check_parameters(
        photo.pixels.shape[1] * photo.reduction, photo.pixels.shape[0] * photo.reduction, parameters
    )
    reduced = reduce_parameters(parameters, photo.reduction)
    try:
        found = rectify(photo.pixels, reduced, photo.focal_length_px, origin=photo.origin, effort=BRIEF)
    except NoText as refusal:
        if parameters.on_no_text != "keep":
            raise
        found = keep_photo(photo.pixels, refusal)
    with timed("quality", found.timings_ms):
        quality = describe_quality(photo.pixels, found, photo.reduction)
    result = enlarge(found, photo.reduction)
    return _document(result, result, parameters, photo, quality), result.timings_ms


def _document(
    result: RectifyResult,
    view: RectifyResult,
    parameters: RectifyParameters,
    photo: PagePicture,
    quality: Quality | None,
) -> DescribedPage:
    """The description of `result`, with the picture and the sizes of `view`, which may be a reduced one."""
    height, width = result.image.shape[:2]
    scale = view.image.shape[1] / width
    page = measure_size(
        parameters.paper,
        result.corners,
        result.mesh,
        width,
        height,
        camera_assumed=result.camera.source == "assumed",
        seen=result.sheet_aspect,
        stretch=result.stretch,
    )
    if result.evidence.source == ("photo",) and parameters.paper == "auto":
        enlarged = _pixels_per_photo_pixel(result)
        page = size_of_photo(width, height, None if photo.dpi is None else photo.dpi * enlarged)
    dpi = None if page.dpi is None else page.dpi * scale
    exif_px = (
        photo.focal_length_px if photo.focal_length_px is None else photo.focal_length_px * photo.reduction
    )
    seen = seen_focal_length(PhotoFrame(*photo.size), result.camera, parameters, exif_px)
    answer = describe_rectification(in_pixels_of_file(view, photo.stretch), photo.size)
    answer.camera.name = parameters.camera
    answer.camera.page_focal_length_px = rounded(seen and seen[0], 2)
    answer.camera.page_focal_deviation = rounded(seen and seen[1])
    # A reduced view shows the turn less well.
    turn = turn_against_photo(in_pixels_of_file(result, photo.stretch).mesh)
    answer.orientation = describe_orientation(result.orientation, turn)
    answer.page = answers.PageSize(**asdict(replace(page, dpi=rounded(dpi, 1))))
    answer.quality = quality
    answer.timings_ms = describe_timings(result.timings_ms)
    if dpi is None and photo.dpi is not None:
        dpi = photo.dpi * _pixels_per_photo_pixel(view)
    return DescribedPage(view.image, answer, None, dpi)


def _pixels_per_photo_pixel(view: RectifyResult) -> float:
    """Median length of a step on the flat view over that in the photo: small print is drawn larger."""
    height, width = view.image.shape[:2]
    rows, columns = view.mesh.shape[:2]
    across = np.linalg.norm(np.diff(view.mesh, axis=1), axis=2) / ((width - 1) / (columns - 1))
    down = np.linalg.norm(np.diff(view.mesh, axis=0), axis=2) / ((height - 1) / (rows - 1))
    return 1 / max(float(np.nanmedian(np.concatenate([across.ravel(), down.ravel()]))), 1e-9)


def describe_flat_page(result: RectifyResult, photo_size: tuple[int, int]) -> FlatPage:
    """Where the flat page lies in the photo of `photo_size` (width, height): sizes, corners, orientation and mesh."""
    height, width = result.image.shape[:2]
    corners: list[Point | None] = [None] * 4
    if result.corners is not None:
        corners = [_rounded_point(each, 2) for each in result.corners]
    rows, columns = result.mesh.shape[:2]
    # A thousandth of a pixel; 17 digits would triple the JSON.
    mesh = Mesh(rows=rows, columns=columns, source=np.round(result.mesh, 3).tolist())
    return FlatPage(
        photo=Size(width=photo_size[0], height=photo_size[1]),
        corners=corners,
        orientation=describe_orientation(result.orientation, turn_against_photo(result.mesh)),
        width=width,
        height=height,
        mesh=mesh,
    )


def describe_rectification(result: RectifyResult, photo_size: tuple[int, int]) -> answers.RectifyResult:
    """The answer about a page, without timings and image; degrees, pixels of the EXIF-upright photo."""
    evidence, camera = result.evidence, result.camera
    field_of_view_rad = camera.field_of_view_rad
    flat = describe_flat_page(result, photo_size)
    return answers.RectifyResult(
        kind=result.kind,
        evidence=answers.Evidence(
            major_convergence=rounded(evidence.major_convergence, 6),
            minor_convergence=rounded(evidence.minor_convergence, 6),
            text_area_fraction=round(evidence.text_area_fraction, 4),
            source=list(evidence.source),
            outline_confidence=rounded(evidence.outline_confidence),
            sides_seen=evidence.sides_seen,
            print_kept=rounded(evidence.print_kept),
            flatness_error_percent=rounded(evidence.flatness_error_percent, 2),
        ),
        camera=answers.Camera(
            focal_length_px=rounded(camera.focal_length_px, 2),
            field_of_view_deg=rounded(field_of_view_rad and math.degrees(field_of_view_rad), 3),
            source=camera.source,
            principal_point=camera.principal_point and _rounded_point(camera.principal_point),
            principal_point_source=camera.principal_point_source,
        ),
        surface=_describe_surface(result.surface),
        **{name: getattr(flat, name) for name in FlatPage.model_fields},
        warnings=describe_warnings(result.warnings),
        timings_ms={},
    )


def _describe_surface(surface: Surface) -> answers.Plane | answers.CreasedSheet | answers.Strips:
    match surface:
        case PlaneSurface(normal):
            return answers.Plane(normal=normal)
        case MeshSurface(points, normals):
            rows, columns = points.shape[:2]
            return answers.CreasedSheet(
                rows=rows,
                columns=columns,
                points=np.round(points, 2).tolist(),
                normals=np.round(normals, 4).tolist(),
            )
        case StripsSurface(normals, points, angles_rad, vanishing_points):
            rulings = [
                answers.Ruling(
                    point=np.round(point, 3).tolist(),
                    angle_deg=round(float(np.degrees(angle)), 4),
                    vanishing_point=_finite_point(vanishing_point),
                )
                for point, angle, vanishing_point in zip(points, angles_rad, vanishing_points, strict=True)
            ]
            return answers.Strips(normals=np.round(normals, 6).tolist(), rulings=rulings)


def _rounded_point(point: Iterable[float], decimals: int = 3) -> Point | None:
    """(x, y) with `decimals`; None where it is not finite."""
    x, y = (float(value) for value in point)
    return (round(x, decimals), round(y, decimals)) if math.isfinite(x) and math.isfinite(y) else None


def _finite_point(homogeneous: Vector, limit_px: float = 1e7) -> Point | None:
    """(x, y) of a homogeneous point (3,); None at infinity or farther away than `limit_px`."""
    point, third = homogeneous[:2], float(homogeneous[2])
    if float(np.abs(point).max()) >= limit_px * abs(third):
        return None
    return _rounded_point(point / third)
