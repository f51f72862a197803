"""The pictures of the README and of docs/, made from a simulated photo of a page that the project sets itself.

python -m benchmarks readme_pictures [FOLDER]
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.plots import make_strip, save_picture
from benchmarks.layout.table_picture import invoice_and_table
from benchmarks.mosaic.ghosts import shifted_photo
from services.arrays import RgbImage
from services.contract.mosaic import Composition, MosaicParameters
from services.contract.rectify import RectifyParameters
from services.geometry.vanishing_points import estimate_vanishing_point
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_from_document
from services.layout.pipeline import VersionedModel, complete_sample, initialize_model, read_page, recognize
from services.layout.rendering.overlay import draw_overlay
from services.mosaic.pipeline import mosaic
from services.operations.reader import ocr_engine
from services.rectify.analysis.page_analysis import analyse_photo
from services.rectify.pipeline import rectify
from services.sheet.surfaces import MeshSurface, StripsSurface
from services.texture_flow.field import FlowSamples
from simulation.degradation import PHONE
from simulation.folded import folded_in_thirds
from simulation.labelled_pages import LabelledPage, letter_page, memo_page, title_page
from simulation.letter_pages import colour_page
from simulation.mosaic_sets import MosaicSet, photograph_set
from simulation.pages import own_pages
from simulation.scenes import BOOK, POSES, photograph
from simulation.sheets import SHEET_ASPECT, SHEET_VIEWS, Staging, photograph_sheet, with_margins

SEED = 7
COLOURS = ((220, 60, 40), (40, 130, 60), (50, 90, 210), (170, 90, 190))
CLASSES: dict[str, Callable[[np.random.Generator], LabelledPage]] = {
    "letter": letter_page,
    "memo": memo_page,
    "title page": lambda rng: title_page(rng, "margin"),
}
COMPOSITIONS: tuple[Composition, ...] = ("average", "selective")


def before_and_after(photo: RgbImage) -> RgbImage:
    """The photo, its flat view, and the flat view in even light."""
    engine = ocr_engine()
    flat = rectify(photo, RectifyParameters(), None, engine).image
    even = rectify(photo, RectifyParameters(illumination="normalize"), None, engine).image
    return make_strip([photo, flat, even], ["photo", "POST /rectify", "... illumination=normalize"])


def curved_page(photo: RgbImage) -> RgbImage:
    """A curved page, its mesh and rulings drawn on the photo, and its flat view."""
    result = rectify(photo, RectifyParameters(illumination="normalize"), None, ocr_engine())
    assert isinstance(result.surface, StripsSurface)
    drawn = (0.6 * photo + 102).astype(np.uint8)
    for lines in (result.mesh[::4], result.mesh[:, ::4].transpose(1, 0, 2)):
        curves = [np.round(line).astype(np.int32) for line in lines]
        cv2.polylines(drawn, curves, False, (60, 130, 220), 2, cv2.LINE_AA)
    reach = 0.18 * max(photo.shape)
    rulings = zip(result.surface.points[::2], result.surface.angles_rad[::2], strict=True)
    for point, angle in rulings:
        way = reach * np.array([np.cos(angle), np.sin(angle)])
        start, end = (np.round(point + side * way).astype(int).tolist() for side in (-1, 1))
        cv2.line(drawn, start, end, (220, 40, 40), 3, cv2.LINE_AA)
    return make_strip([photo, drawn, result.image], ["photo", "rulings and mesh", "POST /rectify"])


def creased_sheet() -> RgbImage:
    """A letter that was folded in three, the mesh between its sides drawn on the photo, and its flat view."""
    sheet = with_margins(own_pages()[0])
    shape = folded_in_thirds(SHEET_ASPECT, 24.0, -18.0)
    rng = np.random.default_rng(SEED)
    photo = photograph_sheet(sheet, SHEET_VIEWS[2], shape, Staging(), dirt=PHONE, rng=rng).image
    result = rectify(photo, RectifyParameters(illumination="normalize"), None, ocr_engine())
    assert isinstance(result.surface, MeshSurface)
    drawn = (0.6 * photo + 102).astype(np.uint8)
    nodes = np.round(result.surface.points).astype(np.int32)
    for lines in (nodes[::2], nodes[:, ::2].transpose(1, 0, 2)):
        curves = [np.ascontiguousarray(line) for line in lines]
        cv2.polylines(drawn, curves, False, (60, 130, 220), 2, cv2.LINE_AA)
    rim = np.concatenate([nodes[0], nodes[1:, -1], nodes[-1, -2::-1], nodes[-2:0:-1, 0]])
    cv2.polylines(drawn, [np.ascontiguousarray(rim)], True, (220, 40, 40), 5, cv2.LINE_AA)
    return make_strip([photo, drawn, result.image], ["photo", "outline and mesh", "POST /rectify"])


def texture_flow(photo: RgbImage) -> RgbImage:
    """Text, major flow and minor flow drawn on the photo."""
    analysis = analyse_photo(photo)
    assert analysis.minor is not None
    size = (photo.shape[1], photo.shape[0])
    area = cv2.resize(analysis.text.area.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    tinted = photo.copy()
    tinted[area] = (0.6 * tinted[area] + 0.4 * np.array([120, 200, 255])).astype(np.uint8)
    length = 3.0 * analysis.text_height_px
    major, minor = (draw_flow(photo, samples, length) for samples in (analysis.major, analysis.minor))
    return make_strip([tinted, major, minor], ["text", "major flow", "minor flow"])


def draw_flow(photo: RgbImage, samples: FlowSamples, length_px: float) -> RgbImage:
    """The samples as short strokes, green where they meet in the vanishing point and red where they do not."""
    canvas = (0.5 * photo + 127).astype(np.uint8)
    meets = estimate_vanishing_point(samples.points / 1000, samples.angles, samples.weights).inliers
    offset = 0.5 * length_px * np.stack([np.cos(samples.angles), np.sin(samples.angles)], axis=1)
    ends = np.round(np.stack([samples.points - offset, samples.points + offset], axis=1)).astype(int)
    for (start, end), good in zip(ends, meets, strict=True):
        colour = (0, 150, 60) if good else (220, 40, 40)
        cv2.line(canvas, start.tolist(), end.tolist(), colour, max(int(length_px / 12), 2), cv2.LINE_AA)
    return canvas


def four_photos(made: MosaicSet) -> RgbImage:
    """The photos of a page, where each of them came to lie, and the page."""
    result = mosaic(made.images, MosaicParameters(), None, ocr_engine())
    side = max(max(image.shape[:2]) for image in made.images)
    tiles = [
        cv2.copyMakeBorder(
            image, 0, side - image.shape[0], 0, side - image.shape[1], cv2.BORDER_CONSTANT, value=(255,) * 3
        )
        for image in made.images
    ]
    photos = np.vstack([np.hstack(tiles[:2]), np.hstack(tiles[2:])])
    drawn = (0.4 * result.image + 153).astype(np.uint8)
    for patch, colour in zip(result.patches, COLOURS, strict=True):
        assert patch.mesh is not None
        mesh = patch.mesh
        border = np.concatenate([mesh[0], mesh[1:, -1], mesh[-1, -2::-1], mesh[-2:0:-1, 0]])
        cv2.polylines(drawn, [np.round(border).astype(np.int32)], True, colour, 14, cv2.LINE_AA)
    captions = ["photos", "where they lie", "POST /mosaic"]
    return make_strip([np.asarray(photos, np.uint8), drawn, result.image], captions)


def ghosts(made: MosaicSet) -> RgbImage:
    """A detail of both compositions when one photo is laid three pixels beside its place on purpose."""
    details = []
    for composition in COMPOSITIONS:
        with shifted_photo(1, (2.2, 2.0)):
            parameters = MosaicParameters(composition=composition, upright=False)
            page = mosaic(made.images, parameters, None, None).image
        row, column = round(0.5 * page.shape[0]), round(0.5 * page.shape[1])
        details.append(page[row - 150 : row + 150, column - 300 : column + 300])
    captions = [f"one photo shifted by 3 px, composition={name}" for name in COMPOSITIONS]
    return make_strip(details, captions, height=300)


def labelled_pages() -> RgbImage:
    """Pages of three classes with their class and labels, by models of three samples each."""
    engine = ocr_engine()
    seen, models = {}, []
    for seed, (name, draw) in enumerate(CLASSES.items()):
        rng = np.random.default_rng(SEED + seed)
        pages = [draw(rng) for _ in range(4)]
        images = [np.repeat(page.image[..., None], 3, axis=2) for page in pages if page.image is not None]
        samples = [page_from_document(page.document(), ExchangeLimits()) for page in pages[:3]]
        taught = [
            complete_sample(sample, image, engine) for sample, image in zip(samples, images[:3], strict=True)
        ]
        model = initialize_model(name, [each for each, _ in taught], found=[found for _, found in taught])
        models.append(VersionedModel(model, 1))
        seen[name] = images[3]
    drawn = [draw_overlay(image, recognize(read_page(image, engine), models)) for image in seen.values()]
    return make_strip(drawn, [f"POST /layout: a {name}" for name in seen], height=1000)


def main(arguments: Sequence[str] = ()) -> int:
    """Write the pictures into the folder that is named, else docs/pictures."""
    folder = Path(arguments[0]) if arguments else Path(__file__).parent.parent / "docs" / "pictures"
    page = own_pages()[2]
    photo = photograph(page, POSES[3], 0.0, dirt=PHONE, rng=np.random.default_rng(SEED)).image
    bent = photograph(own_pages()[0], POSES[1], 0.0, BOOK, dirt=PHONE, rng=np.random.default_rng(SEED)).image
    made = photograph_set(colour_page(), 4, 0.3, np.random.default_rng(SEED))
    pictures = {
        "before-after": before_and_after(photo),
        "curved-page": curved_page(bent),
        "creased-sheet": creased_sheet(),
        "texture-flow": texture_flow(photo),
        "mosaic": four_photos(made),
        "ghosts": ghosts(made),
        "labelled-pages": labelled_pages(),
        "invoice-table": invoice_and_table(),
    }
    for name, picture in pictures.items():
        save_picture(folder / f"{name}.jpg", picture)
        print(folder / f"{name}.jpg")
    return 0
