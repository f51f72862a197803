"""All that a database holds, to be compared before and after."""

from typing import Any

from sqlalchemy import select

from models.repository import Store
from models.tables import Table


def everything(store: Store) -> dict[str, list[tuple[Any, ...]]]:
    """The rows of every table, sorted."""
    with store._reading() as session:
        return {
            name: sorted((tuple(row) for row in session.execute(select(table))), key=repr)
            for name, table in Table.metadata.tables.items()
        }
