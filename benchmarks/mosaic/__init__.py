"""Mosaics of simulated photos, and what else a mosaic must hold to."""
