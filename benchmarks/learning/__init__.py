"""Models that learn from samples and feedback; servers that are killed while they learn."""
