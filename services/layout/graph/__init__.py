"""A page as an attributed graph: its zones, their pairs, and what is measured of both (5.3)."""
