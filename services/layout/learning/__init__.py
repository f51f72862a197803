"""Adaptive model learning (5.5): models that learn from one verified page at once, and from rounds of all."""
