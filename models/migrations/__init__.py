"""How a database of any earlier release becomes one of this release; run by `models.session` at start-up."""
