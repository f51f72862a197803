"""Pages of no known class, and samples of all classes: what they say of the set of models."""

from dataclasses import dataclass
from typing import Any

from app.operations.layout import LayoutSettings, layout_settings


@dataclass(frozen=True, slots=True)
class StoredPage:
    """A page as it is kept, unknown or a sample: its id, and its document."""

    id: str
    document: dict[str, Any]


def propose_classes(
    unknown: list[StoredPage], classes: dict[str, list[StoredPage]], settings: LayoutSettings
) -> dict[str, object]:
    """New classes among unknown pages, and classes to merge or to split, by their samples."""
    from services.operations import layout_discovery

    def pages(kept: list[StoredPage]) -> list[layout_discovery.StoredPage]:
        return [layout_discovery.StoredPage(page.id, page.document) for page in kept]

    samples = {name: pages(kept) for name, kept in classes.items()}
    return layout_discovery.propose_classes(pages(unknown), samples, layout_settings(settings))
