"""Evidence of a page's shape in a photo, before a shape is fitted to it."""

from dataclasses import dataclass

from services.arrays import Points
from services.geometry.photo_frame import PhotoFrame
from services.geometry.vanishing_points import FlowVanishingPoints
from services.sheet.developable.fitting import SurfaceStart
from services.sheet.tracing.page_text import TracedText
from services.texture_flow.field import FlowSamples


@dataclass(frozen=True, slots=True, eq=False)
class PageEvidence:
    """Text, flows and their vanishing points; the flows are in centred unit coordinates of `view`.

    Where no strokes were seen (`has_strokes`), `minor` has weak samples across the major flow.
    """

    text: TracedText
    view: PhotoFrame
    major: FlowSamples
    minor: FlowSamples
    vanishing_points: FlowVanishingPoints
    has_strokes: bool = True
    start: SurfaceStart | None = None
    """A bent sheet near the right one, from which a fit may start."""

    @property
    def characters(self) -> Points:
        """Centres of the characters (N, 2), centred."""
        return self.view.to_centred(self.text.characters)

    @property
    def strokes(self) -> FlowSamples | None:
        """The minor flow where strokes were seen."""
        return self.minor if self.has_strokes else None
