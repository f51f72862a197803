"""Pictures of pages that are kept with their results, as blobs, until the results are deleted or expire."""

from collections import defaultdict
from collections.abc import Collection, Mapping
from datetime import UTC, datetime, timedelta

from app.blobs import BlobAccess
from app.layout_store import LayoutStore
from models.blobs import BlobNotFound
from models.errors import ResultNotFound

_PREFIX = "page-images"
_ALL = timedelta(days=1)
"""From now: blobs that were written before then are all blobs, even if clocks differ."""


class KeptImages:
    """The pictures of results. The key of a picture has the id of its result and its number of bytes."""

    def __init__(self, blobs: BlobAccess, store: LayoutStore, most_bytes: int) -> None:
        """`most_bytes` limits all pictures together."""
        self._blobs = blobs
        self._store = store
        self._most_bytes = most_bytes

    async def keep(self, pictures: Mapping[str, bytes]) -> None:
        """Keep the pictures of results, by their ids; empty ones are left out.

        Raises
        ------
        StoreError
            When one cannot be written; then none is kept.
        """
        try:
            for result_id, picture in pictures.items():
                if picture:
                    await self._blobs.put(_key(result_id, len(picture)), picture, len(picture))
        except BaseException:
            await self.forget(pictures)
            raise

    async def picture(self, result_id: str, size_bytes: int) -> bytes:
        """The JPEG file of a result's page. Raises `ResultNotFound` when it is no longer kept."""
        try:
            return await self._blobs.get(_key(result_id, size_bytes))
        except BlobNotFound as error:
            raise ResultNotFound(
                f"the picture of result {result_id!r} is no longer kept (MAX_KEPT_IMAGES_BYTES); send the page again",
                result_id,
            ) from error

    async def forget(self, result_ids: Collection[str]) -> None:
        """Delete the pictures of results."""
        for result_id in result_ids:
            await self._blobs.sweep(f"{_PREFIX}/{result_id}", _now() + _ALL, lambda key: False)

    async def sweep(self) -> int:
        """Delete pictures whose results are gone, and the oldest ones over the limit of bytes; their number."""
        keys: defaultdict[str, list[str]] = defaultdict(list)
        total = 0

        def note(key: str) -> bool:
            nonlocal total
            keys[key.split("/")[1]].append(key)
            total += _size_of(key)
            return True

        await self._blobs.sweep(_PREFIX, _now() + _ALL, note)
        kept = await self._store.call(lambda store: store.kept_results(keys))
        gone = [key for result_id in keys.keys() - kept for key in keys[result_id]]
        total -= sum(map(_size_of, gone))
        for result_id in sorted(kept):  # ids grow with time
            if total <= self._most_bytes:
                break
            gone += keys[result_id]
            total -= sum(map(_size_of, keys[result_id]))
        if gone:
            await self._blobs.delete(*gone)
        return len(gone)


def _key(result_id: str, size_bytes: int) -> str:
    return f"{_PREFIX}/{result_id}/{size_bytes}"


def _size_of(key: str) -> int:
    """Number of bytes of a picture; 0 for one that is still being written."""
    size = key.rpartition("/")[2]
    return int(size) if size.isdigit() else 0


def _now() -> datetime:
    return datetime.now(UTC)
