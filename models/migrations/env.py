"""Alembic's entry: runs the migrations on the connection that `models.session` hands over, in its transaction.

Batch mode, since SQLite changes a table by making it anew.
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
