"""The samples that a model is made of, and learns from: as many as a worker can take."""

from collections.abc import Container

from models.records import StoredSample
from models.repository import Store
from services.errors import DocumentError

MOST_ZONES = 40_000
"""Of all samples that a model is made of: 1000 pages of 40 zones, or 80 of the largest; they take two minutes."""
MOST_CHARACTERS = 20_000_000
"""Of their texts, which cross from here to the worker; ordinary pages of so many zones have a tenth of it."""


class NoSamples(DocumentError):
    """There is nothing to make a model of."""

    code = "no-samples"


def samples_to_learn_from(store: Store, name: str) -> list[StoredSample]:
    """The newest samples within the bounds, oldest first; one at least.

    Raises
    ------
    ModelNotFound, NoSamples
    """
    samples = newest_samples(store, name)
    if not samples:
        raise NoSamples(f"Model {name} has no samples; POST /layout/models/{name}/samples adds one.")
    return samples


def newest_samples(store: Store, name: str, without_results: Container[str] = ()) -> list[StoredSample]:
    """The newest samples within the bounds, oldest first, but for those that verify one of these results."""
    samples: list[StoredSample] = []
    zones = characters = 0
    for sample in store.each_sample(name, newest_first=True):
        if sample.result_id is not None and sample.result_id in without_results:
            continue
        page = sample.document["zones"]
        found = (sample.document.get("found") or {}).get("zones", [])
        zones += max(len(page), len(found))
        characters += sum(len(zone.get("text") or "") for zone in (*page, *found))
        if samples and (zones > MOST_ZONES or characters > MOST_CHARACTERS):
            break
        samples.append(sample)
    return samples[::-1]
