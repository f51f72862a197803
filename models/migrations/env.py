"""Alembic's entry point: runs the migrations on the connection of `models.session`, in its transaction.

Batch mode is needed, since SQLite changes a table by creating a new one.
"""

from alembic import context

from models.tables import Table

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=Table.metadata,
    render_as_batch=True,
)
with context.begin_transaction():
    context.run_migrations()
