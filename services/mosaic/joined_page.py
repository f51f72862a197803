"""The page that photos show together only: flattened once more, as one picture.

Parts of a page with little print, or with one of its sides each, may not show the page's shape by themselves. Such
photos are joined as they are, in the perspective of one of them; the joined picture has the print and sides of all.
"""

from dataclasses import dataclass

from services.arrays import Homography, RgbImage
from services.contract.rectify import RectifyParameters
from services.errors import NoText
from services.notices import Notice
from services.rectify.page_search import find_page
from services.rectify.stage_clock import StageClock
from services.rectify.view.drawing import draw_flat_view
from services.rectify.view.judged_view import best_view

AS_JOINED = Notice(
    "not-flat",
    "the photos were joined as they are: none shows the page's shape by its print or its sides, and all together show "
    "no flat sheet. Photograph larger parts of the page, sharper or in better light.",
)


@dataclass(frozen=True, slots=True, eq=False)
class JoinedPage:
    """The flat page `image` (H, W, 3), and its pixels -> pixels of the joined picture."""

    image: RgbImage
    H_joined_page: Homography
    notices: tuple[Notice, ...]


def flatten_joined(joined: RgbImage, clock: StageClock) -> JoinedPage | None:
    """The flat page in the picture `joined` (H, W, 3); None where that shows none, or not a plane."""
    asked = RectifyParameters(upright=False)
    try:
        page = find_page(joined, asked, None, clock)
    except NoText:
        return None
    view = best_view(joined, page, asked)
    H = view.frame.H_photo_flat
    if H is None:
        return None
    image = draw_flat_view(joined, view.frame, view.paper)
    return JoinedPage(image, H, (*view.page.notices, *view.notices))
