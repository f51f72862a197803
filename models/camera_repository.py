"""The store's calls for cameras: the focal lengths that their pages have shown."""

import json
from collections.abc import Mapping
from datetime import datetime

from sqlalchemy import delete, select

from models.clocks import oldest_first
from models.tables import CameraRow
from models.transactions import Transactions
from services.contract.cameras import MOST_PHOTOS, CameraMemory, remember

MOST_CAMERAS = 50
"""Of one owner; the least recently used ones are deleted first."""


class CameraRepository(Transactions):
    """Focal lengths of cameras. `owner` is the name of an API key; None: the service has no keys."""

    def cameras(self, owner: str | None) -> list[tuple[CameraMemory, datetime]]:
        """Cameras of one owner and when they were last used, the newest first."""
        wanted = select(CameraRow).where(CameraRow.owner == (owner or "")).order_by(CameraRow.used_at.desc())
        with self._reading() as session:
            rows = session.scalars(wanted.limit(MOST_CAMERAS)).all()
        return [(remember(row.name, [(f, d) for f, d in json.loads(row.seen)]), row.used_at) for row in rows]

    def remember_cameras(self, owner: str | None, seen: Mapping[str, list[tuple[float, float]]]) -> None:
        """Add what pages have shown: by camera, pairs (log focal length, its standard deviation)."""
        with self._changing() as (session, _):
            for name, pairs in seen.items():
                row = session.get(CameraRow, (owner or "", name))
                if row is None:
                    row = CameraRow(owner=owner or "", name=name, seen="[]", used_at=self._clock())
                    session.add(row)
                kept = [*json.loads(row.seen), *pairs][-MOST_PHOTOS:]
                row.seen = json.dumps([[round(focal, 5), round(deviation, 5)] for focal, deviation in kept])
                row.used_at = self._clock()
            session.flush()
            own = CameraRow.owner == (owner or "")
            order = oldest_first(CameraRow.used_at, self._clock())
            old = select(CameraRow.name).where(own).order_by(*(each.desc() for each in order))
            names = session.scalars(old.offset(MOST_CAMERAS)).all()
            session.execute(delete(CameraRow).where(own, CameraRow.name.in_(names)))

    def forget_camera(self, owner: str | None, name: str) -> bool:
        """Delete a camera; whether it was there."""
        with self._changing() as (session, _):
            row = session.get(CameraRow, (owner or "", name))
            if row is not None:
                session.delete(row)
            return row is not None
