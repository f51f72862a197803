"""Pictures of a run: distributions of the errors, and photos before and after."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.figures import CaseFigures, Pick, mean_std
from services.arrays import RgbImage

SHEET_WIDTH_PX = 3000
"""Contact sheets are no wider."""
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


def draw_series(
    path: Path,
    columns: Mapping[str, Pick],
    rows: Mapping[str, Sequence[CaseFigures]],
    printed: Mapping[str, Sequence[tuple[float, float]]],
    axis_label: str,
) -> None:
    """One curve a column over the rows, with its spread; the dissertation's as a second curve.

    `printed` holds (mean, standard deviation) by column, one for each of the rows.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, math.ceil(len(columns) / 2), figsize=(13, 7), squeeze=False)
    for axis in axes.flat[len(columns) :]:
        axis.set_axis_off()
    places = np.arange(1, len(rows) + 1)
    for axis, (name, pick) in zip(axes.flat, columns.items(), strict=False):
        ours = [mean_std(map(pick, members)) for members in rows.values()]
        curves = {"ours": ours, "dissertation": printed.get(name, ())}
        for (label, curve), colour in zip(curves.items(), ("#4878a8", "#c03030"), strict=True):
            if len(curve) and any(math.isfinite(mean) for mean, _ in curve):
                means, spreads = np.array(curve).T
                axis.errorbar(places, means, spreads, label=label, color=colour, capsize=3, marker="o")
        axis.set_title(name, fontsize=10)
        axis.set_xlabel(axis_label)
        axis.set_xticks(places, [label.rpartition(".")[2] for label in rows])
        axis.set_ylim(bottom=0)
        if axis.has_data():
            axis.legend(fontsize=8)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


Curve = tuple[Sequence[float], Sequence[float]]
"""Places on the axis and values."""


def draw_panels(
    path: Path,
    panels: Mapping[str, Mapping[str, Curve]],
    colours: Mapping[str, str],
    axis_label: str,
    value_label: str,
    *,
    columns: int = 4,
    ticks: Sequence[float] = (),
) -> None:
    """Small multiples: one panel a name, with its curves in the colour of theirs, NaN left out; values from 0 on.

    `ticks` are the places of an axis that grows as 1 + logarithm (rounds); without them it grows evenly.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.artist import Artist

    columns = min(columns, max(1, len(panels)))
    rows = max(1, math.ceil(len(panels) / columns))
    figure, axes = pyplot.subplots(
        rows, columns, figsize=(4 * columns, 2.8 * rows), squeeze=False, layout="constrained"
    )
    for axis in axes.flat[len(panels) :]:
        axis.set_axis_off()
    for axis, (title, curves) in zip(axes.flat, panels.items(), strict=False):
        for name, (places, values) in curves.items():
            points = [
                (place, value) for place, value in zip(places, values, strict=True) if math.isfinite(value)
            ]
            style = "--" if name.startswith("(") else "-"
            axis.plot(
                *zip(*points, strict=True) if points else ((), ()),
                label=name,
                color=colours.get(name, "#888888"),
                linestyle=style,
                marker="o",
                markersize=3,
            )
        if ticks:
            axis.set_xscale("symlog", linthresh=1)
            most = max((max(places) for places, _ in curves.values() if len(places)), default=1)
            shown = [tick for tick in ticks if tick <= most]
            axis.set_xticks(shown, [f"{tick:g}" for tick in shown])
            axis.minorticks_off()
        axis.set_ylim(bottom=0)
        axis.set_title(title, fontsize=9)
    handles: dict[str, Artist] = {}
    for axis in axes.flat[: len(panels)]:
        handles.update(
            {label: handle for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
        )
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=6, fontsize=8)
    figure.supxlabel(axis_label, fontsize=9)
    figure.supylabel(value_label, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)
    pyplot.close(figure)


def make_strip(
    images: Sequence[RgbImage | None],
    captions: Sequence[str],
    *,
    title: str = "",
    height: int = _TILE_HEIGHT_PX,
) -> RgbImage:
    """Images side by side, `height` px high, each under its caption; None leaves a gray gap."""
    tiles = []
    for image, caption in zip(images, captions, strict=True):
        if image is None:
            tile = np.full((height, height * 5 // 7, 3), 200, np.uint8)
        else:
            width = max(1, round(image.shape[1] * height / image.shape[0]))
            size = (min(width, 4 * height), height)
            tile = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        framed = np.full((height + 34, tile.shape[1] + 10, 3), _PAPER, np.uint8)
        framed[26 : 26 + height, 5:-5] = tile
        _write(framed, caption)
        tiles.append(framed)
    strip = np.hstack(tiles)
    if title:
        strip = np.pad(strip, ((20, 0), (0, 0), (0, 0)), constant_values=_PAPER)
        _write(strip, title)
    return strip


def contact_sheet(strips: Sequence[RgbImage], most_px: int = SHEET_WIDTH_PX) -> RgbImage:
    """Strips in their order, as many beside each other as fit into `most_px`; a wider one is reduced."""
    rows: list[list[RgbImage]] = []
    used = 0
    for strip in strips:
        if strip.shape[1] > most_px:
            size = (most_px, max(1, round(strip.shape[0] * most_px / strip.shape[1])))
            fitting = np.asarray(cv2.resize(strip, size, interpolation=cv2.INTER_AREA), np.uint8)
        else:
            fitting = strip
        if not rows or used + fitting.shape[1] > most_px:
            rows.append([])
            used = 0
        rows[-1].append(fitting)
        used += fitting.shape[1]
    width = max(sum(strip.shape[1] for strip in row) for row in rows)
    return np.vstack([_padded(_row(row), width) for row in rows])


def _row(strips: Sequence[RgbImage]) -> RgbImage:
    """Side by side, the lower ones padded at their foot."""
    tallest = max(strip.shape[0] for strip in strips)
    return np.hstack(
        [
            np.pad(strip, ((0, tallest - strip.shape[0]), (0, 0), (0, 0)), constant_values=_PAPER)
            for strip in strips
        ]
    )


def _write(image: RgbImage, text: str) -> None:
    cv2.putText(image, text, (5, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 1, cv2.LINE_AA)


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
