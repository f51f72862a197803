"""Focal lengths of cameras: read before photos are flattened, and kept as their pages have shown them.

Photos are flattened also while the store is not available; then nothing is remembered.
"""

import logging
import math
from collections.abc import Iterable

from app.access.callers import Caller
from app.storage.layout_store import LayoutStore
from models.errors import StoreError
from services.contract.answers.rectify import RectifyResult
from services.contract.cameras import CameraMemory

log = logging.getLogger(__name__)


async def known_cameras(store: LayoutStore, caller: Caller, *, is_enabled: bool) -> tuple[CameraMemory, ...]:
    """Cameras of the caller; none where the memory is not enabled, or the store is not available."""
    if not is_enabled:
        return ()
    try:
        found = await store.call(lambda opened: opened.cameras(caller.name))
    except StoreError as error:
        log.warning("cameras could not be read: %s", error.detail)
        return ()
    return tuple(memory for memory, _ in found)


async def keep_cameras(store: LayoutStore, caller: Caller, pages: Iterable[RectifyResult]) -> None:
    """Keep the focal lengths that the pages of a response show."""
    seen = seen_cameras(pages)
    if not seen:
        return
    try:
        await store.call(lambda opened: opened.remember_cameras(caller.name, seen))
    except StoreError as error:
        log.warning("cameras could not be kept: %s", error.detail)


def seen_cameras(pages: Iterable[RectifyResult]) -> dict[str, list[tuple[float, float]]]:
    """By the name of a camera: log of the focal length over half the diagonal, and the standard deviation of that."""
    seen: dict[str, list[tuple[float, float]]] = {}
    for page in pages:
        name, focal_px = page.camera.name, page.camera.page_focal_length_px
        deviation = page.camera.page_focal_deviation
        if name and focal_px and deviation is not None:
            half_diagonal = math.hypot(page.photo.width, page.photo.height) / 2
            seen.setdefault(name, []).append((math.log(focal_px / half_diagonal), deviation))
    return seen
