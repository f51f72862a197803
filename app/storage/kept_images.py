"""Pictures of pages that are kept with results or samples, and kept photos, as blobs, until these expire."""

from collections import defaultdict
from collections.abc import Callable, Collection, Mapping
from datetime import UTC, datetime

from app.storage.blobs import ALL_BLOBS, BlobAccess
from app.storage.layout_store import LayoutStore
from models.blobs import BlobNotFound
from models.errors import ResultNotFound
from models.repository import Store


class KeptImages:
    """The pictures of results or samples, or bundles of kept pages. A key has their id and the number of bytes."""

    def __init__(
        self,
        blobs: BlobAccess,
        store: LayoutStore,
        most_bytes: int,
        folder: str = "page-images",
        kept: Callable[[Store, Collection[str]], set[str]] = Store.kept_results,
    ) -> None:
        """`most_bytes` limits all pictures together; `kept` returns those of some ids that the store still has."""
        self._blobs = blobs
        self._store = store
        self._most_bytes = most_bytes
        self._folder = folder
        self._kept = kept

    async def keep(self, pictures: Mapping[str, bytes]) -> None:
        """Keep the pictures of results, by their ids; empty ones are left out.

        Raises
        ------
        StoreError
            When one cannot be written; then none is kept.
        """
        try:
            for result_id, picture in pictures.items():
                if 0 < len(picture) <= self._most_bytes:
                    await self._blobs.put(self._key(result_id, len(picture)), picture, len(picture))
        except BaseException:
            await self.forget(pictures)
            raise

    async def picture(self, result_id: str, size_bytes: int) -> bytes:
        """The JPEG file of a result's page. Raises `ResultNotFound` when it is no longer kept."""
        try:
            return await self._blobs.get(self._key(result_id, size_bytes))
        except BlobNotFound as error:
            raise ResultNotFound(
                f"the picture of result {result_id!r} is not there: it gave way to newer ones "
                "(MAX_KEPT_IMAGES_BYTES), or the database was restored without its blobs; send the page again",
                result_id,
            ) from error

    async def forget(self, result_ids: Collection[str]) -> None:
        """Delete the pictures of results."""
        for result_id in result_ids:
            await self._blobs.sweep(f"{self._folder}/{result_id}", _now() + ALL_BLOBS, lambda key: False)

    async def sizes(self) -> dict[str, int]:
        """Number of bytes of the picture of each id that has one."""
        return {each: max(map(_size_of, keys)) for each, keys in (await self._keys()).items()}

    async def _keys(self) -> dict[str, list[str]]:
        """Keys of all pictures by their ids."""
        keys: defaultdict[str, list[str]] = defaultdict(list)

        def note(key: str) -> bool:
            keys[key.split("/")[1]].append(key)
            return True

        await self._blobs.sweep(self._folder, _now() + ALL_BLOBS, note)
        return keys

    async def sweep(self) -> int:
        """Delete pictures whose results or samples are gone, and the oldest over the limit of bytes; their number."""
        keys = await self._keys()
        total = sum(_size_of(key) for each in keys.values() for key in each)
        kept = await self._store.call(lambda store: self._kept(store, keys))
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

    def _key(self, result_id: str, size_bytes: int) -> str:
        return f"{self._folder}/{result_id}/{size_bytes}"


def _size_of(key: str) -> int:
    """Number of bytes of a picture; 0 for one that is still being written."""
    size = key.rpartition("/")[2]
    return int(size) if size.isdigit() else 0


def _now() -> datetime:
    return datetime.now(UTC)
