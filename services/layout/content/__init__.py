"""Content features: the kind of text in a zone, such as a date or a greeting (5.6.2, Table 5.1)."""
