"""Words of a mosaic that come from more than one photo: doubled where these disagree, or broken between them."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from benchmarks.mosaic.errors import Mesh, mesh_at
from services.arrays import RgbImage
from services.geometry.homographies import translation
from services.mosaic import pipeline
from simulation.mosaic_sets import MosaicSet

MIXED_FROM = 0.2
"""A word of which more than this share is another photo's than the one it is most of counts as mixed."""
_SMALLEST_WORD_PX = 8
_INNER_PX = 1.0
"""Words this near to a photo's border are not wholly in it."""


@dataclass(frozen=True, slots=True)
class WordMixture:
    """Over the words that several photos show whole: how many there are, how many are mixed, the mean share."""

    words: int
    mixed: int
    mean_share: float


@contextmanager
def shifted_photo(index: int, shift_px: tuple[float, float]) -> Iterator[None]:
    """Within, photo `index` is composed `shift_px` mosaic pixels beside the place that was found for it."""
    compose: Callable[..., Any] = pipeline.compose_page  # type: ignore[attr-defined]

    def compose_shifted(placed: Sequence[Any], *further: Any, **named: Any) -> Any:
        moved = [
            replace(one, placement=one.placement.within(translation(*shift_px)))
            if one.flat.index == index
            else one
            for one in placed
        ]
        return compose(moved, *further, **named)

    pipeline.compose_page = compose_shifted  # type: ignore[attr-defined]
    try:
        yield
    finally:
        pipeline.compose_page = compose  # type: ignore[attr-defined]


def measure_mixture(
    page: RgbImage,
    made: MosaicSet,
    meshes: Sequence[Mesh | None],
    shift: tuple[int, tuple[float, float]] | None = None,
) -> WordMixture:
    """Words of the mosaic `page`, explained by the photos that show them.

    Each photo is drawn where its mesh, and its injected `shift` (photo, pixels), say. A word's grays are fitted
    by those of all photos that show it whole, and an offset; a photo's share is its coefficient times its
    contrast. With a shifted photo, only the words that it shows are counted, and its share is held against
    all others' together: these lie on each other, and who of them it was cannot be told.
    """
    gray = np.asarray(cv2.cvtColor(page, cv2.COLOR_RGB2GRAY), np.float64)
    H = [_photo_from_mosaic(made, k, mesh, shift) for k, mesh in enumerate(meshes)]
    drawn = [None if there is None else _draw(made.images[k], there, gray.shape) for k, there in enumerate(H)]
    shares = []
    for word in (word for line in made.page.lines for word in line):
        x0, y0, x1, y1 = word.box
        if min(x1 - x0, y1 - y0) < _SMALLEST_WORD_PX:
            continue
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        showing = [k for k in range(len(meshes)) if drawn[k] is not None and _is_whole(made, k, corners)]
        if len(showing) < 2 or (shift is not None and shift[0] not in showing):
            continue
        place = _place(made, meshes[showing[0]], showing[0], corners)
        low, high = np.floor(place.min(axis=0)).astype(int), np.ceil(place.max(axis=0)).astype(int) + 1
        if np.any(low < 0) or np.any(high > gray.shape[::-1]):
            continue
        window = (slice(low[1], high[1]), slice(low[0], high[0]))
        apart = None if shift is None else showing.index(shift[0])
        share = mixed_share(gray[window], [drawn[k][window] for k in showing], apart)  # type: ignore[index]
        if share is not None:
            shares.append(share)
    mixed = sum(share > MIXED_FROM for share in shares)
    return WordMixture(len(shares), mixed, float(np.mean(shares)) if shares else float("nan"))


def mixed_share(
    word: NDArray[np.float64], photos: Sequence[NDArray[np.float64]], apart: int | None = None
) -> float | None:
    """Share of the word's contrast that is not of the photo it is most of, 0-1; None where there is no contrast.

    With `apart`, the smaller one of that photo's share and of all others'.

    Coefficients are non-negative: what two photos agree on cannot be had by taking one from the other.
    """
    columns = [photo.ravel() - photo.mean() for photo in photos]
    contrasts = np.array([float(np.std(column)) for column in columns])
    if contrasts.min() < 1e-6 or np.std(word) < 1e-6:
        return None
    design = np.stack(
        [column / contrast for column, contrast in zip(columns, contrasts, strict=True)], axis=1
    )
    weights, _ = nnls(design, word.ravel() - word.mean())
    total = float(weights.sum())
    if total <= 0:
        return None
    most = float(weights.max() if apart is None else max(weights[apart], total - weights[apart]))
    return 1.0 - most / total


def _photo_from_mosaic(
    made: MosaicSet, k: int, mesh: Mesh | None, shift: tuple[int, tuple[float, float]] | None
) -> NDArray[np.float64] | None:
    """Homography mosaic -> photo of a flat page's photo, by the nodes of the mesh that show the page."""
    if mesh is None:
        return None
    rows, columns = mesh.shape[:2]
    height, width = made.images[k].shape[:2]
    grid = np.stack(
        np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows)), axis=-1
    )
    photo, mosaic = grid.reshape(-1, 2), mesh.reshape(-1, 2)
    known = made.photos[k].truth.on_page(photo) & np.isfinite(mosaic).all(axis=1)
    H, _ = cv2.findHomography(mosaic[known], photo[known], 0)
    back = translation(-shift[1][0], -shift[1][1]) if shift is not None and shift[0] == k else np.eye(3)
    return np.asarray(H @ back, np.float64)


def _draw(
    photo: RgbImage, H_photo_mosaic: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    gray = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpPerspective(gray, H_photo_mosaic, (shape[1], shape[0]), flags=flags), np.float64
    )


def _is_whole(made: MosaicSet, k: int, corners: NDArray[np.float64]) -> bool:
    seen = made.photos[k].truth.page_to_photo(corners)
    height, width = made.images[k].shape[:2]
    with np.errstate(invalid="ignore"):
        return bool(np.all((seen > _INNER_PX) & (seen < [width - 1 - _INNER_PX, height - 1 - _INNER_PX])))


def _place(made: MosaicSet, mesh: Mesh | None, k: int, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    assert mesh is not None
    height, width = made.images[k].shape[:2]
    return mesh_at(mesh, made.photos[k].truth.page_to_photo(corners), width, height)


def mosaic_scale(made: MosaicSet, meshes: Sequence[Mesh | None]) -> float:
    """Mosaic pixels per page pixel in the middle of the first photo that was placed."""
    k = next(k for k, mesh in enumerate(meshes) if mesh is not None)
    mesh = meshes[k]
    assert mesh is not None
    height, width = made.images[k].shape[:2]
    middle = made.photos[k].truth.photo_to_page(np.array([[(width - 1) / 2, (height - 1) / 2]]))
    ends = np.concatenate([middle, middle + np.array([10.0, 0.0])])
    place = mesh_at(mesh, made.photos[k].truth.page_to_photo(ends), width, height)
    return float(np.linalg.norm(place[1] - place[0]) / 10.0)
