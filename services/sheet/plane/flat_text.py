"""The text of a page in the flat view of a plane, where its characters form lines."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from services.arrays import Homography, Mask
from services.geometry.homographies import jacobians, scaling, transform_points, translation
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import PagePlane
from services.sheet.developable.observations import LineObservations
from services.sheet.tracing.baselines import Baselines, CharacterRows, chain_characters, fit_baselines
from services.sheet.tracing.line_tracing import trace_rows
from services.sheet.tracing.page_text import MOST_PIXELS, TracedText

FLAT_SCALE = 1.2
"""Resolution of the flat ink over that of the text: a mapping without this surplus would merge strokes."""


@dataclass(frozen=True, eq=False)
class FlatText:
    """Ink (H, W) in a flat view, and the map from its pixels to centred coordinates."""

    ink: Mask
    H_centred_flat: Homography

    @cached_property
    def rows(self) -> CharacterRows:
        """Its characters, chained into lines."""
        return chain_characters(self.ink)

    @cached_property
    def baselines(self) -> Baselines:
        """Of its lines, in pixels of the view."""
        return fit_baselines(self.rows)

    @cached_property
    def lines(self) -> LineObservations:
        """Its lines piece by piece, in centred coordinates of the photo."""
        return trace_rows(self.rows, PlaneMap(self.H_centred_flat))


def flatten_text(text: TracedText, view: PhotoFrame, plane: PagePlane) -> FlatText:
    """The text in the flat view of `plane`, at about the resolution it was found in."""
    H_reduced_centred = text.H_reduced_centred(view)
    H_reduced_plane = H_reduced_centred @ plane.H_centred_plane
    at = transform_points(np.linalg.inv(plane.H_centred_plane), view.to_centred(text.characters))
    density = np.sqrt(np.abs(np.linalg.det(jacobians(H_reduced_plane, at))))
    margin = 2 * text.height_px * text.factor / float(np.median(density))
    low, high = at.min(axis=0) - margin, at.max(axis=0) + margin
    scale = FLAT_SCALE * float(np.median(density))
    scale = min(scale, float(np.sqrt(MOST_PIXELS / np.prod(high - low))))
    H_flat_plane = scaling(scale) @ translation(-float(low[0]), -float(low[1]))
    width, height = (max(int(np.ceil(v)), 1) for v in (high - low) * scale)
    H_reduced_flat = H_reduced_plane @ np.linalg.inv(H_flat_plane)
    ink = cv2.warpPerspective(
        text.ink.view(np.uint8) * np.uint8(255),
        H_reduced_flat,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
    )
    return FlatText(ink > 127, np.linalg.inv(H_reduced_centred) @ H_reduced_flat)
