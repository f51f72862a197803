"""One module a change of the tables, in the order of their `down_revision`; none changes once released."""
