"""Later answers about kept pages: other turns, margins, looks and parts by what is kept, other corners anew."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from services.arrays import Points, RgbImage
from services.contract.answers.rectify import RectifyResult
from services.contract.images import Encoding, ImageLimits, PageReply
from services.contract.kept_pages import (
    FlatJson,
    KeptPage,
    KeptPageJson,
    PageReading,
    PageWish,
    RenderedPage,
    WishJson,
)
from services.contract.rectify import Crop, Illumination, RectifyParameters
from services.geometry.homographies import to_resized, transform_points
from services.geometry.page_frame import Frame, mesh_of, turn_against_photo, turn_frame, turning
from services.imaging.codec import DEFAULT_DPI, DEFAULT_QUALITY, decode_image, encode_image, jpeg_size, pdf_of
from services.imaging.looks import scanner_look
from services.imaging.normalization import normalize_illumination
from services.imaging.page_files import PagePart
from services.imaging.page_images import page_picture
from services.imaging.square_pixels import square_pixels
from services.operations.kept_text import ShownPart, keep_text, kept_text, shown_part, text_of, wanted_reading
from services.operations.page_bundle import PageBundle, open_bundle
from services.operations.page_reading import READING_CUT
from services.operations.pages_reply import (
    DescribedPage,
    EncodedPage,
    PagesTarget,
    bind_pages,
    choose_target,
    encode_page,
    make_page_reply,
)
from services.operations.rectify import flatten_picture
from services.operations.reduced_views import reduce_picture, reduced_size
from services.operations.replies import SourceFacts, describe_warnings, rounded, timed
from services.rectify.view.drawing import draw_flat_view
from services.rectify.view.held_corners import with_margin
from services.rectify.view.view_plan import PlannedView, unpack_plan

TURNED_SINCE = " It was turned by a quarter after that."
"""About the reason of its size, which speaks of the page as it was found."""
OWN = ImageLimits(max_megapixels=1000.0)
"""Of pictures that this service has made: views may be larger than the photos of a request."""


def render_kept_page(
    kept: KeptPage, wish: PageWish, encoding: Encoding, reading: PageReading | None = None
) -> tuple[PageReply, RenderedPage]:
    """The answer about a kept page with what the person wishes, and what is to be kept from now on.

    With `reading` the answer has the text of the page, which is kept too.

    Raises
    ------
    InvalidOption
        When the corners are those of no sheet in its photo, `encoding` is not possible, or the language is not
        installed.
    """
    reading = wanted_reading(reading)
    timings_ms: dict[str, float] = {}
    bundle = open_bundle(kept.bundle)
    if wish.corners is not None:
        with timed("analysis", timings_ms):
            kept = analyse_again(kept, bundle, wish)
        wish, bundle, packed = PageWish(), open_bundle(kept.bundle), kept.bundle
    else:
        packed = b""
    view = wished_view(kept.document, bundle, wish)
    page, source = draw_kept(kept, bundle, view, encoding, timings_ms, reading)
    changed = RenderedPage(_wished(kept.document, wish, view), packed)
    return make_page_reply(page, source, encoding, timings_ms), changed


def bind_kept_pages(
    pages: Sequence[KeptPage], encoding: Encoding, reading: PageReading | None = None
) -> PageReply:
    """One file of kept pages, each as it was last answered; with `reading`, with their texts.

    A page whose text is kept is not read again.

    Raises
    ------
    InvalidOption
        When the language is not installed.
    """
    reading = wanted_reading(reading)
    timings_ms: dict[str, float] = {}
    encoded: list[EncodedPage] = []
    target = choose_target(encoding, SourceFacts(pages[0].document["format"], None, None), len(pages))
    for kept in pages:
        bundle = open_bundle(kept.bundle)
        view = wished_view(kept.document, bundle, PageWish())
        page = encoded_as_kept(kept, bundle, view, target, encoding, reading)
        if page is None:
            drawn, source = draw_kept(kept, bundle, view, encoding, timings_ms, reading)
            page = encode_page(drawn, target, source, encoding)
        encoded.append(page)
    return bind_pages(encoded, target, encoding, timings_ms)


def show_kept_photo(bundle: bytes, width: int | None) -> bytes:
    """The photo of a kept page as JPEG, turned as its EXIF says and without its metadata, at most `width` wide."""
    photo = decode_image(open_bundle(bundle).photo, OWN)
    size = reduced_size(photo.pixels.shape[1], photo.pixels.shape[0], width, None)
    return encode_image(reduce_picture(photo.pixels, *size), "jpeg", icc_profile=photo.icc_profile)


def analyse_again(kept: KeptPage, bundle: PageBundle, wish: PageWish) -> KeptPage:
    """The page between other corners, or those that are found: its shape is found anew in the kept photo."""
    options, said = kept.document["options"], kept.document["wish"]
    options = {
        **options,
        "margin": wish.margin or said.get("margin", options["margin"]),
        "illumination": wish.illumination or said.get("illumination", options["illumination"]),
        "crop": wish.crop or said.get("crop", options["crop"]),
    }
    turn = wish.rotate if isinstance(wish.rotate, int) else None
    asked = RectifyParameters(
        **options,
        corners=(None if wish.corners == "auto" else wish.corners,),
        rotate=(turn,),
        keep_photo=True,
        on_no_text="keep",
    )
    picture = page_picture(decode_image(bundle.photo, OWN))._replace(
        origin=kept.origin(), original=bundle.photo
    )
    (page,) = flatten_picture(picture, asked, Encoding())
    assert page.kept is not None
    return page.kept


@dataclass(frozen=True, slots=True, eq=False)
class WishedView:
    """What a person wishes to see of a kept page: `frame` is that of the `planned` view, `turned`, with its margin.

    `is_first` tells whether it shows the part that the first picture shows, perhaps turned by `quarters`; `is_lit`
    whether that has even light already. `dpi` is its resolution at full size.
    """

    planned: PlannedView
    turned: Frame
    frame: Frame
    look: Illumination
    turn: int
    quarters: int
    part: ShownPart
    is_first: bool
    is_lit: bool
    dpi: float | None

    @property
    def is_of_picture(self) -> bool:
        """Whether it is made of the first picture."""
        return self.is_first and (self.look != "keep" or not self.is_lit)

    @property
    def is_picture(self) -> bool:
        """Whether it is the first picture."""
        return (
            self.is_of_picture and not self.quarters and self.look == ("normalize" if self.is_lit else "keep")
        )

    def mesh(self, document: KeptPageJson) -> NDArray[np.float64]:
        """Points (rows, columns, 2) of the photo file."""
        stretch = np.array(document["stretch"])
        return np.asarray(to_resized(mesh_of(self.frame), 1 / stretch), np.float64)


def wished_view(document: KeptPageJson, bundle: PageBundle, wish: PageWish) -> WishedView:
    """The view that `wish`, and what was said before, ask for."""
    options, found = document["options"], document["answer"]["orientation"]
    before = PageWish(**document["wish"])
    wish = PageWish(
        **{
            name: value if value is not None else getattr(before, name)
            for name, value in asdict(wish).items()
        }
    )
    crop: Crop = wish.crop or options["crop"]
    margin = options["margin"] if wish.margin is None else wish.margin
    turn = _turn(wish, document)
    views = unpack_plan(bundle.plan).views
    turned = turn_frame(views[crop].frame, turn, found["mirrored"])
    dpi = document["dpi"]
    if dpi is not None and crop != options["crop"]:
        own = _pixels_per_photo_pixel(views[options["crop"]].frame)
        dpi *= _pixels_per_photo_pixel(views[crop].frame) / own
    return WishedView(
        views[crop],
        turned,
        with_margin(turned, margin),
        wish.illumination or options["illumination"],
        turn,
        (turn - found["rotation_deg"]) // 90 % 4,
        shown_part(crop, margin, turn, bundle.plan),
        crop == options["crop"] and margin == options["margin"],
        options["illumination"] != "keep",
        dpi,
    )


def encoded_as_kept(
    kept: KeptPage,
    bundle: PageBundle,
    view: WishedView,
    target: PagesTarget,
    encoding: Encoding,
    reading: PageReading | None,
) -> EncodedPage | None:
    """The page in a file that takes its kept picture as it is; None where the picture, or its text, must be made."""
    is_jpeg = target.format == "pdf" or (target.format == "zip" and target.image_format == "jpeg")
    if not is_jpeg or not view.is_picture or encoding.quality not in (None, DEFAULT_QUALITY):
        return None
    width, height = jpeg_size(bundle.picture)
    if reduced_size(width, height, encoding.max_width, encoding.max_height) != (width, height):
        return None
    text = None if reading is None else kept_text(kept.document, view.part, reading)
    if reading is not None and text is None:
        return None
    answer = _described(kept.document, (height, width), view)
    if text is not None and text.cut:
        answer.warnings += describe_warnings((READING_CUT,))
    data = pdf_of(bundle.picture, view.dpi) if target.format == "pdf" else bundle.picture
    return EncodedPage(PagePart(data, view.dpi or DEFAULT_DPI), answer, text, view.dpi or DEFAULT_DPI)


def draw_kept(
    kept: KeptPage,
    bundle: PageBundle,
    view: WishedView,
    encoding: Encoding,
    timings_ms: dict[str, float],
    reading: PageReading | None = None,
) -> tuple[DescribedPage, SourceFacts]:
    """The `view` of the page, its description, and the facts of its photo.

    With `reading` it has its text, which is put into the document of `kept`.
    """
    document = kept.document
    frame, lit = view.frame, view.is_lit
    if view.is_of_picture:
        with timed("decode", timings_ms):
            picture = decode_image(bundle.picture, OWN)
        flat, icc_profile = (
            np.ascontiguousarray(np.rot90(picture.pixels, -view.quarters)),
            picture.icc_profile,
        )
    else:
        with timed("decode", timings_ms):
            photo = square_pixels(page_picture(decode_image(bundle.photo, OWN)))
        lit, icc_profile = False, photo.icc_profile
        with timed("remap", timings_ms):
            flat = draw_flat_view(photo.pixels, frame, None if view.part.margin > 0 else view.planned.paper)
    if view.look != "keep" and not lit:
        with timed("illumination", timings_ms):
            flat = normalize_illumination(flat, _places(view, document["answer"]["orientation"]["mirrored"]))
    text = None
    if reading is not None:
        with timed("reading", timings_ms):
            text = text_of(document, view.part, flat, reading, view.mesh(document), kept.origin())
        keep_text(document, view.part, text)
    frame, flat, dpi = _reduced(frame, flat, view.dpi, encoding)
    described = _described(document, flat.shape, replace(view, frame=frame, dpi=dpi))
    if text is not None:
        text = text.resized(flat.shape[1], flat.shape[0])
        described.warnings += describe_warnings((READING_CUT,) if text.cut else ())
    facts = SourceFacts(document["format"], dpi, icc_profile)
    return DescribedPage(scanner_look(flat, view.look), described, text, dpi), facts


def _wished(document: KeptPageJson, wish: PageWish, view: WishedView) -> KeptPageJson:
    """The kept `document` with what the person wishes from now on, and sees: a `view` of full size.

    How its picture was made stays.
    """
    wished = {name: value for name, value in asdict(wish).items() if value is not None and name != "corners"}
    if not wished:
        return document
    answer = _described(document, (view.frame.height, view.frame.width), view)
    shown = answer.model_dump(mode="json", exclude={"page_id", "image", "image_media_type", "text"})
    wish_json = cast(WishJson, {**document["wish"], **wished})
    return {**document, "wish": wish_json, "shown": cast(FlatJson, shown)}


def _described(document: KeptPageJson, shape: tuple[int, ...], view: WishedView) -> RectifyResult:
    """The later answer about a `view` without timings and picture: sizes, mesh and turn are its own."""
    answer, quarters, mesh = document["answer"], view.quarters, view.mesh(document)
    orientation = {
        **answer["orientation"],
        "rotation_deg": view.turn,
        "photo_rotation_deg": round(turn_against_photo(np.asarray(mesh_of(view.frame), np.float64)), 1) % 360,
    }
    corners = answer["corners"][-quarters:] + answer["corners"][:-quarters] if quarters else answer["corners"]
    page = answer["page"]
    if page is not None:
        page = {**page, "dpi": rounded(view.dpi, 1) if page["dpi"] is not None else None}
        if quarters % 2:
            page["width_mm"], page["height_mm"] = page["height_mm"], page["width_mm"]
            page["aspect"] = page["aspect"] and rounded(1 / page["aspect"])
            page["reason"] += TURNED_SINCE
    changed = {
        "orientation": orientation,
        "corners": corners,
        "page": page,
        "width": shape[1],
        "height": shape[0],
        "mesh": {
            "rows": mesh.shape[0],
            "columns": mesh.shape[1],
            "source": np.round(mesh, 3).tolist(),
        },
        "timings_ms": {},
    }
    return RectifyResult.model_validate({**answer, **changed})


def _reduced(
    frame: Frame, flat: RgbImage, dpi: float | None, encoding: Encoding
) -> tuple[Frame, RgbImage, float | None]:
    """The view within the size limits of `encoding`, and its resolution."""
    width, height = reduced_size(frame.width, frame.height, encoding.max_width, encoding.max_height)
    if (width, height) == (frame.width, frame.height):
        return frame, flat, dpi
    across, down = frame.width / width, frame.height / height
    H = np.array([[across, 0, 0.5 * across - 0.5], [0, down, 0.5 * down - 0.5], [0, 0, 1]])
    return (
        frame.through(H, width, height),
        reduce_picture(flat, width, height),
        None if dpi is None else dpi / across,
    )


def _places(view: WishedView, mirrored: bool) -> Points | None:
    """Places (N, 2) of the text in the view with its margin."""
    planned, turned = view.planned, view.turned
    if planned.characters is None:
        return None
    H, _, _ = turning(planned.frame.width, planned.frame.height, view.turn, mirrored)
    margin = np.array([view.frame.width - turned.width, view.frame.height - turned.height]) / 2
    return transform_points(np.linalg.inv(H), planned.characters) + margin


def _pixels_per_photo_pixel(frame: Frame) -> float:
    mesh = mesh_of(frame, 9, 9)
    steps = np.linalg.norm(np.diff(mesh, axis=1), axis=2)
    return (frame.width - 1) / 8 / max(float(np.median(steps)), 1e-9)


def _turn(wish: PageWish, document: KeptPageJson) -> int:
    if wish.rotate is None:
        return document["answer"]["orientation"]["rotation_deg"]
    return int(document["rotation_found"] if wish.rotate == "auto" else wish.rotate)
