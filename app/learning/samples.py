"""The samples from which a model is made, as many as a worker can process."""

from collections import Counter
from collections.abc import Container, Sequence

from models.errors import ModelNotFound
from models.records import StoredSample
from models.repository import Store
from services.errors import DocumentError

MOST_ZONES = 40_000
"""Largest number of zones of all samples: 1000 pages of 40 zones, or 80 of the largest; they take two minutes."""
MOST_CHARACTERS = 20_000_000
"""Largest size of their texts, which are sent to the worker; ordinary pages have a tenth of it."""


class NoSamples(DocumentError):
    """The model has no samples."""

    code = "no-samples"


def samples_to_learn_from(store: Store, name: str) -> list[StoredSample]:
    """The newest samples within the limits, oldest first; at least one.

    Raises
    ------
    ModelNotFound, NoSamples
    """
    samples = newest_samples(store, name)
    if not samples:
        raise NoSamples(f"Model {name} has no samples. Add one with POST /layout/models/{name}/samples.")
    return samples


def samples_note(samples: Sequence[StoredSample]) -> str:
    """The note of a version that was made from these samples: their number, and which segmentation saw their images."""
    names = Counter(sample.document.get("segmentation") for sample in samples)
    unseen = names.pop(None, 0)
    if not names:
        return f"{len(samples)} samples"
    seen = ", ".join(f"{count} by segmentation {name}" for name, count in sorted(names.items()))
    return f"{len(samples)} samples: {seen}" + (f", {unseen} without" if unseen else "")


def items_of(store: Store, name: str) -> tuple[str, ...]:
    """The columns of the table of a class, by its settings; none of a class that does not exist yet."""
    try:
        return store.settings(name).items
    except ModelNotFound:
        return ()


def newest_samples(store: Store, name: str, without_results: Container[str] = ()) -> list[StoredSample]:
    """The newest samples within the limits, oldest first, except those that verify one of these results."""
    samples: list[StoredSample] = []
    zones = characters = 0
    for sample in store.each_sample(name, newest_first=True):
        if sample.result_id is not None and sample.result_id in without_results:
            continue
        page = sample.document["zones"]
        second = sample.document.get("found")
        found = [] if second is None else second["zones"]
        zones += max(len(page), len(found))
        characters += sum(len(zone.get("text") or "") for zone in (*page, *found))
        if samples and (zones > MOST_ZONES or characters > MOST_CHARACTERS):
            break
        samples.append(sample)
    return samples[::-1]
