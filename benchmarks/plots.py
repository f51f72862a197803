"""Pictures of a run: distributions of the errors, and photos before and after."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from benchmarks.figures import CaseFigures, Pick
from services.arrays import RgbImage

_TILE_HEIGHT_PX = 420
_PAPER = 245


def draw_distributions(
    path: Path, columns: Mapping[str, Pick], cases: Sequence[CaseFigures], limits: Mapping[str, float]
) -> None:
    """One histogram a column, with the mean and the wanted limit where there is one."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, math.ceil(len(columns) / 2), figsize=(13, 6), squeeze=False)
    for axis in axes.flat:
        axis.set_axis_off()
    for axis, (name, pick) in zip(axes.flat, columns.items(), strict=False):
        values = [value for value in map(pick, cases) if math.isfinite(value)]
        axis.set_axis_on()
        axis.set_title(name, fontsize=10)
        if not values:
            continue
        axis.hist(values, bins=20, color="#4878a8")
        axis.axvline(float(np.mean(values)), color="black", label=f"mean {np.mean(values):.2f}")
        if name in limits:
            axis.axvline(limits[name], color="#c03030", linestyle="--", label=f"wanted {limits[name]:g}")
        axis.legend(fontsize=8)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def make_strip(images: Sequence[RgbImage | None], captions: Sequence[str]) -> RgbImage:
    """Images side by side, one height, each under its caption; None leaves a gray gap."""
    tiles = []
    for image, caption in zip(images, captions, strict=True):
        if image is None:
            tile = np.full((_TILE_HEIGHT_PX, 300, 3), 200, np.uint8)
        else:
            width = max(1, round(image.shape[1] * _TILE_HEIGHT_PX / image.shape[0]))
            size = (min(width, 4 * _TILE_HEIGHT_PX), _TILE_HEIGHT_PX)
            tile = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        framed = np.full((_TILE_HEIGHT_PX + 34, tile.shape[1] + 10, 3), _PAPER, np.uint8)
        framed[26 : 26 + _TILE_HEIGHT_PX, 5:-5] = tile
        cv2.putText(framed, caption, (5, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 1, cv2.LINE_AA)
        tiles.append(framed)
    return np.hstack(tiles)


def stack_strips(strips: Sequence[RgbImage], columns: int = 1) -> RgbImage:
    """A contact sheet: strips down the page, in `columns` columns."""
    rows = []
    for start in range(0, len(strips), columns):
        row = list(strips[start : start + columns])
        rows.append(np.hstack([_padded(strip, max(s.shape[1] for s in strips)) for strip in row]))
    width = max(row.shape[1] for row in rows)
    return np.vstack([_padded(row, width) for row in rows])


def save_picture(path: Path, image: RgbImage) -> None:
    """Write an RGB picture in the format of the path's suffix."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), image[..., ::-1])


def load_picture(path: Path) -> RgbImage:
    """Read an RGB picture, turned upright by its EXIF orientation.

    Raises
    ------
    OSError
        When it cannot be read.
    """
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise OSError(f"{path} cannot be read as a picture")
    return np.ascontiguousarray(np.asarray(image, np.uint8)[..., ::-1])


def _padded(strip: RgbImage, width: int) -> RgbImage:
    return np.pad(strip, ((0, 0), (0, width - strip.shape[1]), (0, 0)), constant_values=_PAPER)
