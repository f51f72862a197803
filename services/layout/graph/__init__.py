"""A page as an attributed graph: zones, pairs of zones, and their attributes (5.3)."""
