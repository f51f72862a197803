"""One module for each change of the tables, ordered by `down_revision`. A released module never changes."""
