"""A bent page in a small photo, as framing and drawing get it."""

import itertools
from dataclasses import dataclass

import numpy as np

from services.arrays import Points, RgbImage
from services.geometry.photo_frame import PhotoFrame
from services.sheet.developable.surface import DevelopableSurface
from services.sheet.framing import CurvedFrame, frame_curved_page
from tests.services.sheet.developable.sheets import Bent, box

PERIOD = 24.0
"""Of the coded photo's waves, px."""
SHEET = Bent(anchor=(0.0, 0.0), turn=(0.25, -0.2, 0.1))


@dataclass(frozen=True, slots=True)
class BentView:
    """A sheet printed over [-`half`[0], `half`[0]] x [-`half`[1], `half`[1]], seen in a photo."""

    bent: Bent = SHEET
    half: tuple[float, float] = (0.35, 0.42)
    width: int = 420
    height: int = 540

    @property
    def view(self) -> PhotoFrame:
        """The photo's size."""
        return PhotoFrame(self.width, self.height)

    @property
    def surface(self) -> DevelopableSurface:
        """The sheet."""
        return self.bent.surface()

    def in_photo(self, page: Points) -> Points:
        """Photo pixels of page points."""
        return np.asarray(self.surface.to_photo(page) * self.view.unit_px + self.view.centre)

    @property
    def characters(self) -> Points:
        """Photo pixels of the print."""
        return self.in_photo(box(*self.half, 24, 30))

    def outline(self, margin: float = 0.06) -> Points:
        """The sheet's border in the photo, `margin` beyond the print."""
        u, v = self.half[0] + margin, self.half[1] + margin
        corners = np.array([[-u, -v], [u, -v], [u, v], [-u, v], [-u, -v]])
        steps = np.linspace(0, 1, 60)[:-1, None]
        sides = [a + steps * (b - a) for a, b in itertools.pairwise(corners)]
        return self.in_photo(np.concatenate(sides))

    def frame(self, paper: Points | None = None, text_height_px: float = 5.0) -> CurvedFrame:
        """The view that is shown."""
        return frame_curved_page(self.surface, self.view, self.characters, text_height_px, paper)

    def coded(self) -> RgbImage:
        """A photo whose colours tell the place: smooth waves across, down and aslant."""
        x, y = np.meshgrid(np.arange(float(self.width)), np.arange(float(self.height)))
        colours = np.round(code(np.stack([x.ravel(), y.ravel()], axis=1)))
        return np.asarray(colours.reshape(self.height, self.width, 3), np.uint8)


def code(photo: Points) -> Points:
    """Colours (N, 3) at photo pixels (N, 2)."""
    phase = (
        2 * np.pi / PERIOD * np.stack([photo[:, 0], photo[:, 1], 0.6 * (photo[:, 0] + photo[:, 1])], axis=1)
    )
    return np.asarray(127.0 + 100.0 * np.sin(phase))


def drawn_off(image: RgbImage, photo: Points, pixels: Points) -> Points:
    """How far (2,) from `photo` points (N, 2) the coded photo was taken at integer output `pixels` (N, 2)."""
    x, y = pixels.astype(int).T
    miss = image[y, x].astype(np.float64) - code(photo)
    d = 0.01
    slope = np.stack([(code(photo + e) - code(photo - e)) / (2 * d) for e in d * np.eye(2)], axis=-1)
    return np.asarray(np.linalg.lstsq(slope.reshape(-1, 2), miss.ravel(), rcond=None)[0])
