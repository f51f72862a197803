"""Migrations that bring the database of an earlier release up to date; `models.session` runs them at start-up."""
