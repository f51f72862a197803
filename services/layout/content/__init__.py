"""Content features: what the texts of zones are about (5.6.2, Table 5.1)."""
