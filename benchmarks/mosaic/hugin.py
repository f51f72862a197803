"""Hugin's command line tools on photos of one flat thing from several places (its "mosaic mode")."""

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.peers import TIME_LIMIT_S, run_limited
from benchmarks.common.stopwatch import Usage
from benchmarks.mosaic.errors import Mesh, photo_nodes
from services.arrays import RgbImage

_PLACING = ("pto_gen", "cpfind", "cpclean", "pto_var", "autooptimiser", "pano_modify", "pano_trafo")
_DRAWING = ("nona", "enblend")
_SIDE_PX = 1000
"""Long side of the photos that it is given: on letters of full size its points match nothing."""
_FIELD_OF_VIEW = 60
"""Degrees, to begin with: no photo says its own, and one for all is optimized."""


def is_here() -> bool:
    """Whether all of its tools are on the PATH."""
    return all(shutil.which(tool) for tool in (*_PLACING, *_DRAWING))


class Project:
    """A project file of photos, in a folder of its own, and what the tools took so far."""

    def __init__(self, photos: Sequence[RgbImage], folder: Path) -> None:
        self.folder = folder
        self.file = str(folder / "page.pto")
        self.sizes = [(photo.shape[1], photo.shape[0]) for photo in photos]
        self.factors = [min(_SIDE_PX / max(size), 1.0) for size in self.sizes]
        self.paths = [str(folder / f"photo{k:02d}.png") for k in range(len(photos))]
        self.usage = Usage()
        for photo, factor, path in zip(photos, self.factors, self.paths, strict=True):
            small = cv2.resize(photo, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            cv2.imwrite(path, small[..., ::-1])

    def place(self) -> tuple[Mesh | None, ...] | None:
        """Where each photo lies; None where a tool fails or nothing is joined.

        Points by cpfind in all pairs, outliers dropped by cpclean; then each photo's direction and place, and
        one field of view, against the plane that the first photo shows frontally.
        """
        if not (
            self._run("pto_gen", "-p", "0", "-f", str(_FIELD_OF_VIEW), *self.paths)
            and self._run("cpfind", "--fullscale", self.file)
            and self._run("cpclean", self.file)
        ):
            return None
        base, *others = joined = self.joined()
        moves = [f"{name}{k}" for k in others for name in ("y", "p", "r", "TrX", "TrY", "TrZ")]
        if not (
            others
            and self._run("pto_var", f"--anchor={base}", "--opt", ",".join(["v0", *moves]), self.file)
            and self._run("autooptimiser", "-n", self.file)
            and self._run("pano_modify", "--projection=0", "--fov=AUTO", "--canvas=AUTO", self.file)
        ):
            return None
        return tuple(self._mesh(k) if k in joined else None for k in range(len(self.paths)))

    def draw(self, photos: Sequence[int]) -> RgbImage | None:
        """The page of these photos by nona and enblend, or None where they fail."""
        part, page = str(self.folder / "part"), str(self.folder / "page.tif")
        if not self._run("nona", "-m", "TIFF_m", *(f"-i{k}" for k in photos), self.file, output=part):
            return None
        if not self._run("enblend", *map(str, sorted(self.folder.glob("part*.tif"))), output=page):
            return None
        drawn = cv2.imread(page, cv2.IMREAD_UNCHANGED)
        if drawn is None or drawn.shape[2:] != (4,):
            return None
        rgb = np.ascontiguousarray(drawn[..., 2::-1])
        rgb[drawn[..., 3] == 0] = 255
        return rgb

    def _run(self, tool: str, *arguments: str, output: str | None = None) -> bool:
        """By default a tool writes the project anew."""
        command = [tool, "-o", output or self.file, *arguments]
        trouble, usage = run_limited(command, str(self.folder))
        self.usage.add(usage)
        return not trouble

    def joined(self) -> list[int]:
        """The largest group of photos that control points ("c n0 N1 ...") connect."""
        group = list(range(len(self.paths)))
        for a, b in re.findall(r"^c n(\d+) N(\d+) ", Path(self.file).read_text(), re.MULTILINE):
            old, new = group[int(b)], group[int(a)]
            group = [new if entry == old else entry for entry in group]
        largest = max(group, key=group.count)
        return [k for k, entry in enumerate(group) if entry == largest]

    def _mesh(self, photo: int) -> Mesh:
        """Where the nodes of a photo's grid come to lie on the page, by pano_trafo."""
        nodes = photo_nodes(*self.sizes[photo])
        small = (nodes.reshape(-1, 2) + 0.5) * self.factors[photo] - 0.5
        told = subprocess.run(
            ["pano_trafo", self.file, str(photo)],
            input="\n".join(f"{x} {y}" for x, y in small),
            capture_output=True,
            text=True,
            check=True,
            timeout=TIME_LIMIT_S,
        )
        places = [[float(word) for word in line.split()[:2]] for line in told.stdout.splitlines()]
        return np.reshape(places, nodes.shape)
