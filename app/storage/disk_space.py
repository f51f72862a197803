"""Free space of the folders in which the service writes."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from app.storage.probe import Probe


class DiskSpace:
    """Says whether uploads and results still fit on the disk."""

    def __init__(self, folders: Sequence[Path], least_bytes: int) -> None:
        self._folders = (*folders, Path(tempfile.gettempdir()))
        self._least_bytes = least_bytes
        self._probe = Probe(self._free_bytes, "disk")

    def _free_bytes(self) -> int:
        return min(shutil.disk_usage(folder).free for folder in self._folders)

    async def is_enough(self, within_s: float) -> bool:
        """Whether every folder is there and has the least space; False if that takes longer than `within_s` seconds."""
        free = await self._probe.result(within_s)
        return free is not None and free >= self._least_bytes
